"""Define the interface of solvers of contact quadratic programs, and create Total FETI solvers."""

from typing import Any, Protocol

from petsc4py import PETSc

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.contact_qp import ContactStep
from perfplast_fenicsx.solvers.active_set.equality_qp import NOTHING_HELD, Held
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.newton_options import Subdivision
from perfplast_fenicsx.solvers.tfeti.subdomains import TornStiffness, make_subdomains
from perfplast_fenicsx.solvers.tfeti.tfeti_program import TfetiProgram


class ContactSolver(Protocol):
    """The interface of contact solvers; :class:`contact_qp.ContactProgram` implements it."""

    def set_operator(self, A: Any) -> None:
        """Set the operator, which is the tangent at the iterate. Collective."""
        ...

    def solve(
        self,
        r: PETSc.Vec,
        room: Floats,
        active: PairFlags,
        rtol: float,
        most_sets: int | None = None,
        work: float | None = None,
        given: Held = NOTHING_HELD,
        first: float = 0.0,
    ) -> ContactStep:
        """Solve the contact QP. Collective."""
        ...

    def response(
        self, load: PETSc.Vec, held: PairFlags, rtol: float, given: Held = NOTHING_HELD
    ) -> PETSc.Vec:
        """Return δ under a load, while the pairs ``held`` keep their jumps. Collective."""
        ...

    def counts(self) -> tuple[int, int, int]:
        """Return the numbers of contact QPs, of QPs that SNES-VI solved, and of its iterations."""
        ...


def counts(linear: LinearSolver, program: ContactSolver) -> dict[str, Any]:
    """Return the counts so far, as integers by their names in :class:`report.LevelReport`."""
    names = ("linear_solves", "setups", "linear_iterations")
    more = ("contact_programs", "snes_vi_programs", "snes_vi_iterations")
    return dict(zip((*names, *more), (*linear.counts(), *program.counts()), strict=True))


def make_tfeti(
    problem: Problem, linear: LinearSolver, subdivision: Subdivision
) -> tuple[Iterate, ContactSolver]:
    """Return an iterate, and a Total FETI solver of its contact programs. Collective.

    Args:
        problem: The problem that is solved.
        linear: The linear solver, which counts the linear solves.
        subdivision: The requested number of subdomains.

    Raises:
        InputError: If Total FETI does not support the problem.
    """
    if problem.friction.count:
        raise InputError(
            'contact_solver = "tfeti" does not support friction; give contact_solver = '
            '"snes-vi", or remove the friction of the contacts.'
        )
    wanted = subdivision.wanted(problem.num_dofs, problem.bodies.gdim)
    pieces = make_subdomains(problem, wanted, exactly=subdivision.asked is not None)
    iterate = Iterate(problem, lambda fields: TornStiffness(fields, pieces))
    return iterate, TfetiProgram(problem, pieces, linear)
