"""Test joints with associated slip: both limit theorems apply, and both bounds hold."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scipy.optimize import brentq

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Newton,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    limit_bounds,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.checks import assert_refused
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.stress_checker import check_stress
from tests.limit_analysis.test_rings import disc
from tests.limit_analysis.test_rubbing_bounds import K, between_platens, both
from tests.models import STEEL

COMM = MPI.COMM_WORLD
LEAD = VonMises(young=16000.0, poisson=0.44, yield_stress=20.0)
SLOPE = 0.5
SINE, COSINE = SLOPE / math.hypot(1, SLOPE), 1 / math.hypot(1, SLOPE)


def cut_column(mu: float, c: float, around: float = 0.0) -> Problem:
    """Return a column under the pressure 1, cut by a plane, with another pressure on its sides."""
    sides = ("x0", "x1", "upper_x0", "upper_x1") if around else ()
    return Problem(
        blocks_apart(COMM, (2, 2), (2, 2), moved_by=0.0, slope=SLOPE),
        {"lower": LEAD, "upper": LEAD},
        [Support("bottom")],
        [Pressure("top", 1.0), *(Pressure(side, around, constant=True) for side in sides)],
        [Contact("lower_top", "upper_bottom", tresca=c, coulomb=mu, associated=True)],
        degree=2,
    )


@pytest.mark.parametrize(("mu", "c", "around"), [(0.2, 0.3, 0.0), (0.4, 1.0, 0.0), (0.3, 0.0, 2.0)])
def test_a_column_slides_along_its_cut(mu: float, c: float, around: float) -> None:
    """The stress is uniform: (q − p) sin cos = c + μ (q cos² + p sin²) on the cut."""
    exact = c + around * (SINE * COSINE + mu * SINE**2)
    exact /= SINE * COSINE - mu * COSINE**2
    bounds = limit_bounds(cut_column(mu, c, around), 1e-6)
    assert bounds.strict
    assert exact * (1 - 3e-6) < (bounds.lower.value or 0.0) <= exact * (1 + 1e-9)
    assert exact * (1 - 1e-9) <= (bounds.upper.value or 0.0) < exact * (1 + 3e-6)
    assert "by the coefficient of friction times the slip" in bounds.in_words()
    assert "Drucker" not in bounds.in_words()


def on_an_incline(slope: float, mu: float, c: float, associated: bool) -> Problem:
    """Return a block, three times as wide as high, of weight 10 per width, pushed up an incline."""
    mesh = blocks_apart(COMM, (6, 2), (6, 2), moved_by=0.0, slope=3 * slope)
    mesh.mesh.geometry.x[:, 0] *= 3
    return Problem(
        mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [BodyForce("upper", (0.0, -10.0), constant=True), BodyForce("upper", (1.0, 0.0))],
        [Contact("lower_top", "upper_bottom", tresca=c, coulomb=mu, associated=associated)],
        degree=2,
    )


@pytest.mark.parametrize(("slope", "mu", "c"), [(0.1, 0.2, 1.0), (0.2, 0.6, 0.3), (-0.3, 0.2, 0.0)])
def test_a_block_on_an_incline(slope: float, mu: float, c: float) -> None:
    """Statics gives F cos − G sin = c A + μ (G cos + F sin); Drucker's lower bound has μ = 0."""

    def statics(mu: float) -> float:
        return (c * (1 + slope**2) + 10 * (mu + slope)) / (1 - mu * slope)

    exact = statics(mu)
    joint = limit_bounds(on_an_incline(slope, mu, c, associated=True), 1e-6)
    assert joint.strict
    least, most = (exact + of * abs(exact) for of in (-1e-6, 1e-6))
    assert least < (joint.lower.value or 0.0) < (joint.upper.value or 0.0) < most
    assert (joint.lower.value or 0.0) < exact + 1e-9 < (joint.upper.value or 0.0) + 2e-9
    pair = limit_bounds(on_an_incline(slope, mu, c, associated=False), 1e-6)
    assert pair.upper.value == pytest.approx(exact, rel=1e-6)
    if c > 0:
        assert pair.lower.strict
        assert pair.lower.value == pytest.approx(statics(0.0), rel=1e-6)
    else:
        assert "tresca" in " ".join(pair.why_not)


@pytest.mark.mpi2("0.5-True")
@pytest.mark.parametrize(("c", "dead"), [(0.5, True), (0.0, True), (0.5, False)])
def test_a_block_in_space(shared_tmp_path: Path, c: float, dead: bool) -> None:
    """The lower bound equals statics in any direction along the joint; the checker finds it too."""
    mu, slope = 0.3, 0.2 * dead
    mesh = blocks_apart(COMM, (2, 2, 1), (2, 2, 1), moved_by=0.0)
    mesh.mesh.geometry.x[:, :2] *= 3
    weight, push = np.array([-10 * slope, 0.0, -10.0]) * dead, np.array([0.28, 0.96, dead - 1.0])
    problem = Problem(
        mesh,
        {"lower": LEAD, "upper": LEAD},
        [Support("bottom")],
        [BodyForce("upper", weight, constant=True), BodyForce("upper", push)],
        [Contact("lower_top", "upper_bottom", tresca=c, coulomb=mu, associated=True)],
        degree=2,
    )

    def left(factor: float) -> float:
        x, y, z = weight + factor * push
        return float(math.hypot(x, y) - c + mu * z)

    exact = brentq(left, 0.0, 10.0, xtol=1e-14)
    bounds = limit_bounds(problem, 1e-6)
    assert bounds.strict
    assert exact * (1 - 1e-6) < (bounds.lower.value or 0.0) <= exact * (1 + 1e-9)
    results = ResultFolder(COMM, shared_tmp_path)
    write_proof(results, results.file("bounds.h5"), *proofs(bounds, bounds))
    found = check(results.file("bounds.h5"))
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-9)
    assert bounds.static is not None
    checked = check_stress(problem, bounds.static.stress)
    joint = np.isclose(checked.x[..., 2], 1.0).all(axis=1) & (checked.normals[:, 2] > 0.9)
    mean = float(checked.pressures(joint).mean())  # the facets have equal size
    assert mean == pytest.approx(-weight[2] - exact * push[2], rel=1e-5)


def test_both_bounds_are_those_of_the_joint() -> None:
    """The upper bound is Drucker's, except at one corner.

    The lower bound is much higher than Drucker's.
    """
    pair = both(limit_bounds(between_platens(4, coulomb=0.1)))
    joint = both(limit_bounds(between_platens(4, coulomb=0.1, associated=True)))
    assert joint[1] == pytest.approx(pair[1], rel=1e-3)
    assert 1.05 * pair[0] < joint[0] < joint[1] < 1.04 * joint[0]
    more = both(limit_bounds(between_platens(4, coulomb=0.1, tresca=0.1 * K, associated=True)))
    assert joint[0] < more[0] < more[1]


def test_around_an_axis() -> None:
    pair, joint = (
        limit_bounds(disc(2, coulomb=0.1, associated=associated)) for associated in (False, True)
    )
    assert joint.strict
    assert joint.upper.value == pytest.approx(pair.upper.value, rel=1e-6)
    assert 1.02 * (pair.lower.value or 0.0) < (joint.lower.value or 0.0)


@pytest.mark.parametrize("associated", [False, True])
def test_the_file_says_which_it_is(shared_tmp_path: Path, associated: bool) -> None:
    """The lower half has the friction of an associated joint, and no friction of other joints."""
    bounds = limit_bounds(between_platens(2, coulomb=0.1, associated=associated))
    results = ResultFolder(COMM, shared_tmp_path)
    write_proof(results, results.file("bounds.h5"), *proofs(bounds, bounds))
    found = check(results.file("bounds.h5"))
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-9)


def test_levels_are_refused() -> None:
    words = ["'lower_top'", "associated", "control = 'bounds'"]
    assert_refused(lambda: Newton(between_platens(2, coulomb=0.1, associated=True)), words)


@pytest.mark.serial
def test_friction_that_parts_nothing_is_refused() -> None:
    words = ["associated = true", "coulomb"]
    assert_refused(lambda: Contact("a", "b", tresca=1.0, associated=True), words)
    assert_refused(lambda: Plane("a", (0.0, 0.0), (0.0, 1.0), associated=True), words)
