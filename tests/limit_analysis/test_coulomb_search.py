"""Test where a path with Coulomb friction loses equilibrium, against statics."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.ring import write_ring
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Level,
    Newton,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    limit_load,
    read_gmsh,
)
from perfplast_fenicsx.limit_analysis import LimitLoad, limit_search
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.solvers.load_stepping import Reached
from perfplast_fenicsx.solvers.newton_options import Monitor
from tests.checks import assert_refused
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL

ELASTIC = Elastic(2e5, 0.3)
TIGHT = 1e-5


def block(
    comm: MPI.Intracomm,
    push: Sequence[float],
    weight: Sequence[float],
    mu: float,
    counts: int = 3,
) -> Problem:
    """Return a block of weight 1 on another block with a separate mesh; both are elastic."""
    gdim = len(push)
    return Problem(
        blocks_apart(comm, [counts] * gdim, [counts + 1] * gdim),
        {"lower": ELASTIC, "upper": ELASTIC},
        [Support("bottom")],
        [BodyForce("upper", tuple(weight), constant=True), BodyForce("upper", tuple(push))],
        [Contact("lower_top", "upper_bottom", coulomb=mu)],
    )


def assert_lost_at(limit: LimitLoad, exact: float, rtol: float) -> None:
    """The bracket is as narrow as required, and contains the load to the accuracy of levels."""
    assert limit.levelled_off, limit.reason
    assert not limit.theorem
    assert limit.upper is not None
    assert limit.lower == pytest.approx(exact, rel=rtol)
    assert limit.lower <= exact * (1 + 1e-6)
    assert exact <= limit.upper * (1 + 1e-6)
    assert limit.upper - limit.lower <= 1.0001 * rtol * limit.lower
    assert "no equilibrium exists" in limit.reason


@pytest.mark.mpi2("push0-weight0-0.3")
@pytest.mark.parametrize(
    ("push", "weight", "exact"),
    [
        ((1.0, 0.0), (0.0, -1.0), 0.3),  # μW
        ((1.0, 0.0), (-0.2, -1.0), 0.5),  # up a slope with tan α = 0.2, along it
        ((1.0, 0.0), (0.2, -1.0), 0.1),  # and down
        ((0.0, 1.0), (0.0, -1.0), 1.0),  # the block lifts off
    ],
)
def test_a_block_is_moved_at_the_load_of_statics(
    push: Sequence[float], weight: Sequence[float], exact: float, comm: MPI.Intracomm
) -> None:
    assert_lost_at(limit_load(block(comm, push, weight, 0.3), TIGHT), exact, TIGHT)


def test_a_block_in_space_slides_in_any_direction(comm: MPI.Intracomm) -> None:
    problem = block(comm, (0.8, 0.6, 0.0), (0.0, 0.0, -1.0), 0.3, counts=2)
    assert_lost_at(limit_load(problem, 1e-4), 0.3, 1e-4)


@pytest.mark.serial
def test_a_rough_block_tips() -> None:
    """W/2 about the edge balances F/2, because width and height of the block are equal."""
    problem = block(MPI.COMM_SELF, (1.0, 0.0), (0.0, -1.0), 3.0)
    limit = limit_load(problem, 1e-3)
    assert_lost_at(limit, 1.0, 1e-3)
    assert problem.loads.alpha(limit.mechanism.x.petsc_vec) == pytest.approx(1.0)


def test_push_out_force_of_a_press_fit(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """The force is 2π a L μ p with Lamé's pressure p.

    It is exact for ν = 0, for any effect of friction on the pressure. Consider the work of the
    tractions on a uniform compression of either body without motion along the axis. This work
    determines ∫p dz from the change of the radii, which differ by δ everywhere.
    """
    a, b, length, delta, mu, young = 1.0, 2.0, 1.0, 1e-3, 0.2, 2e5
    mesh_file = shared_tmp_path / "ring.msh"
    if comm.rank == 0:
        write_ring(mesh_file, 0.0, b, length, interface=a, size=0.25)
    comm.barrier()
    elastic = Elastic(young, 0.0)
    problem = Problem(
        read_gmsh(comm, mesh_file).turned(),
        {"inner_ring": elastic, "outer_ring": elastic},
        [Support("outer", "y")],
        [BodyForce("inner_ring", (0.0, 1 / (math.pi * a**2 * length)))],
        [Contact("outer_ring_seam", "inner_ring_seam", coulomb=mu, gap=-delta, interference=True)],
        degree=2,
    )
    pressure = young * delta / a / (1 + (b**2 + a**2) / (b**2 - a**2))
    exact = mu * pressure * 2 * math.pi * a * length
    limit = limit_load(problem, 1e-3)
    assert limit.levelled_off
    assert limit.lower == pytest.approx(exact, rel=1e-5)
    assert limit.drucker is not None
    assert limit.drucker.lower == pytest.approx(0.0, abs=1e-6)
    assert limit.drucker.upper == math.inf


@pytest.mark.serial
def test_bodies_that_collapse_first_do_so_as_if_they_were_tied() -> None:
    """The limit is 2k in plane strain, with friction and without slip."""

    def pressed(**joint: object) -> Problem:
        return Problem(
            blocks_apart(MPI.COMM_SELF, (2, 2), (2, 2), moved_by=0.0),
            {"lower": ELASTIC, "upper": STEEL},
            [Support("bottom")],
            [Pressure("top", 1.0)],
            degree=2,
            **joint,  # type: ignore[arg-type]
        )

    exact = 2 * STEEL.yield_stress / math.sqrt(3)
    tied = limit_load(pressed(contacts=[Tie("lower_top", "upper_bottom")]), 1e-5)
    assert tied.estimate == pytest.approx(exact, rel=1e-4)
    found = limit_load(pressed(contacts=[Contact("lower_top", "upper_bottom", coulomb=0.5)]), 1e-3)
    assert_lost_at(found, exact, 1e-3)
    assert found.drucker is not None
    assert found.drucker.upper == pytest.approx(exact, rel=1e-4)


def grows(loads: Sequence[Load], mu: float, material: object = STEEL, degree: int = 2) -> Problem:
    """Return a block on another block, pressed and pushed by loads that all grow."""
    return Problem(
        blocks_apart(MPI.COMM_SELF, (2, 2), (3, 3)),
        {"lower": material, "upper": material},  # type: ignore[dict-item]
        [Support("bottom")],
        list(loads),
        [Contact("lower_top", "upper_bottom", coulomb=mu)],
        degree=degree,
    )


@pytest.mark.long
@pytest.mark.serial
def test_slip_and_flow_together_lie_between_druckers_pair() -> None:
    found = limit_load(grows([Traction("top", (0.1, -1.0))], 0.2), 1e-3)
    assert found.levelled_off
    assert found.drucker is not None
    assert found.drucker.upper is not None
    assert found.upper is not None
    assert found.drucker.lower < found.lower < found.upper < found.drucker.upper


@pytest.mark.long(but=["0.9-does not level off"])
@pytest.mark.serial
@pytest.mark.parametrize(("mu", "ends"), [(0.1, "no load factor"), (0.9, "does not level off")])
def test_pushes_that_grow_with_the_pressure_slide_at_once_or_never(mu: float, ends: str) -> None:
    problem = grows([BodyForce("upper", (0.4, -1.0))], mu, ELASTIC, degree=1)
    found = limit_load(problem, 1e-3)
    assert not found.levelled_off
    assert found.estimate is None
    assert ends in found.reason


@pytest.mark.serial
def test_constant_loads_that_slide_alone_are_said_to() -> None:
    found = limit_load(block(MPI.COMM_SELF, (1.0, 0.0), (0.4, -1.0), 0.3), 1e-3)
    assert (found.lower, found.upper, found.levelled_off) == (0.0, None, False)
    assert found.reason.startswith("the constant loads alone")


class Silent(Newton):
    """ALG1 without a verdict."""

    def solve(
        self, value: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        return replace(super().solve(value, start, monitor), refuted=False)


@pytest.mark.serial
def test_without_a_verdict_the_bracket_stays_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limit_search, "Newton", Silent)
    found = limit_load(block(MPI.COMM_SELF, (1.0, 0.0), (0.0, -1.0), 0.3), 1e-3)
    assert found.lower == pytest.approx(0.3, rel=1e-6)
    assert found.upper is None
    assert not found.levelled_off
    reason = "so far; the solver neither converged nor showed that no equilibrium exists at ζ = "
    assert reason in found.reason


def test_a_search_that_was_ended_goes_on(comm: MPI.Intracomm) -> None:
    problem = block(comm, (1.0, 0.0), (0.0, -1.0), 0.3)
    kept: list[tuple[Reached, Search]] = []

    def keep(level: Level, search: Search) -> None:
        before = kept[-1][0].last if kept else None
        steps, rest = level.report.newton_iterations, search.rest or 0.0
        known = replace(search, points=list(search.points))
        kept.append((Reached(level.state, before, steps, rest), known))

    whole = limit_load(problem, TIGHT, on_level=keep)
    for reached, search in kept:
        again = limit_load(problem, TIGHT, search=search, reached=reached)
        assert again.lower == pytest.approx(whole.lower, rel=1e-8)
        assert again.upper == pytest.approx(whole.upper, rel=1e-8)
        assert again.iterations == whole.iterations


@pytest.mark.parametrize(
    ("rtol", "method", "words"),
    [
        (1e-7, None, ["limit_tolerance = 1e-07 is too small", "give 1e-05 or more"]),
        (1e-3, "interior-point", ["no limit theorem holds", "limit_method = 'path'", "tresca"]),
    ],
)
def test_what_cannot_be_searched_is_refused(
    rtol: float, method: str | None, words: list[str], comm: MPI.Intracomm
) -> None:
    problem = block(comm, (1.0, 0.0), (0.0, -1.0), 0.3)
    assert_refused(partial(limit_load, problem, rtol, method=method), words)
