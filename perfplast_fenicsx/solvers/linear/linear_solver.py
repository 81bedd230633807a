"""Choose how to solve the linear systems of a step, and when to renew set-ups.

The methods (:class:`Factorisation`, :class:`Multigrid`, :class:`Krylov`) implement the solves. This
module decides when a set-up is too old, and which method replaces a method that fails.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT, Factorisation, Price
from perfplast_fenicsx.solvers.linear.krylov import Krylov
from perfplast_fenicsx.solvers.linear.multigrid import MULTIGRID, Multigrid
from perfplast_fenicsx.solvers.linear.outcome import Outcome
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, solver_name

log = logging.getLogger(__name__)


@dataclass
class SetUp:
    """The state of the current set-up (a factorisation or a preconditioner).

    Attributes:
        usual: Krylov iterations per decimal digit in a full solve with the last new set-up; 0 if
            there is none.
        due: Whether nothing has been solved with the set-up yet.
        kept: Whether the set-up belongs to an earlier matrix.
        rate: Krylov iterations per decimal digit in the first full solve with the set-up, or
            ``usual`` if the set-up was no longer new; 0 before the first full solve.
        excess: Additional Krylov iterations, beyond this rate, since the first full solve.
    """

    usual: float = 0.0
    due: bool = True
    kept: bool = False
    rate: float = 0.0
    excess: float = 0.0

    def note(self, iterations: int, rtol: float) -> None:
        """Record the iterations of a full solve."""
        if not self.kept:
            self.usual = iterations_a_digit(iterations, rtol)
        self.rate = self.rate or self.usual or iterations_a_digit(iterations, rtol)
        self.excess += iterations + self.rate * float(np.log10(rtol))

    def note_correction(self, iterations: int, rtol: float) -> None:
        """Record the solve for a part of a solution, if full solves have defined the rate."""
        usual = self.rate or self.usual
        if usual:
            self.excess += iterations + usual * float(np.log10(rtol))


def iterations_a_digit(iterations: int, rtol: float) -> float:
    """Return the number of Krylov iterations per decimal digit of the tolerance."""
    return iterations / -float(np.log10(rtol))


DIRECT_LIMIT = {2: 300_000, 3: 40_000}
"""Number of unknowns, by dimension, up to which a Cholesky factorisation is faster than
multigrid."""

FEW_ITERATIONS = 50
"""Multigrid solves with at most this number of Krylov iterations are not compared with a
factorisation."""


WORTH_A_MOTION = 6.0
"""Krylov iterations per decimal digit above which coarse spaces include the last solution as a
motion; elastic bodies need two."""


class LinearFailure(RuntimeError):
    """Raised if a linear system could not be solved; the reason is the same on every rank."""


class Method(Protocol):
    """The interface of a method that solves A x = b.

    Attributes:
        name: Name of the solver in messages.
    """

    name: str

    @property
    def worth(self) -> int:
        """Return the number of Krylov iterations that cost as much as a set-up."""

    def prepare(self, operator: ContactOperator) -> bool:
        """Prepare the data of a new operator, and return whether this method suits it."""

    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Set the matrix of an operator in which ``held`` is eliminated. Collective."""

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Renew the set-up from the current matrix, at the latest in the next solve. Collective.

        Args:
            flow: A motion of the bodies for which solves converge slowly; None if there is none.
        """

    def keep(self) -> None:
        """Use the current set-up in the next solves, although the matrix has changed."""

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, to ``rtol`` relative to b. Collective."""

    def destroy(self) -> None:
        """Release memory immediately. Collective."""


class LinearSolver:
    """Solve A y = b in the jump basis, with any set of unknowns held at zero.

    Large problems use CG with smoothed aggregation, and small ones use Cholesky factorisation by
    MUMPS; the user can give any PETSc option with the prefix ``perfplast_``. While the operator and
    the held unknowns change, the coarse grids are reused with an updated finest grid, until the
    additional iterations cost more than a set-up. If bodies flow plastically and solves take many
    iterations, the coarse grids also contain the last solution.

    Attributes:
        iterations: Number of Krylov iterations so far.
        solves: Number of solved systems so far.
        setups: Number of factorisations or multigrid set-ups so far.
    """

    def __init__(self, problem: Problem) -> None:
        """Choose a method by the size of the problem and the options of the user. Collective."""
        self.iterations = self.solves = self.setups = 0
        self._problem = problem
        self._method = _method(problem)
        self._operator: ContactOperator | None = None
        self._held: Ints = np.zeros(0, dtype=np.int32)
        self._ready = False
        self._setup = SetUp()
        self._rate = self._norm = 0.0
        self._factorised: Ints = self._held
        self._other = True
        self._flow: PETSc.Vec | None = None

    @property
    def name(self) -> str:
        """Return the name of the current method."""
        return self._method.name

    @property
    def direct(self) -> bool:
        """Return whether the current method is a factorisation."""
        return isinstance(self._method, Factorisation)

    def counts(self) -> tuple[int, int, int]:
        """Return the numbers of solved systems, set-ups and Krylov iterations so far."""
        return self.solves, self.setups, self.iterations

    def set_operator(self, operator: ContactOperator) -> None:
        """Set a new operator, or the same operator with new values; :meth:`hold` must follow.

        Collective.
        """
        self._operator, self._ready = operator, False
        norm = operator.stiffness.norm(PETSc.NormType.FROBENIUS) if self.direct else 0.0
        # Stiffness matrices count as equal up to this relative difference of their norms.
        rounding = 1e-9
        self._other = not abs(norm - self._norm) <= rounding * norm
        self._norm = norm
        if not self._method.prepare(operator):
            self._replace(Factorisation(self._problem.comm, heed=False))

    def hold(self, held: Ints) -> bool:
        """Hold the unknowns with these local owned indices at zero. Collective.

        Returns:
            Whether a new matrix was formed, because the operator or the held unknowns changed.
        """
        changed = not np.array_equal(held, self._held)
        if self._ready and not self._problem.comm.allreduce(changed):
            return False
        self._held = held.copy()
        self._current.hold(self._held)
        self._method.set_matrix(self._current, self._held)
        if self._aged():
            self._renew()
        else:
            self._method.keep()
            self._setup.kept = True
        self._ready = True
        return True

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, correction: bool = False) -> None:
        """Solve A x = b with the held unknowns at zero. Collective.

        Args:
            b: Right-hand side; entries at held unknowns must be zero.
            x: Vector for the solution.
            rtol: Tolerance relative to b.
            correction: Whether x is a small part of a solution, from which plastic flow and cost
                cannot be estimated.

        Raises:
            LinearFailure: If the system is singular or the iteration fails.
        """
        self.solves += 1
        outcome = self._attempt(b, x, rtol, correction)
        if outcome.solved and outcome.iterations > FEW_ITERATIONS and self._costs_more(outcome):
            self._improve()  # for later solves
        while not outcome.solved and self._improve():
            outcome = self._attempt(b, x, rtol, correction)
        if not outcome.solved:
            raise LinearFailure(
                f"the linear system could not be solved ({self.name}: {outcome.failure}); it is"
                " singular or nearly singular, perhaps because bodies lose all contact or flow"
                " plastically everywhere"
            )

    @property
    def _current(self) -> ContactOperator:
        assert self._operator is not None
        return self._operator

    def _attempt(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, correction: bool) -> Outcome:
        """Solve by the current method, and update the statistics."""
        outcome = self._method.solve(b, x, rtol)
        self.iterations += outcome.iterations
        self._setup.due = False
        if self.direct:
            self._setup.excess += outcome.iterations - 1
        elif correction:
            self._setup.note_correction(outcome.iterations, rtol)
        else:
            self._setup.note(outcome.iterations, rtol)
            self._rate = iterations_a_digit(outcome.iterations, rtol)
            if outcome.solved:
                self._flow = x.copy(self._flow)
        return outcome

    def _costs_more(self, outcome: Outcome) -> bool:
        """Return whether a factorisation would have cost less than this solve. Collective."""
        return not self.direct and outcome.iterations > self._price.iterations

    @cached_property
    def _price(self) -> Price:
        """Return the cost of a factorisation, from MUMPS's analysis of the matrix. Collective."""
        factorisation = Factorisation(self._problem.comm, heed=False)
        factorisation.set_matrix(self._current, self._held)
        price = factorisation.price()
        factorisation.destroy()
        return price

    def _aged(self) -> bool:
        """Return whether a changed matrix needs a new set-up.

        Factors remain useful as long as only held unknowns change.
        """
        if self._setup.due or (self.direct and self._other):
            return True
        # Factors are reused until the number of changed held unknowns exceeds this fraction (1/4)
        # of the iterations that cost as much as new factors: each change costs one or two
        # iterations.
        changes = 4
        if self.direct and changes * self._changes() > self._method.worth:
            return True
        return self._setup.excess >= self._method.worth

    def _changes(self) -> int:
        """Return the number of unknowns whose held state has changed since the last set-up."""
        changed = np.setxor1d(self._held, self._factorised)
        return int(self._problem.comm.allreduce(len(changed)))

    def _renew(self) -> None:
        """Renew the set-up; if solves converge slowly, include the last solution."""
        self._method.renew(self._flow if self._rate > WORTH_A_MOTION else None)
        self._factorised, self._other = self._held, False
        self._setup = SetUp(self._setup.usual)
        self.setups += 1

    def _improve(self) -> bool:
        """Renew an old set-up, or else switch to a factorisation; return whether either worked."""
        if self._setup.kept:
            self._renew()
            return True
        if self.direct or not self._price.fits:
            return False
        log.info(
            "%s has become slow; a factorisation, which takes as long as %d iterations, replaces "
            "it",
            *(self.name, self._price.iterations),
        )
        self._replace(Factorisation(self._problem.comm, heed=False))
        self._method.set_matrix(self._current, self._held)
        self._renew()
        return True

    def _replace(self, method: Method) -> None:
        """Replace the current method of the solver by another method."""
        self._method.destroy()
        self._method = method


def chosen_solver(problem: Problem) -> str:
    """Return the name of the method with which :class:`LinearSolver` starts for a problem."""
    return solver_name(*_types(_preset(problem)))


def _method(problem: Problem) -> Method:
    """Return the method that the user selects, or the default for this problem size."""
    preset = _preset(problem)
    ksp, pc = _types(preset)
    if ksp == "preonly":
        return Factorisation(problem.comm, preset)
    return Multigrid(problem) if pc == "mg" else Krylov(problem.comm, preset)


def _types(preset: Mapping[str, object]) -> tuple[str, str]:
    """Return the types of PETSc's KSP and PC: the user's types, or else the types of the preset."""
    options = PETSc.Options()
    ksp = options.getString(LINEAR + "ksp_type", str(preset["ksp_type"]))
    return ksp, options.getString(LINEAR + "pc_type", str(preset["pc_type"]))


def _preset(problem: Problem) -> Mapping[str, object]:
    """Return the preset for the preconditioner that the user selects, or the default by size."""
    asked = PETSc.Options().getString(LINEAR + "pc_type", "")
    for preset in (DIRECT, MULTIGRID):
        if preset["pc_type"] == asked:
            return preset
    return DIRECT if problem.num_dofs <= DIRECT_LIMIT[problem.bodies.gdim] else MULTIGRID
