"""The discrete form of a limit load problem: strain rates at points, and a stiffness of moduli.

:class:`SprungMatrix` is the common part of both kinds of stiffness: springs at the jumps of
contact, and factors.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli, PointSets
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.factorisation import SupernodalFactors, check_memory
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import LIMIT, own_prefix

NONE = np.zeros(0, dtype=np.int32)


class SingularStiffness(RuntimeError):
    """A factorisation that has failed, on every rank alike."""


class Strains(Protocol):
    """ε(v) at the points of this rank, and its transpose.

    Stresses are (p, s) in the coordinates of each point's cone, ‖s + γt‖ ≤ γ − αp, and strain rates
    are those that do their work (:mod:`standard_cones`). About the hydrostatic axis p is the mean
    stress and s the deviator, so that rates are trace and deviator, and go by these names.

    Attributes:
        count: Points of this rank.
        size: Components m of a deviator; its norm is that of the tensor.
        gdim: Dimension in which the trace is taken, and pressure acts.
        weights: Volume that a point stands for, shape (count,).
        radii: Yield radius γ (stress) without mean stress, ∞ in elastic bodies, shape (count,).
        slopes: α, by which it falls with the mean stress, shape (count,).
        tilts: t, shape (count, m); None where all are zero.
        sets: Of the points that have other sets instead, by their kinds; γ and α are there those of
            the narrowest cone of the same apex around a set.
    """

    count: int
    size: int
    gdim: int
    weights: Floats
    radii: Floats
    slopes: Floats
    tilts: Floats | None
    sets: tuple[PointSets, ...]

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of ε(v), shapes (count,) and (count, m). Collective."""
        ...

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) for all v. Collective."""
        ...

    def matrix(self) -> sparse.csr_array:
        """Return what :meth:`of` multiplies with, on one rank alone.

        Returns:
            The trace of each point, then its deviator, shape (count · (1 + m), num_unknowns).
        """
        ...

    def deviators(self, deviator: Floats) -> Floats:
        """Return s without what is in it of p, where m components are one too many for s."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


class Stiffness(Protocol):
    """K with :class:`~cone.Moduli` at the points and c s² for the jump s of each contact pair."""

    @property
    def factorisations(self) -> int:
        """So far."""
        ...

    @property
    def solves(self) -> int:
        """Systems solved so far."""
        ...

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Bring K to moduli at the points, with unknowns that stay zero. Collective."""
        ...

    def jump_diagonal(self) -> Floats:
        """Diagonal entries of the jumps of this rank's pairs. Collective."""
        ...

    def add_at_jumps(self, springs: Floats) -> None:
        """Add c to the diagonal, shape (num_pairs,) on each rank. Collective."""
        ...

    def factorise(self) -> None:
        """Factorise. Collective.

        Raises:
            SingularStiffness: If that fails.
        """
        ...

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The discrete form of a limit load problem.

    Attributes:
        comm: The ranks.
        strains: Strains of velocities.
        stiffness: Assembled for the same velocities.
        load: L, the loads whose factor λ is sought, as a vector, in the user's units.
        dead: L₀, loads that stay as they are, in the same.
        free: Loads of any factor.
        jumps: Local (owned) entries of velocities that are jumps [v] of contact pairs.
        proves_stress: Whether it is the stress that is to be proven: without cohesion some of the
            slope α is then kept for what rounding leaves, too.
    """

    comm: MPI.Intracomm
    strains: Strains
    stiffness: Stiffness
    load: PETSc.Vec
    dead: PETSc.Vec
    free: PETSc.Vec
    jumps: Ints
    proves_stress: bool = False


class SprungMatrix:
    """The common part of both kinds of :class:`Stiffness`, for an assembled matrix.

    Attributes:
        factorisations: So far.
        solves: Systems solved so far.
    """

    def __init__(
        self, comm: PETSc.Comm, matrix: PETSc.Mat, jumps: Ints, options: Mapping[str, object]
    ) -> None:
        """Take a matrix over that is still to be assembled. Collective.

        Args:
            comm: The ranks.
            matrix: Assembled again by the owner of this.
            jumps: Owned unknowns that are jumps.
            options: PETSc's, of the factorisation.
        """
        self._matrix, self._jumps = matrix, jumps
        self.factorisations = self.solves = 0
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(own_prefix(self, LIMIT, options))
        self._ksp.setFromOptions()
        self._supernodal, self._checked = SupernodalFactors(), False
        self._used = self._ksp

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for thing in (self._supernodal, self._ksp, self._matrix):
            thing.destroy()

    @property
    def uses(self) -> str:
        """PETSc's name of what has made the last factors."""
        return str(self._used.getPC().getFactorSolverType())

    def jump_diagonal(self) -> Floats:
        """Diagonal entries of the jumps of this rank's pairs. Collective."""
        diagonal = self._matrix.getDiagonal()
        values: Floats = diagonal.array_r[self._jumps].copy()
        diagonal.destroy()
        return values

    def add_at_jumps(self, springs: Floats) -> None:
        """Add c to the diagonal, shape (num_pairs,) on each rank. Collective."""
        diagonal = self._matrix.getDiagonal()
        diagonal.array[self._jumps] += springs
        self._matrix.setDiagonal(diagonal)
        diagonal.destroy()

    def check_once(self) -> None:
        """Refuse the matrix if its factors do not fit into memory, once. Collective.

        Raises:
            TooLarge: With what is needed and what there is.
        """
        if not self._checked:
            self._ksp.setOperators(self._matrix)
            self._checked, analysis = True, check_memory(self._ksp)
            self._supernodal.take_over(self._ksp, analysis, LIMIT)

    @phase("linear set-up")
    def factorise(self) -> None:
        """Factorise the matrix as it is. Collective.

        Raises:
            SingularStiffness: If that fails.
            InputError: If it takes more memory than there is, before the first one.
        """
        self.check_once()
        self.factorisations += 1
        self._used = self._supernodal.factorise(self._matrix) or self._ksp
        if self._used is not self._ksp:
            return
        self._ksp.setOperators(self._matrix)
        self._ksp.setUp()
        if self._ksp.getPC().getFailedReason():
            forget_factors(self._ksp)
            raise SingularStiffness("the stiffness could not be factorised")

    @phase("linear solve")
    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        self._used.solve(b, x)
        self.solves += 1
