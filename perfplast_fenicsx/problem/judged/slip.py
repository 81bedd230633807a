"""Slip so far, and the origin from which friction counts slip in a level."""

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem


def slipped(problem: Problem, state: State) -> Floats:
    """Slip since the beginning (length), shape (num_places, gdim − 1). Collective.

    Args:
        problem: Whose places of friction they are.
        state: Its state.
    """
    y = problem.create_vector()
    problem.basis.M.mult(state.u.x.petsc_vec, y)
    slip = problem.friction.jumps(y) - problem.motion.slide_at(state.zeta)
    y.destroy()
    return slip


def remember_slip(problem: Problem, start: State | None) -> None:
    """Let friction count slip from the state that a level starts from, in stages. Collective.

    Elsewhere a level is one step from rest, whatever it starts from.

    Args:
        problem: The problem, moved to the load factor of the level.
        start: The state; None for rest.
    """
    if problem.in_stages and problem.friction.count and start is not None:
        problem.friction.origin[:] += slipped(problem, start)


def check_slip_is_true(problem: Problem) -> None:
    """Refuse friction whose slip is associated, which neither levels nor paths have.

    Raises:
        InputError: If it is associated.
    """
    for it in (*problem.given.contacts, *problem.given.obstacles):
        if it.associated:
            raise InputError(
                f"the friction at '{it.on}' is associated, which parts surfaces that slip, and is"
                " for bounds of the body alone; give control = 'bounds', or leave associated out."
            )
