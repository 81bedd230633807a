"""Test the curve of the strength reduction factor over work, against exact factors."""

from dataclasses import replace

import pytest

from meshes.slope import write_slope
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    InputError,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    strength_path,
)
from perfplast_fenicsx.limit_analysis import interior_point
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import weakened
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.mesh import TaggedMesh
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_rubbing_bounds import COMM
from tests.models import STEEL, Read

WEIGHT = BodyForce("soil", (0.0, -1.0), constant=True)
TOLERANCE = 1e-3


def slope(mesh: TaggedMesh, soil: Material, weight: BodyForce = WEIGHT) -> Problem:
    """Return a slope 2:1, on firm ground at the toe level, with few cells."""
    supports = [Support("bottom"), Support("left", "x")]
    return Problem(mesh, {"soil": soil}, supports, [weight], degree=2)


def times(problem: Problem, factor: float) -> float:
    """Return the factor of the loads that the mesh carries with strengths divided by a factor."""
    found = interior_point(weakened(problem, factor), 1e-5).standing
    assert found is not None
    assert found.lower is not None
    return found.lower


@pytest.mark.long
@pytest.mark.mpi2
def test_it_ends_at_the_factor_of_its_mesh(read: Read) -> None:
    """Each point is in equilibrium; the mesh is stable there, and hardly beyond the last point."""
    ground = DruckerPrager(1e4, 0.3, 0.05, 20.0, "plane-strain")
    problem = slope(read(write_slope, size=0.3), ground)
    found = strength_path(problem, TOLERANCE)
    assert found.levelled_off
    assert found.factor is not None
    factors = [point.factor for point in found.points]
    assert factors == sorted(factors)
    assert max(abs(point.duality_gap) for point in found.points) < 1e-5
    assert (
        times(problem, found.factor * (1 - TOLERANCE))
        > 1
        > times(problem, found.factor * (1 + TOLERANCE))
    )
    assert "an estimate from a mesh, not a bound" in found.in_words()


@pytest.mark.mpi2
def test_without_friction_it_ends_at_the_limit_load(read: Read) -> None:
    problem = slope(read(write_slope, size=0.3), VonMises(1e4, 0.3, 0.3))
    found = strength_path(problem, TOLERANCE)
    assert found.factor == pytest.approx(times(problem, 1.0), rel=1e-4)


@pytest.mark.long
def test_davis_ground_is_reduced_by_its_own_rule(read: Read) -> None:
    ground = MohrCoulomb(1e4, 0.3, 0.05, 20.0, dilatancy_angle=0.0, nonassociated="davis-b")
    problem = slope(read(write_slope, size=0.3), ground)
    factor = strength_path(problem, TOLERANCE).factor
    assert factor is not None
    assert times(problem, factor * (1 - TOLERANCE)) > 1 > times(problem, factor * (1 + TOLERANCE))


@pytest.mark.long(but=["2.0-None"])
@pytest.mark.parametrize(("tresca", "coulomb"), [(2.0, None), (0.5, 0.1)])
def test_friction_is_divided_too(tresca: float, coulomb: float | None) -> None:
    """A block under the pressure 10 is pushed by the traction 1, and slides at c + 10 μ = F."""
    problem = Problem(
        blocks_apart(COMM, (2, 2), (2, 2), moved_by=0.0),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [Pressure("top", 10.0, constant=True), Traction("top", (1.0, 0.0), constant=True)],
        [Contact("lower_top", "upper_bottom", tresca=tresca, coulomb=coulomb)],
        degree=2,
    )
    exact = tresca + 10 * (coulomb or 0.0)
    assert strength_path(problem, TOLERANCE).factor == pytest.approx(exact, rel=TOLERANCE)


def test_what_has_no_curve_is_one_sentence(read: Read) -> None:
    mesh = read(write_slope, size=0.3)
    ground = MohrCoulomb(1e4, 0.3, 0.05, 20.0, dilatancy_angle=5.0, nonassociated="radenkovic")
    with pytest.raises(InputError, match="no curve of F over work"):
        strength_path(slope(mesh, ground))
    with pytest.raises(InputError, match="grows"):
        strength_path(slope(mesh, STEEL, replace(WEIGHT, constant=False)))
    below = MohrCoulomb(1e4, 0.3, 0.05, 20.0, tensile_strength=0.13)
    assert 0.13 < 0.05 / 0.36397  # the apex limits the load at once
    assert strength_path(slope(mesh, below), 0.05).factor is not None
    above = replace(below, tensile_strength=0.14)
    with pytest.raises(InputError, match="below the apex of its cone"):
        strength_path(slope(mesh, above))
