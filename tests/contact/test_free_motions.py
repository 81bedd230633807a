"""Test unresisted rigid motions: fixed without force, or refused if a load drives them."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BodyForce,
    BorderedNewton,
    Contact,
    Newton,
    NewtonOptions,
    Problem,
    Support,
    Traction,
    WorkNewton,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.mesh import gmsh_session
from perfplast_fenicsx.problem import LoadCase
from perfplast_fenicsx.solvers import LevelSolver
from tests.checks import assert_refused, assert_solved
from tests.models import STEEL, Read, touching_blocks

SLIDING = [Support("bottom")]
"""The upper block may slide in both directions, and rotate about the vertical axis."""

UPPER = "the body 'upper' (translation in x, translation in y, rotation about z)"


def write_round_pin(path: str | Path) -> None:
    """Write a disc in the hole of a square plate; surfaces ``left``, ``right``."""
    with gmsh_session() as gmsh:
        occ, model = gmsh.model.occ, gmsh.model
        pin, hole = (occ.addDisk(4, 1, 0, 1, 1) for _ in range(2))
        plate = occ.addRectangle(1, -2, 0, 6, 6)
        occ.cut([(2, plate)], [(2, hole)])
        occ.synchronize()
        model.addPhysicalGroup(2, [pin], name="pin")
        model.addPhysicalGroup(2, [plate], name="plate")
        model.addPhysicalGroup(1, [abs(c) for _, c in model.getBoundary([(2, pin)])], name="round")
        for _, curve in model.getBoundary([(2, plate)]):
            low, high = np.reshape(model.getBoundingBox(1, abs(curve)), (2, 3))[:, 0]
            name = {1: "left", 7: "right"}.get(round(low)) if high - low < 1e-3 else None
            if name is None and math.isclose(high - low, 2, abs_tol=1e-3):
                name = "hole"
            if name:
                model.addPhysicalGroup(1, [abs(curve)], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.6)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        model.mesh.generate(2)
        gmsh.write(str(path))


def round_pin(read: Read, load: Traction | BodyForce, tresca: float | None = None) -> Problem:
    """Return a pin without friction, or with very little friction."""
    return Problem(
        read(write_round_pin),
        {"pin": STEEL, "plate": STEEL},
        [Support("left")],
        [load],
        [Contact("round", "hole", tresca=tresca)],
        degree=2,
    )


@pytest.mark.parametrize("load", [Traction("right", (1.0, 0.3)), BodyForce("pin", (1.0, 0.3))])
def test_a_round_pin_without_friction(
    read: Read, load: Traction | BodyForce, caplog: pytest.LogCaptureFixture
) -> None:
    """The solution is the same as with almost zero friction, and no force holds the pin."""
    with caplog.at_level(logging.WARNING):
        problem = round_pin(read, load)
    told = "of the body 'pin' (rotation), and no load"
    assert caplog.text.count(told) == (problem.comm.rank == 0)
    assert "loosely held" not in caplog.text
    free = Newton(problem).solve(20.0)
    assert_solved(free)
    assert free.report.equilibrium < 1e-11
    rubbed = Newton(round_pin(read, load, tresca=1e-8)).solve(20.0)
    assert_solved(rubbed)
    assert free.report.alpha == pytest.approx(rubbed.report.alpha, rel=1e-6)
    assert free.report.active_contacts == rubbed.report.active_contacts


def test_what_turns_is_shown_as_it_was_on_average(read: Read) -> None:
    """The displayed position is an average, and does not depend on the single held node."""
    problem = round_pin(read, BodyForce("pin", (1.0, 0.0)))
    assert problem.free.count == 1
    u = Newton(problem).solve(20.0).state.u
    F = problem.free.at_nodes
    moved = problem.comm.allreduce(F.T @ u.x.array[: F.shape[0]])
    size = problem.comm.allreduce(abs(F).T @ np.abs(u.x.array[: F.shape[0]]))
    assert np.abs(moved) <= 1e-12 * size


@pytest.mark.mpi2("Newton")
@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton])
def test_a_block_that_may_slide(method: type[LevelSolver]) -> None:
    problem = touching_blocks(supports=SLIDING, degree=2)
    assert problem.free.words(np.arange(problem.free.count)) == UPPER
    value = 100.0 if method in (Newton, AugmentedLagrangian) else Newton(problem).solve(100.0)
    level = method(problem).solve(value if isinstance(value, float) else value.state.alpha)
    assert_solved(level)
    assert level.report.zeta == pytest.approx(100.0)
    assert level.report.equilibrium < 1e-9


def test_a_block_that_may_slide_by_total_feti() -> None:
    problem = touching_blocks(supports=SLIDING, degree=2)
    level = Newton(problem, NewtonOptions(contact_solver="tfeti", subdomains=4)).solve(100.0)
    assert_solved(level)
    whole = Newton(problem).solve(100.0)
    assert level.report.alpha == pytest.approx(whole.report.alpha, rel=1e-7)


def test_limit_loads_and_bounds_of_a_block_that_may_slide() -> None:
    """Only the strength of the block limits the load: σ_y in uniaxial stress."""
    problem = touching_blocks(supports=SLIDING, degree=2)
    limit = limit_load(problem, 1e-3)
    assert limit.estimate == pytest.approx(450.0, rel=1e-3)
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert 0.99 * 450 < bounds.lower.value <= 450 * (1 + 1e-9)
    assert 450 * (1 - 1e-9) <= bounds.upper.value < 1.01 * 450


def test_a_load_that_drives_the_motion_is_refused() -> None:
    loads = [Traction("top", (1e-4, 0.0, -1.0))]
    words = ["the body 'upper' (translation in x", "a load does work", "add a support"]
    assert_refused(lambda: touching_blocks(supports=SLIDING, loads=loads), words)


def test_a_load_that_comes_to_drive_it_has_no_level() -> None:
    """Loads may be replaced, as stages do."""
    problem = touching_blocks(supports=SLIDING)
    push = [Traction("top", (1.0, 0.0, 0.0))]
    pushed = touching_blocks(problem.tagged_mesh, loads=push).loads.live
    side = problem.create_vector()
    side.array[:] = pushed.array_r
    problem.loads = LoadCase(problem.loads.dead, side)
    report = Newton(problem).solve(1.0).report
    assert not report.converged
    assert "'upper' (translation in x, rotation about z) can move" in report.reason


def test_blocks_that_move_together() -> None:
    problem = touching_blocks(supports=[Support("x0", "x"), Support("bottom", "z")])
    words = problem.free.words(np.arange(problem.free.count))
    assert words == "the body 'lower' (translation in y); the body 'upper' (translation in y)"
    tied = touching_blocks(
        supports=[Support("x0", "x"), Support("bottom", "z")],
        contacts=[Contact("lower_top", "upper_bottom", tresca=1.0)],
    )
    words = tied.free.words(np.arange(tied.free.count))
    assert words == "the bodies 'lower' and 'upper' together (translation in y)"
