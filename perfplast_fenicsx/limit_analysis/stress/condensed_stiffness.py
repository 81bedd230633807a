"""Assemble and factorise K of the multipliers of equilibrium, without the cells' inner unknowns."""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import (
    NONE,
    SingularStiffness,
    SprungMatrix,
)
from perfplast_fenicsx.limit_analysis.discrete.friction_points import Springs
from perfplast_fenicsx.limit_analysis.stress.cell_condensation import CellCondensation
from perfplast_fenicsx.limit_analysis.stress.multiplier_strains import MultiplierStrains
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT

RIDGE = 1e-13
"""Share of the diagonal that is added. Rows of equilibrium may depend on each other where facets
meet at right angles or cross.
"""


class CondensedStiffness(SprungMatrix):
    """See :class:`discretisation.Stiffness`; y and b are vectors of :class:`MultiplierStrains`."""

    def __init__(self, strains: MultiplierStrains, held: Ints, jumps: Ints) -> None:
        """Compute the pattern. Collective.

        Args:
            strains: Strains of the multipliers.
            held: Owned facet unknowns that supports hold.
            jumps: Owned facet unknowns that are jumps of contact.
        """
        self._strains, self._held, self._out = strains, held, held
        facets, layout = strains.facets, strains.layout
        self._springs: Springs | None = None
        matrix = PETSc.Mat().create(facets.vector.comm)
        matrix.setType(PETSc.Mat.Type.AIJ)
        # K is positive semidefinite: the search of MUMPS for pivots would only take memory and
        # time.
        unpivoted = {**DIRECT, "mat_mumps_cntl_1": 0.0}
        super().__init__(facets.vector.comm, matrix, jumps, unpivoted)
        self._preallocate()
        comm = facets.vector.comm.tompi4py()
        shape = strains.num_cells, len(strains.rows), *strains.matrices.shape[-2:]
        given = strains.rows, strains.matrices.reshape(shape), layout.outer
        self._cells = CellCondensation(comm, *given)
        self._right, self._found = self._matrix.createVecs()

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        super().destroy()
        for vector in (self._right, self._found):
            vector.destroy()

    def _preallocate(self) -> None:
        """Preallocate the entries of cells, and those that jumps couple. Collective."""
        facets, block = self._strains.facets, self._strains.gdim
        numbers = facets.numbers[facets.of_cells].astype(PETSc.IntType)
        twins = facets.twins[facets.of_cells].astype(PETSc.IntType)
        self._blocks = np.ascontiguousarray(numbers[:, ::block] // block)
        self._coupled = np.flatnonzero((twins >= 0).any(axis=1))
        self._numbers, self._twins = numbers[self._coupled], twins[self._coupled]
        at = facets.followers
        kept = at.keep > 0
        self._leads = np.broadcast_to(at.leads, (len(at.cells), len(at.leads)))
        self._leads = np.ascontiguousarray(self._leads, dtype=PETSc.IntType)
        self._beside = [
            np.where(kept, of[at.cells], -1).astype(PETSc.IntType) for of in (numbers, twins)
        ]
        room = PETSc.Mat().create(self._matrix.comm)
        room.setType(PETSc.Mat.Type.PREALLOCATOR)
        for matrix in (room, self._matrix):
            matrix.setSizes(((facets.count, None), (facets.count, None)), bsize=block)
        room.setUp()
        self._fill(room, np.zeros((len(numbers), *2 * numbers.shape[1:])))
        room.preallocatorPreallocate(self._matrix)
        room.destroy()

    def _fill(self, matrix: PETSc.Mat, values: Floats) -> None:
        """Add matrices of cells, shape (num_cells, outer, outer). Collective."""
        add, at = PETSc.InsertMode.ADD, self._strains.facets.followers
        led = values[at.cells] @ at.shares
        values[at.cells] *= at.keep[:, :, None] * at.keep[:, None]
        matrix.setValuesBlockedRCV(self._blocks, self._blocks, values, addv=add)
        numbers, twins, there = self._numbers, self._twins, values[self._coupled]
        for rows, columns in ((numbers, twins), (twins, numbers), (twins, twins)):
            matrix.setValuesRCV(rows, columns, there, addv=add)
        if len(at.leads):
            shares, across = np.swapaxes(at.shares, 1, 2), np.ascontiguousarray(led.swapaxes(1, 2))
            for beside in self._beside:
                matrix.setValuesRCV(beside, self._leads, led, addv=add)
                matrix.setValuesRCV(self._leads, beside, across, addv=add)
            matrix.setValuesRCV(self._leads, self._leads, shares @ led, addv=add)
        matrix.assemble()

    def add_springs(self, springs: Springs) -> None:
        """Add springs to K at the facet unknowns of one vertex each, from the next assembly on."""
        self._springs = springs

    def _stiffen(self, index: Ints, stiffness: Floats) -> None:
        """Add the springs to the matrix. Collective."""
        first = self._matrix.getOwnershipRange()[0]
        numbers = np.where(index >= 0, index + first, -1).astype(PETSc.IntType)
        self._matrix.setValuesRCV(numbers, numbers, stiffness, addv=PETSc.InsertMode.ADD)
        self._matrix.assemble()

    def check_memory(self) -> None:
        """Refuse K if its factors do not fit into memory, whatever its values. Collective.

        Raises:
            TooLarge: With the memory that is needed and that is available.
        """
        outer = self._strains.layout.outer
        pattern = 1.0  # any value: only the pattern matters
        everywhere = np.full((self._strains.num_cells, outer, outer), pattern)
        self._matrix.zeroEntries()
        self._fill(self._matrix, everywhere)
        self.check_once()

    @phase("assembly")
    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at the points of this rank. Collective.

        Raises:
            SingularStiffness: If inner unknowns of a cell cannot be eliminated.
        """
        strains = self._strains
        roots = moduli.roots() * np.sqrt(strains.weights)[:, None, None]
        # rows that the eliminated ones already imply, in cells with few stresses
        ridge: Floats = RIDGE * strains.few.astype(np.float64)
        idle: Floats = strains.idle[:, strains.layout.outer :].astype(np.float64)
        values, done = self._cells.condense(roots, idle, ridge)
        if strains.facets.vector.comm.tompi4py().allreduce(not done):
            raise SingularStiffness("the equilibrium of a cell cannot be solved for its stress")
        self._matrix.zeroEntries()
        self._fill(self._matrix, values)
        if self._springs is not None:
            self._stiffen(*self._springs)
        diagonal = self._matrix.getDiagonal()
        diagonal.scale(1 + RIDGE)
        diagonal.array[self._held] = 1.0
        self._matrix.setDiagonal(diagonal)
        diagonal.destroy()
        self._out = np.union1d(self._held, held)
        if strains.facets.vector.comm.tompi4py().allreduce(len(held)):
            self._matrix.zeroRowsColumns(strains.facets.numbers[held].astype(PETSc.IntType))

    @phase("linear solve")
    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        strains, count = self._strains, self._strains.facets.count
        onto = self._cells.push_out(strains.inner(b.array_r))
        self._right.array[:] = b.array_r[:count] + strains.facets.add_up(onto)
        self._right.array[self._out] = 0.0
        super().solve(self._right, self._found)
        outer = strains.facets.gather(self._found.array_r)
        array = x.array
        array[:count] = self._found.array_r
        array[count:] = self._cells.bring_in(outer).ravel()
