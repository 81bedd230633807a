"""Define the discrete form of a limit load problem: strain rates at points, and a stiffness.

:class:`SprungMatrix` is the common part of both kinds of stiffness: contact springs and the
factorisation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import ConesAtPoints
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.factorisation import SupernodalFactors, check_memory
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import LIMIT, own_prefix

NONE = np.zeros(0, dtype=np.int32)


class SingularStiffness(RuntimeError):
    """Raised on every rank if a factorisation has failed."""


class Strains(ConesAtPoints, Protocol):
    """The operator from velocities to strain rates at the points of this rank, and its transpose.

    Stresses (p, s) are in the coordinates of each point's cone, ‖s + γt‖ ≤ γ − αp. Strain rates are
    conjugate to these stresses (:mod:`standard_cones`). For a cone about the hydrostatic axis, p is
    the mean stress and s the deviator. The two parts of a strain rate are therefore called trace
    and deviator.

    Attributes:
        count: Number of points of this rank.
        size: Number m of components of a deviator; their Euclidean norm is the norm of the tensor.
        gdim: Number of normal components in the trace; p is the mean of the normal stresses.
        weights: Volume of each point, shape (count,).
    """

    count: int
    size: int
    gdim: int
    weights: Floats

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Return the trace and the deviator of ε(v), shapes (count,) and (count, m). Collective."""
        ...

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) for all v. Collective."""
        ...

    def matrix(self) -> sparse.csr_array:
        """Return the matrix of :meth:`of`; only for a single rank.

        Returns:
            Rows for the trace and then for the deviator of each point, shape (count · (1 + m),
            num_unknowns).
        """
        ...

    def deviators(self, deviator: Floats) -> Floats:
        """Return s without its volumetric part, which is zero unless s has redundant components."""
        ...

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        ...


@dataclass
class Counts:
    """Numbers of operations with a stiffness so far.

    Attributes:
        factorisations: Number of factorisations.
        solves: Number of systems solved.
    """

    factorisations: int = 0
    solves: int = 0


class Stiffness(Protocol):
    """Stiffness K from :class:`~cone.Moduli` at points and from springs c [v]² at contact pairs.

    Attributes:
        counts: Numbers of operations so far.
    """

    counts: Counts

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K from moduli at points; the unknowns ``held`` stay zero. Collective."""
        ...

    def jump_diagonal(self) -> Floats:
        """Return K's diagonal entries at the jumps of this rank's contact pairs. Collective."""
        ...

    def add_at_jumps(self, springs: Floats) -> None:
        """Add ``springs`` c, shape (num_pairs,), to K's diagonal entries at jumps. Collective."""
        ...

    def factorise(self) -> None:
        """Factorise K. Collective.

        Raises:
            SingularStiffness: If the factorisation fails.
        """
        ...

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        ...

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        ...


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The discrete form of a limit load problem.

    Attributes:
        comm: The ranks.
        strains: Strain rates of velocities.
        stiffness: Stiffness of the same velocities.
        load: Vector of L, the loads with the unknown factor λ, in the user's units.
        dead: Vector of L₀, the constant loads, in the user's units.
        free: Vector of the loads with a free factor.
        jumps: Indices of the owned entries of velocities that are jumps [v] of contact pairs.
        proves_stress: Whether the stress has to prove a bound. In this case, without cohesion, the
            program also keeps a share of the slope α in reserve for rounding.
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
        counts: Numbers of operations so far.
    """

    def __init__(
        self, comm: PETSc.Comm, matrix: PETSc.Mat, jumps: Ints, options: Mapping[str, object]
    ) -> None:
        """Take ownership of a matrix that the caller assembles later. Collective.

        Args:
            comm: The ranks.
            matrix: The matrix, which the caller assembles again for each K.
            jumps: Indices of owned unknowns that are jumps of contact pairs.
            options: PETSc options of the factorisation.
        """
        self._matrix, self._jumps = matrix, jumps
        self.counts = Counts()
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(own_prefix(self, LIMIT, options))
        self._ksp.setFromOptions()
        self._supernodal, self._checked = SupernodalFactors(), False
        self._used = self._ksp

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        for thing in (self._supernodal, self._ksp, self._matrix):
            thing.destroy()

    @property
    def uses(self) -> str:
        """Return PETSc's name of the solver of the last factorisation."""
        return str(self._used.getPC().getFactorSolverType())

    def jump_diagonal(self) -> Floats:
        """Return K's diagonal entries at the jumps of this rank's contact pairs. Collective."""
        diagonal = self._matrix.getDiagonal()
        values: Floats = diagonal.array_r[self._jumps].copy()
        diagonal.destroy()
        return values

    def add_at_jumps(self, springs: Floats) -> None:
        """Add ``springs`` c, shape (num_pairs,), to K's diagonal entries at jumps. Collective."""
        diagonal = self._matrix.getDiagonal()
        diagonal.array[self._jumps] += springs
        self._matrix.setDiagonal(diagonal)
        diagonal.destroy()

    def check_once(self) -> None:
        """Check on the first call that the factors of the matrix fit into memory.

        The first call also prepares the supernodal factors. Collective.

        Raises:
            TooLarge: If they do not fit; the message gives the needed and the available memory.
        """
        if not self._checked:
            self._ksp.setOperators(self._matrix)
            self._checked, analysis = True, check_memory(self._ksp)
            self._supernodal.take_over(self._ksp, analysis, LIMIT)

    @phase("linear set-up")
    def factorise(self) -> None:
        """Factorise the matrix in its present state. Collective.

        Raises:
            SingularStiffness: If the factorisation fails.
            InputError: If the first factorisation needs more memory than is available.
        """
        self.check_once()
        self.counts.factorisations += 1
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
        self.counts.solves += 1
