"""Test the upper bound on the limit load: its value, reasons without one, and clean-up."""

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import (
    Contact,
    Elastic,
    Newton,
    Pressure,
    Problem,
    Support,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis.path import limit_judge, viscous_flow
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.solvers.linear import factorisation
from tests.models import stack_problem

WEAK = VonMises(2e5, 0.3, 300.0)


def blocks(lower: Material, upper: Material, degree: int = 1) -> Problem:
    return Problem(
        stacked_blocks(MPI.COMM_WORLD, 2),
        {"lower": lower, "upper": upper},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=degree,
    )


def bound(problem: Problem) -> limit_judge.MechanismBound:
    """Return the bound from the elastic displacement."""
    state = Newton(problem).solve(1.0).state
    return limit_judge.dissipation_bound(problem, state.u, state)


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.serial)])
def test_blocks_in_uniaxial_stress(degree: int) -> None:
    found = bound(blocks(WEAK, WEAK, degree))
    assert found.value == pytest.approx(300.0, rel=1e-9)
    assert found.solves > 0
    assert not found.reason


def test_an_elastic_body_takes_no_part_in_the_mechanism() -> None:
    found = bound(blocks(WEAK, Elastic(2e5, 0.3)))
    assert found.value == pytest.approx(300.0, rel=1e-9)


def test_elastic_bodies_have_none() -> None:
    found = bound(blocks(Elastic(2e5, 0.3), Elastic(7e4, 0.3)))
    assert found.value is found.mechanism is None
    assert "nothing dissipates" in found.reason


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("FactorisedFlow.exact", -1.0, "no velocity is admissible"),
        ("MOST_ITERATIONS", 0, "does not become admissible"),
        ("ROUNDING", 1e9, "no work"),
    ],
)
def test_why_there_is_none(
    monkeypatch: pytest.MonkeyPatch, name: str, value: float, reason: str
) -> None:
    monkeypatch.setattr(f"{viscous_flow.__name__}.{name}", value)
    found = bound(blocks(WEAK, WEAK))
    assert found.value is found.mechanism is None
    assert reason in found.reason


@pytest.fixture(params=[-1.0, pytest.param(1.0, marks=pytest.mark.serial)])
def short_of_memory(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Factors do not fit according to MUMPS's analysis, or finally do not fit (MB)."""
    monkeypatch.setattr(viscous_flow, "LARGE", 10)
    for module in (viscous_flow, factorisation):
        monkeypatch.setattr(module, "spare_memory", lambda comm: request.param)


@pytest.mark.mpi3("-1.0-2")
@pytest.mark.usefixtures("short_of_memory")
@pytest.mark.parametrize("degree", [2, pytest.param(1, marks=pytest.mark.serial)])
def test_flows_whose_factors_do_not_fit_are_iterated(degree: int) -> None:
    found = bound(blocks(WEAK, WEAK, degree))
    assert found.value is not None
    assert 300 * (1 - 1e-6) <= found.value <= 300 * (1 + 1e-5)
    assert found.mechanism is not None


@pytest.mark.parametrize("iterated", [False, True])
def test_pairs_that_seem_to_close(monkeypatch: pytest.MonkeyPatch, iterated: bool) -> None:
    """If a solution leaves a residual, pairs close to contact are held at once."""
    problem = blocks(WEAK, WEAK)
    flow = viscous_flow.ViscousFlow(problem)
    if iterated:
        flow._system.destroy()
        flow._system = viscous_flow.IteratedFlow(problem)
    near, far, held = -1e-5, -1e-2, np.zeros(len(problem.basis.index), dtype=bool)
    jumps = np.where(np.arange(held.size) % 2, near, far)
    monkeypatch.setattr(flow, "_jumps", lambda: jumps)
    assert not flow.hold(held)
    assert not held.any()
    jumps[:1] = 1e-6
    expected = jumps > 0
    if iterated:
        expected |= jumps == near
    assert flow.hold(held)
    np.testing.assert_array_equal(held, expected)
    assert not flow.hold(held)
    np.testing.assert_array_equal(held, expected)
    flow.destroy()


@pytest.mark.parametrize("exact", [1e-11, -1.0])
def test_what_petsc_made_is_destroyed(monkeypatch: pytest.MonkeyPatch, exact: float) -> None:
    """Objects of PETSc are destroyed with or without a bound."""
    made: list[Any] = []
    prefixes: list[str] = []
    create, own_prefix = viscous_flow.create_stiffness, viscous_flow.own_prefix

    def stiffness(problem: Problem) -> PETSc.Mat:
        made.append(create(problem))
        return made[-1]

    def prefix(*arguments: Any) -> str:
        prefixes.append(own_prefix(*arguments))
        return prefixes[-1]

    problem = blocks(WEAK, WEAK)
    state = Newton(problem).solve(1.0).state
    monkeypatch.setattr(viscous_flow.FactorisedFlow, "exact", exact)
    monkeypatch.setattr(viscous_flow, "own_prefix", prefix)
    monkeypatch.setattr(viscous_flow, "create_stiffness", stiffness)
    limit_judge.dissipation_bound(problem, state.u, state)
    assert made
    assert all(matrix.handle == 0 for matrix in made)
    assert prefixes
    assert prefixes[0].startswith("perfplast_bound_")


@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_a_velocity_near_a_mechanism_gives_a_bound(bend: float) -> None:
    """Both blocks yield at the pressure 300; a bent velocity dissipates more."""
    problem = stack_problem(2)
    v = fem.Function(problem.V)
    v.interpolate(lambda x: np.array([x[0], x[1], -2 * x[2] + bend * np.sin(9 * x[0]) * x[2]]))
    found = limit_judge.dissipation_bound(problem, v, Newton(problem).solve(100.0).state)
    assert found.value is not None
    assert found.mechanism is not None
    assert problem.loads.alpha(found.mechanism.x.petsc_vec) == pytest.approx(1)
    assert found.value == pytest.approx(300.0, rel=1e-9 if bend == 0 else 0.1)
    assert found.value >= 300 * (1 - 1e-9)
    assert found.solves >= 1
