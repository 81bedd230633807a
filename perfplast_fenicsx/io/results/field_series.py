"""Write the fields of all levels as VTKHDF files, and the list of levels for ParaView.

Each file gets its final name when it is complete; then the list is replaced as a whole. So a crash
does not damage existing levels, and a restart adds further levels.

ParaView opens ``fields.vtkhdf.series``; in PyVista one line shows a level::

    pyvista.HDFReader("results/fields/level_0001.vtkhdf").read().plot(scalars="yield_ratio")

Fields at the quadrature points are written as VTKHDF files of single points. The stress at these
points is the solver's stress, not a cell mean. The points are in the order of the cells in the
input, and within a cell in the order of the quadrature rule, whatever the number of ranks.
"""

import json
import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.io.results.result_files import (
    BODY,
    CONNECTIVITY,
    FIELDS,
    MECHANISM,
    MECHANISM_POINTS,
    MESH,
    OFFSETS,
    POINT_DATA,
    POINT_SERIES,
    POINTS,
    SERIES,
    TYPES,
    level_file,
    point_file,
)
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import (
    FieldWriter,
    add_counts,
    add_facts,
    make_grid,
    write_arrays,
)
from perfplast_fenicsx.mesh.global_ordering import Block, cell_ordering
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.seepage.flow import SteadyFlow

log = logging.getLogger(__name__)


def write_flow(flow: SteadyFlow, path: Path) -> None:
    """Write the fields of a seepage flow at the vertices of its cells. Not collective.

    Args:
        flow: The seepage flow.
        path: The file, which is replaced if it exists.

    Raises:
        OSError: If the file cannot be written.
    """
    dim = flow.points.shape[1]
    cells, corners = flow.cells.shape
    core = h5py.File(os.fspath(path), "w", driver="core", backing_store=False)
    with core as file:
        make_grid(file)
        add_counts(file, (len(flow.points), cells, cells * corners))
        file[POINTS] = np.pad(flow.points, ((0, 0), (0, 3 - dim)))
        file[CONNECTIVITY] = flow.cells.ravel()
        file[OFFSETS] = corners * np.arange(cells + 1)
        vtk_type = {2: 5, 3: 10}[dim]
        file[TYPES] = np.full(cells, vtk_type, dtype=np.uint8)
        fields: dict[str, Floats] = {
            "pressure": flow.pressures,
            "head": flow.heads,
            "saturation": flow.saturation,
            "outflow": flow.outflow,
        }
        for name, values in fields.items():
            file[f"{POINT_DATA}/{name}"] = values
        add_facts(file, {"upwards": "xyz"[flow.axis]})
        file.flush()
        content = file.id.get_file_image()
    replace(path, content)


class PointWriter:
    """Writes fields at the quadrature points, where the laws are evaluated."""

    def __init__(self, folder: ResultFolder, problem: Problem) -> None:
        """Compute the points and their volumes. Collective.

        Args:
            folder: Result folder, which provides the ranks and the message for system errors.
            problem: The problem whose quadrature points are used.
        """
        mesh = problem.tagged_mesh.mesh
        self._folder, self._cells = folder, cell_ordering(mesh)
        self._owned = mesh.topology.index_map(mesh.topology.dim).size_local
        tags = problem.tagged_mesh.cell_tags
        x = fem.Expression(ufl.SpatialCoordinate(mesh), interpolation_points(problem.Q.element))
        points = np.asarray(x.eval(mesh, problem.cells))
        self._count = problem.Q.dofmap.list.shape[1]
        points = points.reshape(len(problem.cells), self._count, mesh.geometry.dim)
        in_space = np.zeros((*points.shape[:2], 3))
        in_space[..., : mesh.geometry.dim] = points
        weight = fem.Function(problem.Q)
        volumes = fem.assemble_vector(fem.form(ufl.TestFunction(problem.Q) * problem.dx))
        weight.x.array[:] = volumes.array
        body = np.zeros(len(problem.cells), dtype=np.int32)
        body[tags.indices] = tags.values
        self._fixed: dict[str, npt.NDArray[Any]] = {
            POINTS: in_space,
            f"{POINT_DATA}/volume": by_cell(weight),
            BODY: np.repeat(body[:, None], self._count, axis=1),
        }

    def write(
        self, path: Path, fields: Mapping[str, Floats], facts: Mapping[str, float | int | str]
    ) -> None:
        """Write fields at the points. Collective.

        Args:
            path: The file, which is replaced if it exists.
            fields: Values by name, shape (num_cells, points per cell, ...), including ghost cells.
            facts: Further scalar data by name.

        Raises:
            InputError: If the file cannot be written; an existing file remains complete.
        """
        cells, count = self._cells, self._count
        arrays = {f"{POINT_DATA}/{name}": array for name, array in fields.items()} | self._fixed
        first, total = count * cells.first, count * cells.total
        blocks: dict[str, Block] = {}
        for name, array in arrays.items():
            rows = cells.to_blocks(np.ascontiguousarray(array[: self._owned]))
            # VTK stores a tensor as a row of numbers
            width = rows.shape[2:] and (int(np.prod(rows.shape[2:])),)
            blocks[name] = Block(rows.reshape(-1, *width), first, total)
        number = np.arange(first, first + count * cells.count)
        last = self._folder.comm.rank == self._folder.comm.size - 1
        blocks[CONNECTIVITY] = Block(number, first, total)
        blocks[OFFSETS] = Block(np.arange(first, first + len(number) + last), first, total + 1)
        vertex = 1  # VTK's type number of a vertex cell
        blocks[TYPES] = Block(np.full(len(number), vertex, dtype=np.uint8), first, total)

        def describe(file: h5py.File) -> None:
            make_grid(file)
            add_counts(file, (total, total, total))
            add_facts(file, facts)

        write_arrays(self._folder, path, blocks, describe=describe)


class FieldSeries:
    """Writes the fields of load levels; the time of a level is its prescribed quantity, ζ or α."""

    def __init__(
        self,
        folder: ResultFolder,
        problem: Problem,
        prescribed: Prescribed,
        kept: Sequence[LevelReport] = (),
        points: bool = False,
    ) -> None:
        """Write the mesh, and list the levels of an earlier run. Collective.

        Args:
            folder: Folder of the files.
            problem: The problem of the levels.
            prescribed: The prescribed quantity of a level.
            kept: Reports of the levels that an earlier run has written, starting with level 1;
                files of other levels are removed.
            points: Whether to write fields at the quadrature points too.

        Raises:
            InputError: If the files cannot be written.
        """
        self._folder, self._prescribed = folder, prescribed
        there = folder.comm.bcast(
            [number for number in range(1, len(kept) + 1) if self._has(number)]
        )
        self._times = {number: prescribed.of(kept[number - 1]) for number in there}
        if len(there) < len(kept) and folder.comm.rank == 0:
            log.warning(
                "fields of %d of the %d solved levels are missing from '%s': the time series and "
                "the pictures omit these levels; to write their fields, run the case again with "
                "--force",
                *(len(kept) - len(there), len(kept), folder.file(FIELDS)),
            )
        folder.on_root(lambda: folder.file(FIELDS).mkdir(exist_ok=True))
        self._writer = FieldWriter(folder, problem, folder.file(MESH))
        self._points = PointWriter(folder, problem) if points else None
        self._list_levels()
        folder.on_root(self._remove_others)

    def __repr__(self) -> str:
        return f"FieldSeries({str(self._folder.file(SERIES))!r}: {len(self._times)} levels)"

    def write(
        self,
        number: int,
        fields: Mapping[str, fem.Function],
        report: LevelReport,
        at_points: Mapping[str, Floats] | None = None,
    ) -> None:
        """Write the fields of a solved level, and add the level to the list. Collective.

        Args:
            number: Number of the level, from 1; larger than the numbers of previous levels.
            fields: Nodal or piecewise constant functions by name (:meth:`FieldWriter.write`).
            report: The level.
            at_points: Fields at the quadrature points by name; None if there are no such fields.

        Raises:
            InputError: If the files cannot be written; existing files remain complete.
        """
        facts: dict[str, float | int | str] = {"level": number}
        facts["prescribed"] = self._prescribed.value
        facts |= {"zeta": report.zeta, "alpha": report.alpha}
        self._writer.write(self._folder.file(level_file(number)), fields, facts)
        if self._points is not None and at_points is not None:
            self._points.write(self._folder.file(point_file(number)), at_points, facts)
        self._times[number] = self._prescribed.of(report)
        self._list_levels()

    def write_mechanism(
        self,
        fields: Mapping[str, fem.Function],
        zeta: float,
        alpha: float,
        at_points: Mapping[str, Floats] | None = None,
    ) -> None:
        """Write ``mechanism.vtkhdf``. Collective.

        Args:
            fields: A velocity field on which the loads do unit work, its plastic work, and further
                fields, by name.
            zeta: The load factor of the mechanism.
            alpha: The work α at the end of the path.
            at_points: Fields at the quadrature points by name; None if there are no such fields.

        Raises:
            InputError: If the file cannot be written.
        """
        facts = {"zeta": zeta, "alpha": alpha}
        self._writer.write(self._folder.file(MECHANISM), fields, facts)
        if self._points is not None and at_points:
            self._points.write(self._folder.file(MECHANISM_POINTS), at_points, facts)

    def _has(self, number: int) -> bool:
        return self._folder.file(level_file(number)).is_file()

    def _list_levels(self) -> None:
        """Replace the series files, which list the levels (``*.vtkhdf.series``). Collective."""

        def write() -> None:
            self._list(SERIES, {level_file(number): time for number, time in self._times.items()})
            if self._points is not None:
                by_file = {point_file(number): time for number, time in self._times.items()}
                on_file = {n: t for n, t in by_file.items() if self._folder.file(n).is_file()}
                self._list(POINT_SERIES, on_file)

        self._folder.on_root(write)

    def _list(self, series: str, times: Mapping[str, float]) -> None:
        files = [{"name": name, "time": time} for name, time in times.items()]
        text = json.dumps({"file-series-version": "1.0", "files": files}, indent=1)
        replace(self._folder.file(series), f"{text}\n".encode())

    def _remove_others(self) -> None:
        """Remove the files of levels that are not in the list."""
        ours = {self._folder.file(of(n)) for n in self._times for of in (level_file, point_file)}
        for kind in ("level", "points"):
            for path in self._folder.file(FIELDS).glob(f"{kind}_*.vtkhdf"):
                if path not in ours:
                    path.unlink()
