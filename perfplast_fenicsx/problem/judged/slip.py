"""Track accumulated slip, and the origin from which friction counts slip in a level."""

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem


def slipped(problem: Problem, state: State) -> Floats:
    """Return the slip since the beginning (length), shape (num_places, gdim − 1). Collective.

    Args:
        problem: Problem with the places of friction.
        state: State of the problem.
    """
    y = problem.create_vector()
    problem.basis.M.mult(state.u.x.petsc_vec, y)
    slip = problem.friction.jumps(y) - problem.motion.slide_at(state.zeta)
    y.destroy()
    return slip


def remember_slip(problem: Problem, start: State | None) -> None:
    """Set the origin of slip to the state that a level starts from, in stages. Collective.

    Without stages a level is one step from rest, from whatever state the iteration starts.

    Args:
        problem: The problem, moved to the load factor of the level.
        start: The state; None for the state at rest.
    """
    if problem.in_stages and problem.friction.count and start is not None:
        problem.friction.origin[:] += slipped(problem, start)


def check_slip_is_true(problem: Problem) -> None:
    """Refuse friction with associated slip, which levels and paths do not support.

    Raises:
        InputError: If friction is associated.
    """
    for it in (*problem.given.contacts, *problem.given.obstacles):
        if it.associated:
            raise InputError(
                f"the friction at '{it.on}' is associated, which separates slipping "
                "surfaces and is only for bounds of the body; give control = 'bounds', or "
                "remove associated."
            )
