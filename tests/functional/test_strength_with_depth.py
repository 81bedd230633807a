"""Test strip footings on clay whose strength grows with depth, against slip lines.

E. H. Davis and J. R. Booker (Géotechnique 23 (1973), 551) solved the problem by the method of
characteristics. With the depth z, the mean pressure s, the angle θ of the largest pressure from x,
and c = c₀ + ρz,

    ds + 2c dθ − ρ dx = 0  along the directions θ + 45°,
    ds − 2c dθ + ρ dx = 0  along the directions θ − 45°.

Beside the footing s = c and θ = 0. Under a smooth footing θ = 90°, and the footing carries s + c₀.

Under a rough footing, the slip lines of the fan at its edge pass below the footing to the middle,
where θ = 90°. The ground above the last of these slip lines moves with the footing. The fan can
turn at most to θ = 135°, where slip lines are tangential to the footing. If this is not enough, the
ground slips along the outer part of the footing, and the last slip line begins where the slip ends
(C. M. Martin, IACMAG 2005).
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scipy.optimize import fsolve

from meshes.strip_footing import write_strip_footing
from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Pressure,
    Problem,
    ResultFolder,
    Support,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import adaptive_bounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.materials import Material, Tresca
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.spatial_fields import Formula, Strength
from tests.models import Read


def crossing(first: Floats, second: Floats, rho: float) -> Floats:
    """Return (x, z, s, θ) where lines at θ + 45° and at θ − 45° cross, for c₀ = 1.

    Args:
        first: A point (x, z, s, θ) of the one.
        second: A point of the other.
        rho: ρ.
    """
    x, z, theta = *first[:2], (first[3] + second[3]) / 2
    s = first[2]
    for _ in range(50):
        a, b = (first[3] + theta) / 2 + math.pi / 4, (second[3] + theta) / 2 - math.pi / 4
        along = np.array([[math.cos(a), -math.cos(b)], [math.sin(a), -math.sin(b)]])
        x, z = first[:2] + np.linalg.solve(along, second[:2] - first[:2])[0] * along[:, 0]
        c, d = 2 + rho * (first[1] + z), 2 + rho * (second[1] + z)
        turned = first[2] - second[2] + rho * (2 * x - first[0] - second[0])
        before, theta = theta, (turned + c * first[3] + d * second[3]) / (c + d)
        s = first[2] - c * (theta - first[3]) + rho * (x - first[0])
        if abs(theta - before) < 1e-13:
            break
    return np.array([x, z, s, theta])


def under(point: Floats, rho: float, theta: float = math.pi / 2) -> Floats:
    """Return the end on the footing, with its θ, of the line at θ − 45° through a point."""
    along = (point[3] + theta) / 2 - math.pi / 4
    x = point[0] - point[1] / math.tan(along)
    c = 2 + rho * point[1]
    return np.array([x, 0.0, point[2] + c * (theta - point[3]) - rho * (x - point[0]), theta])


def bearing(rho: float, extent: float, n: int) -> tuple[float, float]:
    """Return where the slip line net ends on the footing, and the force on the footing beyond.

    Args:
        rho: ρ of c = 1 + ρz; the edge of the footing is at x = 1.
        extent: Depth of the net beside the footing.
        n: Lines of each kind.
    """
    line = [np.array([1 + t, t, 1 + rho * t, 0.0]) for t in np.linspace(0.0, extent, n + 1)]
    for theta in np.linspace(0.0, math.pi / 2, n + 1)[1:]:
        turned = [np.array([1.0, 0.0, 1 + 2 * theta, theta])]
        for point in line[1:]:
            turned.append(crossing(turned[-1], point, rho))
        line = turned
    base = [line[0]]
    while len(line) > 1:
        base.append(under(line[1], rho))
        turned = [base[-1]]
        for point in line[2:]:
            turned.append(crossing(turned[-1], point, rho))
        line = turned
    x, pressure = np.array(base)[:, 0], np.array(base)[:, 2] + 1
    return float(x[-1]), float(((pressure[1:] + pressure[:-1]) / 2) @ (x[:-1] - x[1:]))


def exact(rho: float, n: int) -> float:
    """Return the force on half a footing whose net ends in the middle, by the secant method."""
    before, now = 0.3, 0.2
    end, _ = bearing(rho, before, n)
    for _ in range(12):
        next_end, force = bearing(rho, now, n)
        if abs(next_end) < 1e-9:
            return force
        before, now = now, now - next_end * (now - before) / (next_end - end)
        end = next_end
    raise AssertionError(f"no net of slip lines for rho = {rho}")


def last_line(rho: float, at: Floats, to: float, slips: int, n: int) -> tuple[Floats, Floats]:
    """Return the points of the last slip line below a rough footing, and the points of slip.

    Args:
        rho: ρ.
        at: Depths of the lines of the other kind beside the footing, the first one 0.
        to: θ to which the fan at the edge turns.
        slips: Number of these lines that end on the footing.
        n: Steps of the fan.
    """
    line = [np.array([1 + t, t, 1 + rho * t, 0.0]) for t in at]
    for theta in np.linspace(0.0, to, n + 1)[1:]:
        turned = [np.array([1.0, 0.0, 1 + 2 * theta, theta])]
        for point in line[1:]:
            turned.append(crossing(turned[-1], point, rho))
        line = turned
    base = [line[0]]
    for _ in range(slips):
        base.append(under(line[1], rho, to))
        turned = [base[-1]]
        for point in line[2:]:
            turned.append(crossing(turned[-1], point, rho))
        line = turned
    return np.array(line), np.array(base)


def rough(rho: float, n: int) -> float:
    """Return the force that half of a rough footing carries.

    Args:
        rho: ρ > 0 of c = 1 + ρz; the edge of the footing is at x = 1.
        n: Lines of each kind.
    """
    most = 3 * math.pi / 4

    def sticking(unknown: Floats) -> tuple[Floats, Floats]:
        return last_line(rho, unknown[1] * np.linspace(0.0, 1.0, n + 1), unknown[0], 0, n)

    def slipping(unknown: Floats) -> tuple[Floats, Floats]:
        first, extent = unknown
        steps = np.linspace(0.0, 1.0, n + 1)
        at = np.concatenate([first * steps, first + (extent - first) * steps[1:]])
        return last_line(rho, at, most, n, n)

    def missed(of: Callable[[Floats], tuple[Floats, Floats]]) -> Callable[[Floats], list[float]]:
        def ends(unknown: Floats) -> list[float]:
            x, _, _, theta = of(unknown)[0][-1]
            return [x, theta - math.pi / 2]

        return ends

    extent = 1 / (2.16 + 0.368 * rho)  # approximately, like the rest of the initial guess
    guess = [2.2, 0.6] if rho < 1 else [(1 - 0.8 / rho) * extent, extent]
    of = sticking if rho < 1 else slipping
    unknown, _, found, why = fsolve(missed(of), guess, full_output=True)
    assert found == 1, why
    assert (unknown[0] <= most) if of is sticking else (0 < unknown[0] < unknown[1])
    line, base = of(unknown)
    c, (x, z, s, theta) = 1 + rho * line[:, 1], line.T
    across, along = s - c * np.cos(2 * theta), c * np.sin(2 * theta)  # pressure along z, and shear
    below = np.diff(z) @ _means(along) - np.diff(x) @ _means(across)
    return float(below - np.diff(base[:, 0]) @ _means(base[:, 2]))


def _means(values: Floats) -> Floats:
    return np.asarray((values[1:] + values[:-1]) / 2)


SHAPES = {
    0.0: {"width": 3.0, "depth": 1.5, "size": 0.4, "grading": 3.0},
    0.5: {"width": 2.4, "depth": 1.0, "size": 0.6, "grading": 1.0},
    2.5: {"width": 2.4, "depth": 1.0, "size": 0.6, "grading": 1.0},
    10.0: {"width": 1.8, "depth": 0.6, "size": 0.3, "grading": 1.0},
}
"""First meshes by ρ. Mechanisms are smaller if the strength grows faster."""


def footing(
    read: Read, rho: float, shape: Mapping[str, float], tresca: float | None = None
) -> Problem:
    """Return half a footing of width 2 on clay with c₀ = 1, loaded by a stiff punch in contact.

    A smooth punch has no friction. The contact of a rough punch has the strength c₀ of the surface:
    with a continuous velocity, slip would need thin cells.
    """
    mesh = read(write_strip_footing, punch=True, **shape)
    materials: dict[str, Material] = {
        "ground": Tresca(1e4, 0.3, Formula(f"1 - {rho}*y")),
        "punch": Elastic(1e6, 0.3),
    }
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    contact = Contact("ground_footing", "punch_footing", tresca=tresca)
    return Problem(mesh, materials, supports, [Pressure("top", 1.0)], [contact], degree=2)


def test_slip_lines_of_constant_strength() -> None:
    """For constant strength they are Prandtl's slip lines."""
    assert exact(0.0, 4) == pytest.approx(2 + math.pi, rel=1e-9)


def test_slip_lines_below_a_rough_footing_converge() -> None:
    """Twice as many lines leave a quarter of the error.

    The ground sticks for ρ = 1, and slips for 5.
    """
    for rho in (0.5, 2.5):
        coarse, middle, fine = (rough(rho, n) for n in (3, 6, 12))
        assert (middle - coarse) / (fine - middle) == pytest.approx(4.0, rel=0.1)
        assert fine > exact(rho, 12)


@pytest.mark.parametrize(("tresca", "solved"), [(None, exact), (1.0, rough)])
def test_a_footing_on_a_coarse_mesh(
    read: Read, tresca: float | None, solved: Callable[[float, int], float]
) -> None:
    bounds = limit_bounds(footing(read, 2.5, SHAPES[0.0], tresca), 1e-4)
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None
    net = 2e-3  # error of a net with six lines
    assert low <= solved(2.5, 6) * (1 + net)
    assert solved(2.5, 6) * (1 - net) <= high
    assert high / low < 1.25


def test_a_cut_in_constant_cohesion_is_the_limit_of_strength_that_grows(read: Read) -> None:
    """Both bounds on one mesh grow with ρ, and tend to the values for ρ = 0 within 1e-10."""
    ground = read(write_vertical_cut, size=0.5)
    supports = [Support("bottom"), Support("sides", "x")]

    def both(cohesion: Strength) -> Floats:
        clay = {"ground": Tresca(1e4, 0.3, cohesion)}
        weight = [BodyForce("ground", (0.0, -1.0))]
        found = limit_bounds(Problem(ground, clay, supports, weight, degree=2), 1e-3)
        assert found.strict
        return np.array([found.lower.value, found.upper.value], dtype=np.float64)

    constant = both(1.0)
    for rho, most in ((1e-6, 2e-6), (1e-13, 1e-10)):  # the ground is 2 deep
        more = both(Formula(f"1 + {rho}*(1 - y)")) / constant - 1
        assert (np.abs(more) < most).all()
        assert rho < 1e-6 or (more > 0.5 * rho).all()


@pytest.mark.long
@pytest.mark.parametrize("rho", SHAPES)
@pytest.mark.parametrize("tresca", [None, 1.0])
def test_a_footing_between_narrow_bounds(
    read: Read, shared_tmp_path: Path, rho: float, tresca: float | None
) -> None:
    found = adaptive_bounds(footing(read, rho, SHAPES[rho], tresca), Adaptation(0.002, 4000))
    assert found.lower.strict and found.upper.strict
    low, high = found.lower.value, found.upper.value
    assert low is not None and high is not None
    value = rough(rho, 40) if tresca and rho else exact(rho, 40)
    net = 4e-4 if tresca else 1e-4  # error of a net with forty lines
    assert low <= value * (1 + net)
    assert value * (1 - net) <= high
    assert high - low <= 3e-3 * high
    folder = ResultFolder(MPI.COMM_WORLD, shared_tmp_path, force=True)
    write_proof(folder, folder.file("bounds.h5"), *proofs(found.low, found.high))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())
