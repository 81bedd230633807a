"""Write a limit load problem as the matrices, vectors and cones of a conic program, for any solver.

    max c·x  with  A x = b  and  right + factors · x in cones.

The unknowns are x = (σ, r, λ, μ, t). The stress σ of each point is in the coordinates of its cone.
Contact pairs have the forces r. The loads L have the load factor λ, and the free loads F have the
factor μ. Each unknown in t belongs to one block. The rows of A are the equations of equilibrium,
Eᵀw σ + r − λL − μF = L₀, where the matrix E maps velocities to strain rates. The multipliers of
these rows are a velocity v with L(v) = 1. The multipliers of the cones are the kinematic members
(:mod:`cone`).

:class:`~conic_program.ConicProgram` is the same program in the same units, with operators instead
of a matrix.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.cone import (
    Borne,
    Columns,
    ConeRows,
    MatrixBlock,
    Members,
)
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import Unknowns


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """The program max c·x with A x = b and the members of its cones, on one rank.

    Attributes:
        A: Matrix of the equations of equilibrium, shape (num_velocities, num_unknowns).
        b: Constant loads L₀, shape (num_velocities,).
        c: 1 for λ and 0 for all other unknowns, shape (num_unknowns,).
        cones: Rows of the cones, one entry for each block of the program.
        columns: The columns of the unknowns of each block.
        blocks: The blocks.
        factors: The column of λ and, if there are free loads, the column of μ.
        deviators: Function that removes the volumetric part from s
            (:meth:`~discretisation.Strains.deviators`).
    """

    A: sparse.csr_array
    b: Floats
    c: Floats
    cones: tuple[ConeRows, ...]
    columns: tuple[Columns, ...]
    blocks: tuple[MatrixBlock, ...]
    factors: Longs
    deviators: Callable[[Floats], Floats]

    @classmethod
    def of(cls, program: ConicProgram) -> "ConeProgram":
        """Return the data of a program in its present units.

        Raises:
            InputError: If the cones of a block cannot be written as rows of a matrix.
            ValueError: If there are several ranks.
        """
        if program.comm.size > 1:
            raise ValueError("matrices of a conic program are made on one rank")
        strains, parts = program.strains, 1 + program.strains.size
        points = np.arange(strains.count * parts).reshape(-1, parts)
        forces = points.size + np.arange(len(program.jumps))
        factors = points.size + len(forces) + np.arange(len(program.loads))
        width = int(factors[-1]) + 1
        blocks: list[MatrixBlock] = []
        columns: list[Columns] = []
        start = program.nothing_borne()
        for block in program.blocks:
            own = width + np.arange(len(block.start(start).own))
            width += len(own)
            if not isinstance(block, MatrixBlock):
                raise InputError(
                    f"the cones of {type(block).__name__} cannot be written as rows of a matrix, "
                    "as this solver requires; remove conic, or give the class the methods rows "
                    "and from_rows."
                )
            blocks.append(block)
            columns.append(Columns(points[:, 0], points[:, 1:], forces, own))
        weights = sparse.diags_array(np.repeat(program.weights, parts))
        of_stress = strains.matrix().T @ weights
        size = of_stress.shape[0]
        places = program.jumps, np.arange(len(forces))
        of_forces = sparse.csr_array((np.ones(len(forces)), places), shape=(size, len(forces)))
        of_loads = sparse.csr_array(-np.column_stack([it.array_r for it in program.loads]))
        of_own = sparse.csr_array((size, width - int(factors[-1]) - 1))
        A = sparse.csr_array(sparse.hstack([of_stress, of_forces, of_loads, of_own]))
        c = np.zeros(width)
        c[factors[0]] = 1.0
        rows = tuple(block.rows(at) for block, at in zip(blocks, columns, strict=True))
        dead = program.dead.array_r.copy()
        return cls(A, dead, c, rows, tuple(columns), tuple(blocks), factors, strains.deviators)

    def members(self, number: int) -> tuple[sparse.csr_array, Floats]:
        """Return the matrix and the constant part of the members of a block.

        Args:
            number: Number of the block.

        Returns:
            Shapes (num · size, num_unknowns) and (num · size,).
        """
        cones = self.cones[number]
        num, size = cones.right.shape
        rows = np.arange(num * size).reshape(num, size, 1)
        places = np.broadcast_arrays(rows, cones.columns[:, None])
        entries = (cones.factors.ravel(), tuple(it.ravel() for it in places))
        shape = num * size, self.A.shape[1]
        return sparse.csr_array(entries, shape=shape), cones.right.ravel()

    def unknowns(self, x: Floats, static: list[Floats], kinematic: list[Floats]) -> Unknowns:
        """Return a solution in the form of the interior point iteration.

        Args:
            x: The unknowns.
            static: Members of each block, shape (num · size,) each.
            kinematic: Multipliers of these members, of the same shapes.
        """
        stress = x[np.column_stack([self.columns[0].pressure, self.columns[0].deviator])]
        forces = x[self.columns[0].forces]
        deviator = np.asfortranarray(self.deviators(stress[:, 1:]))
        borne = Borne(stress[:, 0].copy(), deviator, forces)
        found: list[Members] = []
        for number, block in enumerate(self.blocks):
            shape = self.cones[number].right.shape
            both = static[number].reshape(shape), kinematic[number].reshape(shape)
            found.append(block.from_rows(*both, x[self.columns[number].own]))
        factors = x[self.factors]
        return Unknowns(float(factors[0]), float(factors[1:].sum()), borne, tuple(found))
