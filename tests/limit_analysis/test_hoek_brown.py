"""Test Hoek–Brown rock: limit loads, strict bounds, their proofs, and a strip footing."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from perfplast_fenicsx import (
    HoekBrown,
    InputError,
    Newton,
    Pressure,
    Problem,
    Support,
    VonMises,
    limit_load,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import Adaptation, adaptive_bounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.safety_factor import factor_of_safety
from perfplast_fenicsx.limit_analysis.conic.conic_solver import conic_solver
from perfplast_fenicsx.limit_analysis.conic.parabolas import Parabola, Parabolas
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.problem.problem import variant
from tests.limit_analysis.test_principal_cones import COMM, assert_proven
from tests.limit_analysis.test_static_bound import rectangle
from tests.limit_analysis.test_tension_cut_off import block

ROCK = HoekBrown(1e4, 0.25, compressive_strength=20.0, m_b=1.5, s=0.01)
WEAK = HoekBrown(1e4, 0.25, compressive_strength=30.0, m_b=0.6, s=1e-4)


def compressed(rock: HoekBrown, lateral: float) -> float:
    """Return the strength by the published criterion, with pressure positive."""
    ci = rock.compressive_strength
    return lateral + math.sqrt(rock.m_b * ci * lateral + rock.s * ci**2)


def pulled(rock: HoekBrown) -> float:
    """Return σ₁ for σ₃ = 0: σ₁² = σ_ci (sσ_ci − mσ₁)."""
    m, ci = rock.m_b, rock.compressive_strength
    return ci / 2 * (math.sqrt(m**2 + 4 * rock.s) - m)


@pytest.mark.parametrize(
    ("rock", "sign", "lateral", "exact"),
    [
        (ROCK, 1.0, 0.0, compressed(ROCK, 0.0)),
        (ROCK, 1.0, 3.0, compressed(ROCK, 3.0)),
        (ROCK, -1.0, 0.0, pulled(ROCK)),
        (WEAK, 1.0, 10.0, compressed(WEAK, 10.0)),
        (WEAK, 1.0, 0.0, compressed(WEAK, 0.0)),
    ],
)
def test_a_block(
    shared_tmp_path: Path, rock: HoekBrown, sign: float, lateral: float, exact: float
) -> None:
    bounds = limit_bounds(block(rock, sign, lateral))
    assert bounds.strict
    assert bounds.lower.value is not None and bounds.upper.value is not None
    assert bounds.lower.value <= exact * (1 + 1e-9)
    assert exact <= bounds.upper.value * (1 + 1e-9)
    assert bounds.upper.value - bounds.lower.value <= 1e-3 * exact
    assert_proven(bounds, shared_tmp_path)


def bearing_strength(rock: HoekBrown) -> float:
    """Return the strength of a strip footing on weightless rock, from the fan of slip lines.

    With R(p) and sin φ = −dR/dp the mean pressure grows by 2R/cos φ per angle. For the parabola the
    angle is the change of (cot φ + ln cot φ/2)/2 (A. Serrano, C. Olalla, Int. J. Rock Mech. Min.
    Sci. 31 (1994), 93).
    """

    def turned(phi: float) -> float:
        return (1 / math.tan(phi) - math.log(math.tan(phi / 2))) / 2

    k, ci = rock.curvature, rock.compressive_strength
    first = math.asin(k / (k + ci * math.sqrt(rock.s)))  # σ₁ = 0 below the free surface
    last = brentq(lambda phi: turned(phi) - turned(first) - math.pi / 2, 1e-9, first, xtol=1e-15)
    pressure = k / 4 / math.sin(last) ** 2 - k / 4 - rock.tension
    return float(pressure + k / 2 * (1 / math.sin(last) - 1))


def footing(rock: HoekBrown, cells: tuple[int, int] = (8, 5)) -> Problem:
    """Return half a strip of width 2 on rock 5 deep and 8 wide."""
    surfaces: dict[str, Any] = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 8 - 1e-9,
        "base": lambda x: x[1] < 1e-9,
        "strip": lambda x: (x[1] > 5 - 1e-9) & (x[0] < 1 + 1e-9),
    }
    mesh = rectangle(cells, (8.0, 5.0), {"rock": lambda x: x[1] < 9}, surfaces)
    supports = [Support("left", "x"), Support("right"), Support("base")]
    return Problem(mesh, {"rock": rock}, supports, [Pressure("strip", 1.0)], degree=2)


def test_both_solvers_find_the_limit_load_of_a_footing() -> None:
    pytest.importorskip("clarabel", reason="the conic solver Clarabel is not installed")
    if COMM.size > 1:
        pytest.skip("matrices are made on one rank")
    found = []
    for solver in ("interior-point", "clarabel"):
        with conic_solver(solver):
            found.append(interior_point(footing(ROCK), 1e-6))
    assert found[0].upper == pytest.approx(found[1].upper, rel=1e-6)
    assert found[0].lower == pytest.approx(found[1].lower, rel=1e-6)
    upper = found[0].upper
    assert upper is not None and upper > bearing_strength(ROCK)  # coarse cells are too strong


@pytest.mark.long
@pytest.mark.parametrize("rock", [ROCK, WEAK])
def test_a_strip_footing(shared_tmp_path: Path, rock: HoekBrown) -> None:
    """The bracket contains the slip-line solution, and the checker proves it."""
    meshes = adaptive_bounds(footing(rock), Adaptation(0.03, cells=2500))
    lower, upper = meshes.lower.value, meshes.upper.value
    assert lower is not None and upper is not None
    assert lower < bearing_strength(rock) < upper < 1.03 * lower


def test_a_level_near_the_limit_load() -> None:
    problem = footing(ROCK, (8, 3))
    limit = limit_load(problem, method="interior-point").lower
    assert limit is not None
    below = Newton(problem).solve(0.98 * limit)
    assert below.report.converged and below.report.duality_gap < 1e-12


def test_support_function_is_that_of_samples() -> None:
    of = Parabola(ROCK.curvature, ROCK.tension)
    sets = Parabolas(of, np.arange(1))
    radii = np.geomspace(1e-6, 1e4, 40_000)
    means = of.tension - radii - radii**2 / of.curvature
    for mean, radius in zip(means[::4000], radii[::4000], strict=True):
        stress = np.array([mean]), np.array([[math.sqrt(2) * radius, 0.0]])
        assert sets.ratios(*stress) == pytest.approx(1.0, rel=1e-9)
    for growth in (0.02, 0.3, 0.9, 1.5):
        power = sets.powers(np.array([growth]), np.array([[1 / math.sqrt(2), 0.0]]))[0]
        sampled = max(float((means * growth + radii).max()), of.tension * growth)
        assert power == pytest.approx(sampled, rel=1e-6)
    little = np.array([1e-3]), np.array([[1 / math.sqrt(2), 0.0]])
    assert sets.lacking(*little) == pytest.approx(0.01 - 1e-3)


def test_space_sheets_and_factors_of_safety_are_refused() -> None:
    cube = stacked_blocks(COMM, 1)
    steel, supports = VonMises(2e5, 0.3, 100.0), [Support("bottom")]
    with pytest.raises(InputError, match="'lower', HoekBrown, is for plane strain only"):
        Problem(cube, {"lower": ROCK, "upper": steel}, supports, [Pressure("top", 1.0)])
    problem = block(ROCK)
    stays = Pressure("top", 1.0, constant=True)
    with pytest.raises(InputError, match="no strength that F can divide"):
        factor_of_safety(variant(problem, loads=[stays]))
    ring = problem.tagged_mesh.turned()
    with pytest.raises(InputError, match="is for plane strain only"):
        Problem(ring, {"block": ROCK}, [Support("y0", "y")], [Pressure("top", 1.0)])
