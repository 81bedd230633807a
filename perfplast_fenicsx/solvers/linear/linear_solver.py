"""Linear systems of one step, with some unknowns held: which way to solve, when to set up again.

A way of solving (:class:`Factorisation`, :class:`Multigrid`, :class:`Krylov`) knows how; when its
set-up has aged and what takes over where it fails is decided here.
"""

import logging
from collections.abc import Mapping
from functools import cached_property
from typing import Protocol

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT, Factorisation
from perfplast_fenicsx.solvers.linear.krylov import Krylov
from perfplast_fenicsx.solvers.linear.multigrid import MULTIGRID, Multigrid
from perfplast_fenicsx.solvers.linear.mumps_memory import Price
from perfplast_fenicsx.solvers.linear.outcome import Outcome
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, solver_name
from perfplast_fenicsx.solvers.linear.set_up import SetUp, iterations_a_digit

DIRECT_LIMIT = {2: 300_000, 3: 40_000}
"""Up to so many unknowns, by dimension, a sparse Cholesky factorisation is the quicker one."""

FEW_ITERATIONS = 50
"""A solve by multigrid in no more Krylov iterations is not compared with a factorisation."""


WORTH_A_MOTION = 6.0
"""Krylov iterations a decimal digit from which on coarse spaces get the last solution as a motion;
elastic bodies take two."""

log = logging.getLogger(__name__)


class LinearFailure(RuntimeError):
    """A linear system that could not be solved; the message is the reason, alike on every rank."""


class Method(Protocol):
    """A way of solving A x = b.

    Attributes:
        name: Name of the solver, for people.
    """

    name: str

    @property
    def worth(self) -> int:
        """Krylov iterations that a set-up costs as much as."""

    def prepare(self, operator: ContactOperator) -> bool:
        """Make what outlives set-ups of an operator that is new; whether this way suits it."""

    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Take the matrix of an operator, formed with ``held`` taken out. Collective."""

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Set up again, from the present matrix at the latest with the next solve. Collective.

        Args:
            flow: How bodies move that are hard to solve for; None if they are not.
        """

    def keep(self) -> None:
        """Solve with the set-up there is, though the matrix is another one."""

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, to ``rtol`` relative to b. Collective."""

    def destroy(self) -> None:
        """Give back memory at once. Collective."""


class LinearSolver:
    """Solves A y = b in the jump basis, with any set of unknowns held at zero.

    CG with smoothed aggregation for large problems, MUMPS Cholesky for small ones; every PETSc
    option can be given with the prefix ``perfplast_``. Coarse grids are kept while the operator and
    the held unknowns change, with the finest one up to date, until the iterations that this has
    cost beyond those of new ones outweigh a set-up. Where bodies flow and it takes many iterations,
    they are made for the last solution as well.

    Attributes:
        iterations: Krylov iterations so far.
        solves: Systems solved so far.
        setups: Factorisations or multigrid set-ups so far.
    """

    def __init__(self, problem: Problem) -> None:
        """Choose a solver by size and the user's options. Collective."""
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
        """The name of the present method."""
        return self._method.name

    @property
    def direct(self) -> bool:
        """Whether a factorisation is used."""
        return isinstance(self._method, Factorisation)

    def counts(self) -> tuple[int, int, int]:
        """Systems solved, set-ups and Krylov iterations so far."""
        return self.solves, self.setups, self.iterations

    def set_operator(self, operator: ContactOperator) -> None:
        """Take a new operator, or the same one with new values; nothing is held. Collective."""
        self._operator, self._ready = operator, False
        norm = operator.stiffness.norm(PETSc.NormType.FROBENIUS) if self.direct else 0.0
        # Two stiffness matrices whose norms differ by less, relative, are one.
        rounding = 1e-9
        self._other = not abs(norm - self._norm) <= rounding * norm
        self._norm = norm
        if not self._method.prepare(operator):
            self._replace(Factorisation(self._problem.comm, heed=False))

    def hold(self, held: Ints) -> bool:
        """Hold the unknowns with these local (owned) indices at zero. Collective.

        Returns:
            Whether this called for a new matrix.
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
        """Solve for x. Collective.

        Args:
            b: Right-hand side; entries at held unknowns must be zero.
            x: Takes the solution.
            rtol: Tolerance relative to b.
            correction: Whether x is a small part of a solution, which shows neither how bodies flow
                nor what a digit costs.

        Raises:
            LinearFailure: If the system is singular or the iteration fails.
        """
        self.solves += 1
        outcome = self._attempt(b, x, rtol, correction)
        if outcome.solved and outcome.iterations > FEW_ITERATIONS and self._costs_more(outcome):
            self._improve()  # for the solves to come
        while not outcome.solved and self._improve():
            outcome = self._attempt(b, x, rtol, correction)
        if not outcome.solved:
            raise LinearFailure(
                f"the linear system could not be solved ({self.name}: {outcome.failure}); it is"
                " singular or nearly so, as where bodies lose all contact or everything flows"
                " plastically"
            )

    @property
    def _current(self) -> ContactOperator:
        assert self._operator is not None
        return self._operator

    def _attempt(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, correction: bool) -> Outcome:
        """Solve in the present way, and learn from it."""
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
        """Return the cost of a factorisation, by MUMPS's analysis of the matrix. Collective."""
        factorisation = Factorisation(self._problem.comm, heed=False)
        factorisation.set_matrix(self._current, self._held)
        price = factorisation.price()
        factorisation.destroy()
        return price

    def _aged(self) -> bool:
        """Return whether another matrix calls for another set-up.

        Factors serve as long as nothing but the held unknowns changes.
        """
        if self._setup.due or (self.direct and self._other):
            return True
        # Factors are kept where no more than one in so many of the iterations that
        # they are worth is the number of unknowns that are held no more, or for
        # the first time: each costs one or two.
        changes = 4
        if self.direct and changes * self._changes() > self._method.worth:
            return True
        return self._setup.excess >= self._method.worth

    def _changes(self) -> int:
        """How many unknowns are held that were not in the last set-up, or the other way round."""
        changed = np.setxor1d(self._held, self._factorised)
        return int(self._problem.comm.allreduce(len(changed)))

    def _renew(self) -> None:
        """Set up again; where bodies flow, for the last solution as well."""
        self._method.renew(self._flow if self._rate > WORTH_A_MOTION else None)
        self._factorised, self._other = self._held, False
        self._setup = SetUp(self._setup.usual)
        self.setups += 1

    def _improve(self) -> bool:
        """Renew a set-up that was kept, or else factorise; whether either was left to do."""
        if self._setup.kept:
            self._renew()
            return True
        if self.direct or not self._price.fits:
            return False
        log.info(
            "%s has become slow; a factorisation, worth %d iterations, takes over",
            *(self.name, self._price.iterations),
        )
        self._replace(Factorisation(self._problem.comm, heed=False))
        self._method.set_matrix(self._current, self._held)
        self._renew()
        return True

    def _replace(self, method: Method) -> None:
        """Solve in another way from now on."""
        self._method.destroy()
        self._method = method


def chosen_solver(problem: Problem) -> str:
    """Return the name of the method with which :class:`LinearSolver` begins for a problem."""
    return solver_name(*_types(_preset(problem)))


def _method(problem: Problem) -> Method:
    """Return the way of solving that the user asks for, or the one for this size."""
    preset = _preset(problem)
    ksp, pc = _types(preset)
    if ksp == "preonly":
        return Factorisation(problem.comm, preset)
    return Multigrid(problem) if pc == "mg" else Krylov(problem.comm, preset)


def _types(preset: Mapping[str, object]) -> tuple[str, str]:
    """Return types of PETSc's KSP and PC: the preset's, unless the user gives others."""
    options = PETSc.Options()
    ksp = options.getString(LINEAR + "ksp_type", str(preset["ksp_type"]))
    return ksp, options.getString(LINEAR + "pc_type", str(preset["pc_type"]))


def _preset(problem: Problem) -> Mapping[str, object]:
    """Return the preset whose preconditioner the user asks for, or the one for this size."""
    asked = PETSc.Options().getString(LINEAR + "pc_type", "")
    for preset in (DIRECT, MULTIGRID):
        if preset["pc_type"] == asked:
            return preset
    return DIRECT if problem.num_dofs <= DIRECT_LIMIT[problem.bodies.gdim] else MULTIGRID
