"""Write fields at the quadrature points, as VTKHDF files of single points.

At these points the stress is that of the solver, not a cell mean. Points are in the order of the
input's cells, and within a cell in that of the quadrature rule, whatever the number of ranks.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.io.results.parallel_hdf5 import write_arrays
from perfplast_fenicsx.io.results.result_files import (
    BODY,
    CONNECTIVITY,
    OFFSETS,
    POINT_DATA,
    POINTS,
    TYPES,
)
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import add_counts, add_facts, make_grid
from perfplast_fenicsx.mesh.global_ordering import Block, cell_ordering
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.problem import Problem


class PointWriter:
    """Writes fields at the points where the laws of a problem are evaluated."""

    def __init__(self, folder: ResultFolder, problem: Problem) -> None:
        """Compute the points and their volumes. Collective.

        Args:
            folder: Result folder, which provides the ranks and the message for system errors.
            problem: Problem with the points.
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
        """Write fields. Collective.

        Args:
            path: The file, which is replaced if it exists.
            fields: Values by name, shape (num_cells, points of a cell, ...), including ghosts.
            facts: Further facts by name.

        Raises:
            InputError: If the file cannot be written; an existing file remains complete.
        """
        cells, count = self._cells, self._count
        arrays = {f"{POINT_DATA}/{name}": array for name, array in fields.items()} | self._fixed
        first, total = count * cells.first, count * cells.total
        blocks: dict[str, Block] = {}
        for name, array in arrays.items():
            rows = cells.to_blocks(np.ascontiguousarray(array[: self._owned]))
            width = rows.shape[2:] and (int(np.prod(rows.shape[2:])),)  # VTK stores tensors as rows
            blocks[name] = Block(rows.reshape(-1, *width), first, total)
        number = np.arange(first, first + count * cells.count)
        last = self._folder.comm.rank == self._folder.comm.size - 1
        blocks[CONNECTIVITY] = Block(number, first, total)
        blocks[OFFSETS] = Block(np.arange(first, first + len(number) + last), first, total + 1)
        vertex = 1  # VTK's number for a cell that is a point
        blocks[TYPES] = Block(np.full(len(number), vertex, dtype=np.uint8), first, total)

        def describe(file: h5py.File) -> None:
            make_grid(file)
            add_counts(file, (total, total, total))
            add_facts(file, facts)

        write_arrays(self._folder, path, blocks, describe=describe)
