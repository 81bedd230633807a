"""Test multigrid for contact of separately meshed bodies, with and without friction."""

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Contact, Elastic, Newton, Problem, Support, Traction
from perfplast_fenicsx.solvers.linear import linear_solver, multigrid
from tests.checks import assert_solved
from tests.contact.blocks_apart import blocks_apart

BODY = Elastic(young=2e5, poisson=0.3)
COUNTS = {2: {"matching": (40, 40), "apart": (30, 45)}, 3: {"matching": (9, 9), "apart": (7, 10)}}
"""Cells along an edge of each of two blocks, with similar numbers of unknowns."""


def iterations(gdim: int, which: str, tresca: float | None) -> float:
    """Return the mean CG iterations per system, for a block pressed on another and pushed."""
    load = [0.0] * gdim
    load[0], load[-1] = 5.0, -100.0
    sides = ["upper_x0", "upper_y0"][: gdim - 1] if tresca is None else []
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, *([n] * gdim for n in COUNTS[gdim][which]), moved_by=0.0),
        {"lower": BODY, "upper": BODY},
        [Support("bottom"), *(Support(name, name[-2]) for name in sides)],
        [Traction("top", load)],
        [Contact("lower_top", "upper_bottom", tresca=tresca)],
    )
    assert problem.constraints.in_mean == (which == "apart")
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    assert level.report.active_contacts == problem.num_pairs
    if tresca is not None and tresca < 10.0:
        assert 0 < level.report.slipping < problem.friction.count
    return level.report.linear_iterations / level.report.linear_solves


@pytest.mark.long(but=["2"])
@pytest.mark.parametrize("gdim", [2, 3])
def test_as_few_iterations_as_where_nodes_match(gdim: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most 1.3 times as many; at most twice as many with partial stick or slip.

    Old set-ups would cost additional iterations.
    """
    monkeypatch.setattr(multigrid, "WORTH", {1: 0})
    monkeypatch.setattr(linear_solver, "DIRECT_LIMIT", {2: 0, 3: 0})
    apart = {tresca: iterations(gdim, "apart", tresca) for tresca in (None, 1e4, 6.0)}
    matching = iterations(gdim, "matching", None)
    assert apart[None] <= 1.3 * matching
    assert apart[1e4] <= 1.5 * matching
    assert apart[6.0] <= 2.0 * matching
