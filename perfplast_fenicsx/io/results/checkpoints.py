"""Write and read checkpoints, with which a run continues on any number of ranks.

A run writes ``checkpoint.h5`` after each solved level, and keeps the previous file as
``checkpoint_before.h5``. The rows of arrays in both files have the order of cells and nodes in the
mesh input. A checkpoint contains the state of the last level, the previous state, and the internal
variables of the laws, each under its name. If the run searches for a limit load, the checkpoint
also contains the progress of the search. The algorithms need no other data from previous levels:
ALG2 begins each level with σ = Σ(ε(u)) and a new penalty.

Before a restart continues, the program checks that the case and the mesh have not changed.

The header of a checkpoint contains the hashes of the case and of the mesh. A further hash of the
header itself detects damage.
"""

import copy
import dataclasses
import hashlib
import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.io.case.schema import Table, shown
from perfplast_fenicsx.io.results.result_files import BEFORE, NEWEST
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import checksum, read_rows, set_checksum, write_arrays
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.mesh.global_ordering import (
    Block,
    Ordering,
    block,
    cell_ordering,
    node_ordering,
    with_ghosts,
)
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.spaces import space_at_points
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.proof.stored_file import stored_file
from perfplast_fenicsx.solvers.load_stepping import Reached
from perfplast_fenicsx.spatial_fields import PointValues, varying

log = logging.getLogger(__name__)


NOTHING = object()

CONTENT = "content"
"""Key for the hash of a data file's content; the key ``file`` beside it has the file's name."""


def case_hash(table: Table) -> str:
    """Return the SHA-256 of a case's data, which does not depend on layout and comments."""
    text = json.dumps(table, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def with_contents(table: Table, materials: Mapping[str, object]) -> Table:
    """Return the content of a case file with the hash of each data file added.

    Args:
        table: Content of the case file.
        materials: The materials of the case by names of bodies.
    """
    found = copy.deepcopy(table)
    for body, material in materials.items():
        for key, field in varying(material).items():
            if isinstance(field, PointValues):
                found["material"][body][key][CONTENT] = field.net.digest
    return found


def first_difference(now: Table, then: Table) -> str | None:
    """Return a description of the first difference from an earlier case; None if there is none.

    Additional load levels at the end do not count as a difference.
    """
    entries, earlier = dict(_entries(now)), dict(_entries(then))
    levels = ("loading.values",)  # a restart may have more entries at the end of these lists
    for key in (*entries, *earlier):
        new, old = entries.get(key, NOTHING), earlier.get(key, NOTHING)
        if key.endswith(f".{CONTENT}") and new != old:
            file = entries[key.removesuffix(CONTENT) + "file"]
            return f"the content of '{file}' differs from the content"
        if new is NOTHING:
            return f"{key} is missing, but was {shown(old)}"
        if old is NOTHING:
            return f"{key} = {shown(new)}, but the key was missing"
        if new != old and not (key in levels and _goes_on(new, old)):
            return _changed(key, new, old)
    return None


def _goes_on(new: object, old: object) -> bool:
    """Return whether ``new`` is the list ``old`` with additional entries at the end."""
    both = isinstance(new, list) and isinstance(old, list)
    return both and len(new) > len(old) and new[: len(old)] == old  # type: ignore[arg-type,index]


def _changed(key: str, new: object, old: object) -> str:
    """Return the new and the old value in words; of a list, the first changed entry."""
    if not (isinstance(new, list) and isinstance(old, list)):
        return f"{key} = {shown(new)}, but was {shown(old)}"
    pairs = enumerate(zip_longest(new, old, fillvalue=NOTHING), start=1)
    number, (now, then) = next((n, both) for n, both in pairs if both[0] != both[1])
    if now is NOTHING:
        return f"{key} has {len(new)} entries, but had {len(old)}"
    if then is NOTHING:
        return (
            f"{key} has {len(new)} entries, of which {shown(now)} is the first additional one, but "
            f"had {len(old)}"
        )
    return f"{key}: entry {number} is {shown(now)}, but was {shown(then)}"


def mesh_hash(tagged_mesh: TaggedMesh, cells: Ordering) -> str:
    """Return a hash of points, cells and tags that does not depend on the ranks. Collective."""
    mesh = tagged_mesh.mesh
    comm, tdim, dofs = mesh.comm, mesh.topology.dim, geometry_dofmap(mesh)
    index_map = mesh.geometry.index_map()
    owned = mesh.topology.index_map(tdim).size_local
    nodes = node_ordering(mesh, dofs, index_map)
    number = with_ghosts(index_map, nodes.numbers())
    body = np.zeros(len(dofs), dtype=np.int64)
    body[tagged_mesh.cell_tags.indices] = tagged_mesh.cell_tags.values
    x = mesh.geometry.x[: index_map.size_local]

    tags = tagged_mesh.facet_tags
    ours = tags.indices < mesh.topology.index_map(tdim - 1).size_local
    corners = number[entity_nodes(mesh, tdim - 1, tags.indices[ours])[:, :tdim]]
    facets = np.column_stack([np.sort(corners, axis=1), tags.values[ours]]).astype(np.int64)
    names = sorted(tagged_mesh.volumes.items()), sorted(tagged_mesh.surfaces.items())
    sums = [
        checksum(comm, block(nodes, x)),
        checksum(comm, block(cells, number[dofs[:owned]])),
        checksum(comm, block(cells, body[:owned])),
        set_checksum(comm, facets),
    ]
    return hashlib.sha256(json.dumps([sums, names]).encode()).hexdigest()


def _entries(table: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in nested tables with names such as ``material.upper.young``."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield from _entries(value, f"{place}.{key}" if place else key)
    elif isinstance(table, list) and table and all(isinstance(item, dict) for item in table):
        for number, item in enumerate(table, start=1):
            yield from _entries(item, f"{place}[{number}]" if len(table) > 1 else place)
    else:
        yield place, table


SCHEMA = 2
"""Version of the checkpoint format."""


@dataclass(frozen=True)
class Header:
    """The data of a checkpoint besides its arrays; the attributes are the keys of its JSON.

    Attributes:
        schema: :data:`SCHEMA`.
        version: Version of the program.
        case: Content of the case file.
        case_hash: Hash of the case.
        mesh_hash: Hash of the mesh.
        reports: Reports of the levels so far.
        search: State of the search for a limit load.
        timings: Wall time by activity (s).
        checksums: Checksums of the arrays by name.
    """

    schema: int
    version: str
    case: Table
    case_hash: str
    mesh_hash: str
    reports: list[dict[str, Any]]
    search: dict[str, Any] | None
    timings: dict[str, float]
    checksums: dict[str, int]


def read_header(folder: ResultFolder) -> Header:
    """Return the header of the newest checkpoint with a readable header. Collective.

    Raises:
        InputError: If no checkpoint has a readable header, or if it has another version of the
            format.
    """
    faults = []
    for path in generations(folder):
        try:
            header = header_of(folder.comm, path)
        except InputError as error:
            faults.append(str(error))
            continue
        if header.schema != SCHEMA:
            raise InputError(
                f"the checkpoint '{path}' has format {header.schema}, but this version of "
                f"perfplast reads format {SCHEMA}; continue with perfplast {header.version}, or "
                "start again with -o DIR --force."
            )
        return header
    raise nothing_left(folder, faults)


def check_case(folder: ResultFolder, table: Table, name: str) -> None:
    """Raise an error if the checkpoint belongs to another case. Collective.

    Args:
        folder: The folder of the checkpoint.
        table: Content of the case file.
        name: Name of the case file, for messages.

    Raises:
        InputError: If the case differs from the checkpoint's case; the message gives the first
            difference.
    """
    difference = first_difference(table, read_header(folder).case)
    if difference is not None:
        raise InputError(
            f"{name}: {difference} in the run whose checkpoint is in '{folder.path}'; restore its"
            " value to continue, or start again with -o DIR --force."
        )


def packed(header: Header, rank: int) -> Block:
    """Return the hash and the bytes of a header as a block whose rows are all on rank 0."""
    text = json.dumps(dataclasses.asdict(header)).encode()
    data = np.frombuffer(hashlib.sha256(text).digest() + text, dtype=np.uint8)
    return Block(data if rank == 0 else data[:0], 0 if rank == 0 else len(data), len(data))


def header_of(comm: MPI.Intracomm, path: Path) -> Header:
    """Return the header of a checkpoint. Collective.

    Raises:
        InputError: If the header cannot be read.
    """
    text, fault = b"", None
    if comm.rank == 0:
        try:
            with stored_file(path) as file:
                data = bytes(np.asarray(file["header"]))
            digest, text = data[:32], data[32:]
            if hashlib.sha256(text).digest() != digest:
                fault = damaged(path, "its header has changed since it was written")
        except FileNotFoundError:
            fault = f"'{path}' is missing"
        except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
            fault = damaged(path, error)
    raise_together(comm, fault)
    table = json.loads(comm.bcast(text))
    if table["schema"] != SCHEMA:
        known = {field.name: table.get(field.name) for field in dataclasses.fields(Header)}
        return Header(**known)
    return Header(**table)


def generations(folder: ResultFolder) -> list[Path]:
    """Return the paths of the newest and the previous checkpoint in a folder, in this order."""
    return [folder.file(NEWEST), folder.file(BEFORE)]


def damaged(path: Path, reason: object) -> str:
    """Return a clause that states why a checkpoint is damaged."""
    return f"the checkpoint '{path}' is damaged ({' '.join(str(reason).split())})"


def nothing_left(folder: ResultFolder, faults: Sequence[str]) -> InputError:
    """Return the error for a folder without a usable checkpoint."""
    return InputError(f"{', and '.join(faults)}; start again with -o {folder.path} --force.")


HISTORY = "history"
"""Group of the internal variables: arrays with values at the quadrature points of each cell."""

BEFORE_LAST = "_before"
"""Suffix in the names of arrays and groups that belong to the level before the last."""


@dataclass(frozen=True)
class Saved:
    """The content of a checkpoint.

    Attributes:
        reports: Reports of the levels so far.
        level: The last level, without its iterations; None before the first level.
        before: State of the level before the last; None if there is no such level.
        search: State of the search for a limit load; None if there is no search.
        timings: Wall time by activity (s).
    """

    reports: Sequence[LevelReport] = ()
    level: Level | None = None
    before: State | None = None
    search: Search | None = None
    timings: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def reached(self) -> Reached | None:
        """Return the point that automatic load steps have reached; None before the first level."""
        if self.level is None:
            return None
        rest = self.search.rest if self.search else None
        steps = self.level.report.newton_iterations
        return Reached(self.level.state, self.before, steps, rest or 0.0)


class Checkpoints:
    """Writes and reads the checkpoints of one problem."""

    def __init__(self, folder: ResultFolder, problem: Problem, case: Table, version: str) -> None:
        """Number the cells and nodes, and compute the hash of the mesh. Collective.

        Args:
            folder: Folder of the checkpoints.
            problem: The problem whose levels are stored.
            case: Content of the case file.
            version: Version of the program.
        """
        self._folder, self._problem, self._case, self._version = folder, problem, case, version
        mesh, V = problem.tagged_mesh.mesh, problem.V
        self._cells = cell_ordering(mesh)
        self._nodes = node_ordering(mesh, V.dofmap.list, V.dofmap.index_map)
        self._mesh_hash = mesh_hash(problem.tagged_mesh, self._cells)
        self._owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
        self._owned_nodes = V.dofmap.index_map.size_local
        self._bit = _bits(problem)

    def write(self, saved: Saved) -> None:
        """Write a new checkpoint; the existing file becomes the previous checkpoint. Collective.

        Raises:
            InputError: If the file cannot be written; existing checkpoints are then unchanged.
        """
        arrays: dict[str, Block] = {}
        if saved.level is not None:
            arrays = self._of_state(saved.level.state)
            arrays["stress"] = self._of_points(saved.level.stress)
            if saved.before is not None:
                arrays |= self._of_state(saved.before, BEFORE_LAST)
        header = Header(
            schema=SCHEMA,
            version=self._version,
            case=self._case,
            case_hash=case_hash(self._case),
            mesh_hash=self._mesh_hash,
            reports=[dataclasses.asdict(report) for report in saved.reports],
            search=dataclasses.asdict(saved.search) if saved.search else None,
            timings=saved.timings,
            checksums={name: checksum(self._problem.comm, rows) for name, rows in arrays.items()},
        )
        arrays["header"] = packed(header, self._problem.comm.rank)
        folder = self._folder
        write_arrays(folder, folder.file(NEWEST), arrays, folder.file(BEFORE))

    def read(self, stages: LoadingHistory | None = None) -> Saved:
        """Return the newest undamaged checkpoint. Collective.

        Args:
            stages: The stages of the problem, if it has any. This function sets them to the time of
                the last level.

        Raises:
            InputError: If there is no undamaged checkpoint, or if the mesh is different.
        """
        header, faults = read_header(self._folder), []
        if header.mesh_hash != self._mesh_hash:
            raise InputError(
                "the points, cells or names of the mesh differ from those of the checkpoint in "
                f"'{self._folder.path}'; give the original mesh, or start again with "
                "-o DIR --force."
            )
        for path in generations(self._folder):
            try:
                found = header_of(self._problem.comm, path)
                saved = self._read(found, path, stages)
            except InputError as error:
                faults.append(str(error))
                continue
            if faults:
                log.warning(
                    "%s; continuing from '%s', level %d", faults[0], path, len(saved.reports)
                )
            return saved
        raise nothing_left(self._folder, faults)

    def _read(self, header: Header, path: Path, stages: LoadingHistory | None) -> Saved:
        """Return the content of one checkpoint file.

        Raises:
            InputError: If the file is damaged.
        """
        comm, problem = self._problem.comm, self._problem
        arrays: dict[str, npt.NDArray] = {}
        fault = None
        try:
            for name in header.checksums:
                arrays[name] = read_rows(path, name, self._ordering(name))
        except OSError as error:
            fault = damaged(path, error)
        raise_together(comm, fault)
        for name, values in arrays.items():
            ordering = self._ordering(name)
            found = checksum(comm, Block(values, ordering.first, ordering.total))
            if found != header.checksums[name]:
                raise InputError(damaged(path, f"{name} has changed since it was written"))
        reports = [LevelReport(**report) for report in header.reports]
        search = Search(**header.search) if header.search else None
        if search:
            search.points = [(alpha, zeta) for alpha, zeta in search.points]
        level, before = None, None
        if reports:
            stress = fem.Function(problem.S, name="stress")
            self._to_points(arrays["stress"], stress)
            if stages is not None:
                stages.go_to(reports[-1].zeta)
            forces = contact_forces(problem, stress, reports[-1].zeta)
            level = Level(self._to_state(arrays, "", reports[-1]), stress, forces, reports[-1])
            if "displacement" + BEFORE_LAST in arrays:
                before = self._to_state(arrays, BEFORE_LAST, reports[-2])
        return Saved(reports, level, before, search, header.timings)

    def _of_state(self, state: State, end: str = "") -> dict[str, Block]:
        """Return the arrays of a state: displacement, history, and a byte of closed pairs per node.

        In the byte, each closed pair of the node has a bit. ``end`` is the suffix of the array
        names, which only the level before the last has.
        """
        width = self._problem.V.dofmap.index_map_bs
        u = state.u.x.array.reshape(-1, width)[: self._owned_nodes]
        bits = np.where(state.active, self._bit, 0)
        closed = np.bincount(self._problem.constraints.host, bits, self._owned_nodes).astype(
            np.uint8
        )
        return {
            f"displacement{end}": block(self._nodes, u),
            f"active{end}": block(self._nodes, closed),
            **{f"{HISTORY}{end}/{name}": self._of_points(f) for name, f in state.history.items()},
        }

    def _to_state(self, arrays: dict[str, npt.NDArray], end: str, report: LevelReport) -> State:
        u = fem.Function(self._problem.V, name="displacement")
        nodal = self._nodes.from_blocks(arrays["displacement" + end])
        u.x.array[: nodal.size] = nodal.ravel()
        u.x.scatter_forward()
        closed = self._nodes.from_blocks(arrays["active" + end])[self._problem.constraints.host]
        active = (closed & self._bit).astype(bool)
        return State(u, report.zeta, report.alpha, active, self._to_history(arrays, end))

    def _to_history(self, arrays: dict[str, npt.NDArray], end: str) -> dict[str, fem.Function]:
        """Return the internal variables from a checkpoint by name. Collective."""
        history, mesh = {}, self._problem.tagged_mesh.mesh
        for array, values in arrays.items():
            group, _, name = array.partition("/")
            if group == HISTORY + end:
                shape = values.shape[2:] if values.shape[2] > 1 else ()
                space = space_at_points(mesh, self._problem.degree, shape)
                history[name] = fem.Function(space, name=name)
                self._to_points(values, history[name])
        return history

    def _ordering(self, name: str) -> Ordering:
        at_points = name == "stress" or "/" in name
        return self._cells if at_points else self._nodes

    def _of_points(self, function: fem.Function) -> Block:
        """Return values at the points of each cell as a block, shape (num_cells, points, size)."""
        dofmap = function.function_space.dofmap
        points = dofmap.list[: self._owned_cells]
        return block(self._cells, function.x.array.reshape(-1, dofmap.index_map_bs)[points])

    def _to_points(self, values: npt.NDArray, function: fem.Function) -> None:
        dofmap = function.function_space.dofmap
        at_points = function.x.array.reshape(-1, dofmap.index_map_bs)
        at_points[dofmap.list[: self._owned_cells]] = self._cells.from_blocks(values)
        function.x.scatter_forward()


def _bits(problem: Problem) -> npt.NDArray[np.uint8]:
    """Return a bit for each pair on this rank; pairs with the same host have different bits."""
    constraints = problem.constraints
    # where faces meet at a node, their normals have different components in this direction
    generic = np.array([0.5377, 0.8319, 0.1379])
    along = constraints.normal @ generic[: constraints.normal.shape[1]]
    order = np.lexsort([along, constraints.surface, constraints.host])
    _, first, counts = np.unique(constraints.host[order], return_index=True, return_counts=True)
    slot = np.empty(len(order), dtype=np.uint8)
    slot[order] = np.arange(len(order)) - np.repeat(first, counts)
    return np.left_shift(np.uint8(1), slot)
