"""Store checkpoints: all data to continue a run from its last level, on any number of ranks.

``checkpoint.h5`` is written after each level, and the previous one is kept as
``checkpoint_before.h5``. Both use the order of the input. A checkpoint contains the data of loading
by chosen steps: the previous state and the progress of the limit load search. It also contains the
internal variables of the laws, each under its name. The algorithms need no other data from previous
levels: ALG2 begins each level with σ = Σ(ε(u)) and a new penalty.
"""

import dataclasses
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.io.case.schema import Table
from perfplast_fenicsx.io.results.checkpoint_header import (
    SCHEMA,
    Header,
    damaged,
    generations,
    header_of,
    nothing_left,
    packed,
    read_header,
)
from perfplast_fenicsx.io.results.fingerprint import case_hash, mesh_hash
from perfplast_fenicsx.io.results.parallel_hdf5 import checksum, read_rows, write_arrays
from perfplast_fenicsx.io.results.result_files import BEFORE, NEWEST
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.mesh.global_ordering import (
    Block,
    Ordering,
    block,
    cell_ordering,
    node_ordering,
)
from perfplast_fenicsx.problem.assembled.spaces import space_at_points
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.load_stepping import Reached

HISTORY = "history"
"""Group of the internal variables, arrays of numbers at the points of each cell."""

BEFORE_LAST = "_before"
"""Suffix of the names of arrays and groups of the level before the last."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Saved:
    """The content of a checkpoint.

    Attributes:
        reports: Reports of the levels so far.
        level: The last level, without its iterations; None before the first.
        before: State of the previous level.
        search: State of the search for a limit load, if there is one.
        timings: Wall time by activity (s).
    """

    reports: Sequence[LevelReport] = ()
    level: Level | None = None
    before: State | None = None
    search: Search | None = None
    timings: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def reached(self) -> Reached | None:
        """Return how far a loading by chosen steps has come."""
        if self.level is None:
            return None
        rest = self.search.rest if self.search else None
        steps = self.level.report.newton_iterations
        return Reached(self.level.state, self.before, steps, rest or 0.0)


class Checkpoints:
    """Writes and reads the checkpoints of one problem."""

    def __init__(self, folder: ResultFolder, problem: Problem, case: Table, version: str) -> None:
        """Number cells and nodes, and check the mesh. Collective.

        Args:
            folder: Folder of the checkpoints.
            problem: Problem of the states.
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
        """Write a new checkpoint, and keep the present one as the previous one. Collective.

        Raises:
            InputError: If the system refuses; the checkpoints are then unchanged.
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
            stages: The stages of the problem, if any; the problem is then at the time of the last
                level.

        Raises:
            InputError: If there is no such checkpoint, or if the mesh is different.
        """
        header, faults = read_header(self._folder), []
        if header.mesh_hash != self._mesh_hash:
            raise InputError(
                f"the mesh differs from that of the checkpoint in '{self._folder.path}' "
                "(its points, cells or names have changed); give the original mesh, or "
                "start again with -o."
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
        """Return the content of a checkpoint.

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
        """Return displacement, history, and a byte for each node with a bit for each closed pair.

        ``end`` is the suffix of the names of the level before the last.
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
        """Return internal variables by name. Collective."""
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
        """Return vectors or numbers at the points of each cell, shape (num_cells, points, size)."""
        dofmap = function.function_space.dofmap
        points = dofmap.list[: self._owned_cells]
        return block(self._cells, function.x.array.reshape(-1, dofmap.index_map_bs)[points])

    def _to_points(self, values: npt.NDArray, function: fem.Function) -> None:
        dofmap = function.function_space.dofmap
        at_points = function.x.array.reshape(-1, dofmap.index_map_bs)
        at_points[dofmap.list[: self._owned_cells]] = self._cells.from_blocks(values)
        function.x.scatter_forward()


def _bits(problem: Problem) -> npt.NDArray[np.uint8]:
    """Return a bit for each pair on this rank; pairs of one host have different bits."""
    constraints = problem.constraints
    # Along this direction the normals of all faces that meet at a node differ.
    generic = np.array([0.5377, 0.8319, 0.1379])
    along = constraints.normal @ generic[: constraints.normal.shape[1]]
    order = np.lexsort([along, constraints.surface, constraints.host])
    _, first, counts = np.unique(constraints.host[order], return_index=True, return_counts=True)
    slot = np.empty(len(order), dtype=np.uint8)
    slot[order] = np.arange(len(order)) - np.repeat(first, counts)
    return np.left_shift(np.uint8(1), slot)
