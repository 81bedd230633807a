"""Write HDF5 files of distributed arrays, and VTKHDF files for ParaView and PyVista.

The mesh is in a separate file, to which field files refer by HDF5 links. So VTK reads each field
file as a complete data set, although the mesh is stored only once. All arrays are in the order of
the input, whatever the number of ranks.

The points of the mesh are the nodes of the displacements, so quadratic displacements keep their
midside values, even on straight edges. Fields of lower degree are interpolated to these points. If
edges are curved, linear displacements are interpolated to the nodes of the curved mesh.

A crash does not damage files. Rank 0 creates a file under a temporary name and reserves its whole
size on the disk. Each rank writes its own rows directly into the file, at the position of the array
and without HDF5. The file gets its final name when all data are on the disk. So no rank gathers an
array, and a full disk is detected before an existing file changes. All errors are errors of the
operating system, which :meth:`ResultFolder.on_each` raises on all ranks.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from mpi4py import MPI

import basix.ufl
import h5py
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.io.utils import cell_perm_vtk

from perfplast_fenicsx.arrays import Ints, Longs
from perfplast_fenicsx.atomic_files import put
from perfplast_fenicsx.compat import coordinate_map, entity_nodes, geometry_dofmap
from perfplast_fenicsx.io.results.result_files import (
    BODY,
    CELL_DATA,
    CONNECTIVITY,
    FIELD_DATA,
    GRID,
    OFFSETS,
    POINT_DATA,
    POINTS,
    SURFACE_TAGS,
    SURFACES,
    TYPES,
)
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.mesh.global_ordering import (
    Block,
    Ordering,
    block,
    cell_ordering,
    node_ordering,
    with_ghosts,
)
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.proof.stored_file import stored_file

LAYOUT = 1 << 16
"""Largest size of the data in a file besides the arrays (bytes)."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def write_arrays(
    folder: ResultFolder,
    path: Path,
    blocks: Mapping[str, Block],
    before: Path | None = None,
    describe: Callable[[h5py.File], None] | None = None,
) -> None:
    """Write a file with arrays, or replace the file. Collective.

    Args:
        folder: Result folder, which provides the ranks and the message for system errors.
        path: The file; its folder exists.
        blocks: This rank's blocks of the arrays, by the full names of the arrays with their groups.
            An array may also be complete on rank 0 and empty on other ranks.
        before: New name for an existing file; None to replace the existing file.
        describe: Function that rank 0 calls with the new file, to add small data: groups,
            attributes, links, names. These data may take up to :data:`LAYOUT` bytes.

    Raises:
        InputError: On every rank, if the file cannot be written; an existing file is then
            unchanged.
    """
    part = path.with_name(path.name + ".part")
    offsets: dict[str, int] = {}

    def lay_out() -> None:
        part.unlink(missing_ok=True)  # a link may lead to another folder
        _reserve(part, LAYOUT + sum(_bytes(block) for block in blocks.values()))
        offsets.update(_lay_out(part, blocks, describe))
        _reserve(part, part.stat().st_size)

    def fill() -> None:
        file = os.open(part, os.O_WRONLY)
        try:
            for name, rows in blocks.items():
                row = _bytes(rows) // max(rows.total, 1)
                _write(file, rows.values, offsets[name] + rows.first * row)
            os.fsync(file)
        finally:
            os.close(file)

    try:
        folder.on_root(lay_out)
        offsets = folder.comm.bcast(offsets)
        folder.on_each(fill)
    except BaseException:
        if folder.comm.rank == 0:
            part.unlink(missing_ok=True)
        raise
    folder.on_root(lambda: put(part, path, before))


def read_rows(path: Path, name: str, ordering: Ordering) -> npt.NDArray:
    """Return this rank's block of an array in a file. Not collective.

    Raises:
        OSError: If the array is missing, has another length, or cannot be read.
    """
    try:
        with stored_file(path) as file:
            array = file[name]
            if len(array) != ordering.total:
                raise OSError(f"{name} has {len(array)} rows instead of {ordering.total}")
            return np.asarray(array[ordering.first : ordering.first + ordering.count])
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise OSError(f"{name} cannot be read: {error}") from error


def checksum(comm: MPI.Intracomm, rows: Block) -> int:
    """Return a checksum of an array, which does not depend on its distribution. Collective.

    The checksum is the sum over all entries of a hash of entry and index (the mixer of splitmix64).
    """
    width = max(1, int(np.prod(rows.shape[1:])))
    flat = rows.values.ravel()
    words = flat.view(np.uint64) if flat.itemsize == 8 else flat.astype(np.uint64)
    places = np.arange(words.size, dtype=np.uint64) + np.uint64(rows.first * width)
    hashes = _mixed(words ^ _mixed(places * GOLDEN + GOLDEN))
    total: int = comm.allreduce(int(hashes.sum(dtype=np.uint64)))
    return total % 2**64


def set_checksum(comm: MPI.Intracomm, rows: Longs) -> int:
    """Return a checksum of rows, which does not depend on their order or ranks. Collective."""
    hashes: npt.NDArray[np.uint64] = np.full(len(rows), GOLDEN)
    for column in rows.T:
        hashes = _mixed(hashes * GOLDEN ^ column.astype(np.uint64))
    total: int = comm.allreduce(int(hashes.sum(dtype=np.uint64)))
    return total % 2**64


def _mixed(words: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(words ^ (words >> np.uint64(31)))


def _bytes(rows: Block) -> int:
    return int(np.prod(rows.shape)) * rows.values.itemsize


def _lay_out(
    part: Path, blocks: Mapping[str, Block], describe: Callable[[h5py.File], None] | None
) -> dict[str, int]:
    """Create a file with space for its arrays, and return their positions in the file (bytes)."""
    early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    early.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    offsets = {}
    try:
        with h5py.File(part, "w", libver="v110", locking=False) as file:
            if describe is not None:
                describe(file)
            for name, rows in blocks.items():
                made = file.create_dataset(name, rows.shape, rows.values.dtype, dcpl=early.copy())
                offsets[name] = made.id.get_offset() or 0
    except (RuntimeError, ValueError) as error:
        raise OSError(str(error)) from error
    return offsets


def _reserve(path: Path, size: int) -> None:
    """Reserve disk space for a file of ``size`` bytes; create the file if it does not exist."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o666)
    try:
        if size:
            os.posix_fallocate(file, 0, size)
    finally:
        os.close(file)


def _write(file: int, values: npt.NDArray, offset: int) -> None:
    rest = memoryview(values.ravel().view(np.uint8))
    while len(rest):
        written = os.pwrite(file, rest, offset)
        rest, offset = rest[written:], offset + written


COUNTS = ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds")
BODY_TAGS, BODY_NAMES = f"{FIELD_DATA}/body_tags", f"{FIELD_DATA}/body_names"

LINKED = (
    *(f"{GRID}/{name}" for name in COUNTS),
    *(POINTS, CONNECTIVITY, OFFSETS, TYPES, BODY, BODY_TAGS, BODY_NAMES),
)
"""Datasets of the mesh file to which field files link."""


class FieldWriter:
    """Writes the mesh of a problem, and fields on this mesh."""

    def __init__(self, folder: ResultFolder, problem: Problem, mesh_file: Path) -> None:
        """Number the nodes and cells, and write the mesh. Collective.

        Args:
            folder: Result folder, which provides the ranks and the message for system errors.
            problem: The problem; its nodes are the points of the mesh file.
            mesh_file: The mesh file; its folder exists.

        Raises:
            InputError: If the file cannot be written.
        """
        self._folder, self._mesh_file = folder, mesh_file
        self._mesh = mesh = problem.tagged_mesh.mesh
        self._degree, self._space = problem.degree, problem.V
        if coordinate_map(mesh).degree > self._degree:
            self._degree = coordinate_map(mesh).degree
            self._space = fem.functionspace(mesh, ("P", self._degree))
        dofmap = self._space.dofmap
        self._cells = cell_ordering(mesh)
        self._nodes = node_ordering(mesh, dofmap.list, dofmap.index_map)
        self._interpolated: dict[str, fem.Function] = {}
        self._write_mesh(problem)

    def write(
        self,
        path: Path,
        fields: Mapping[str, fem.Function],
        facts: Mapping[str, float | int | str],
    ) -> None:
        """Write fields on the mesh. Collective.

        Args:
            path: The file, which is replaced if it exists.
            fields: Nodal or piecewise constant functions by name, with up-to-date ghost values.
                Vectors in the plane get a third component, which is 0.
            facts: Further scalar data by name, which become VTK's field data.

        Raises:
            InputError: If the file cannot be written; an existing file remains complete.
        """
        arrays = dict(self._array(name, function) for name, function in fields.items())
        mesh_file = os.path.relpath(self._mesh_file, path.parent)

        def describe(file: h5py.File) -> None:
            make_grid(file)
            for name in LINKED:
                file[name] = h5py.ExternalLink(mesh_file, f"/{name}")
            add_facts(file, facts)

        write_arrays(self._folder, path, arrays, describe=describe)

    def _write_mesh(self, problem: Problem) -> None:
        """Write the points, cells, tags and names of bodies, and named facets in rank order."""
        tagged_mesh, mesh, cells = problem.tagged_mesh, self._mesh, self._cells
        tdim, comm, dofmap = mesh.topology.dim, mesh.comm, self._space.dofmap
        owned = mesh.topology.index_map(tdim).size_local
        number = with_ghosts(dofmap.index_map, self._nodes.numbers())
        per_cell = dofmap.list.shape[1]
        to_vtk = np.argsort(cell_perm_vtk(mesh.topology.cell_type, per_cell))
        corners = block(cells, number[dofmap.list[:owned]][:, to_vtk])
        body = np.zeros(len(dofmap.list), dtype=np.int32)
        body[tagged_mesh.cell_tags.indices] = tagged_mesh.cell_tags.values
        last = comm.rank == comm.size - 1  # there is one offset more than there are cells
        offsets = per_cell * np.arange(cells.first, cells.first + cells.count + last)
        # VTK's type numbers of simplices by dimension and degree
        cell_types = {(2, 1): 5, (2, 2): 22, (3, 1): 10, (3, 2): 24}
        kind = np.full(cells.count, cell_types[tdim, self._degree], dtype=np.uint8)
        points = self._space.tabulate_dof_coordinates()[: dofmap.index_map.size_local]
        facets, tags = self._named_facets(problem, number)
        first, total = comm.exscan(len(facets)) or 0, comm.allreduce(len(facets))
        arrays = {
            POINTS: block(self._nodes, points.astype(np.float64)),
            CONNECTIVITY: Block(
                corners.values.ravel(), per_cell * cells.first, per_cell * cells.total
            ),
            OFFSETS: Block(offsets, cells.first, cells.total + 1),
            TYPES: Block(kind, cells.first, cells.total),
            BODY: block(cells, body[:owned]),
            SURFACES: Block(facets, first, total),
            SURFACE_TAGS: Block(tags, first, total),
        }
        counts = (self._nodes.total, cells.total, per_cell * cells.total)
        volumes = sorted(tagged_mesh.volumes, key=lambda name: tagged_mesh.volumes[name])

        def describe(file: h5py.File) -> None:
            make_grid(file)
            add_counts(file, counts)
            _add_row(file, BODY_TAGS, [tagged_mesh.volumes[a] for a in volumes])
            _add_row(file, BODY_NAMES, volumes)

        write_arrays(self._folder, self._mesh_file, arrays, describe=describe)

    def _named_facets(self, problem: Problem, number: Longs) -> tuple[Longs, Ints]:
        """Return the vertices of owned facets with names, shape (n, tdim), and the facets' tags."""
        mesh, tags = self._mesh, problem.tagged_mesh.facet_tags
        tdim, nodes = mesh.topology.dim, geometry_dofmap(mesh)
        at_node = np.zeros(len(mesh.geometry.x), dtype=np.int64)
        at_node[nodes[:, : tdim + 1]] = number[self._space.dofmap.list[:, : tdim + 1]]
        ours = tags.indices < mesh.topology.index_map(tdim - 1).size_local
        vertices = entity_nodes(mesh, tdim - 1, tags.indices[ours])[:, :tdim]
        return np.ascontiguousarray(at_node[vertices]), tags.values[ours].astype(np.int32)

    def _array(self, name: str, function: fem.Function) -> tuple[str, Block]:
        """Return a field's path in a file, and its values at points or in cells. Collective."""
        nodal = self._nodal(name, function)
        V, shape = nodal.function_space, nodal.ufl_shape
        values = nodal.x.array.reshape(-1, V.dofmap.index_map_bs)
        place, ordering = f"{CELL_DATA}/{name}", self._cells
        if V.element.basix_element.degree == 0:
            rows = values[V.dofmap.list[:, 0]]
            rows = rows[: self._mesh.topology.index_map(self._mesh.topology.dim).size_local]
        else:
            place, ordering = f"{POINT_DATA}/{name}", self._nodes
            index_map = self._space.dofmap.index_map
            rows = np.zeros((index_map.size_local + index_map.num_ghosts, values.shape[1]))
            rows[self._space.dofmap.list] = values[V.dofmap.list]
            rows = rows[: index_map.size_local]
        if shape == (2,):
            rows = np.column_stack([rows, np.zeros(len(rows))])
        return place, block(ordering, rows if shape else rows[:, 0])

    def _nodal(self, name: str, function: fem.Function) -> fem.Function:
        """Return a function, interpolated to the mesh points if its degree is not 0 or theirs.

        The degree of the points is that of the nodes in the mesh file.
        """
        if function.function_space.element.basix_element.degree in (0, self._degree):
            return function
        if name not in self._interpolated:
            element = basix.ufl.element(
                "P", self._mesh.basix_cell(), self._degree, shape=function.ufl_shape or None
            )
            space = fem.functionspace(self._mesh, element)
            self._interpolated[name] = fem.Function(space)
        self._interpolated[name].interpolate(function)
        return self._interpolated[name]


def make_grid(file: h5py.File) -> None:
    """Create the HDF5 group that VTK reads."""
    grid = file.create_group(GRID)
    # version of the format, and type of the data; VTK needs a string of fixed length
    version, type_name = (2, 0), b"UnstructuredGrid"
    grid.attrs["Version"] = version
    grid.attrs.create("Type", type_name, dtype=h5py.string_dtype("ascii", len(type_name)))


def add_counts(file: h5py.File, counts: tuple[int, int, int]) -> None:
    """Add the numbers of points, of cells, and of entries in the connectivity."""
    for name, count in zip(COUNTS, counts, strict=True):
        _add_row(file, f"{GRID}/{name}", [count])


def add_facts(file: h5py.File, facts: Mapping[str, float | int | str]) -> None:
    """Add scalar data by name as VTK's field data."""
    for name, fact in facts.items():
        _add_row(file, f"{FIELD_DATA}/{name}", [fact])


def _add_row(file: h5py.File, name: str, values: Sequence[float | int | str]) -> None:
    """Add a small array. Strings are in UTF-8, but marked as ASCII so that VTK reads them."""
    if isinstance(values[0], str):
        texts = np.array([str(value).encode() for value in values], dtype=object)
        file.create_dataset(name, data=texts, dtype=h5py.string_dtype("ascii"))
    else:
        file[name] = np.array(values)
