"""Smooth strip footings on clay whose strength grows with depth, beside slip lines.

E. H. Davis and J. R. Booker (Géotechnique 23 (1973), 551) solved it by characteristics. With the
depth z, the mean pressure s and the angle θ of the largest pressure from x, and c = c₀ + ρz,

    ds + 2c dθ − ρ dx = 0  along the directions θ + 45°,
    ds − 2c dθ + ρ dx = 0  along the directions θ − 45°.

Beside the footing s = c and θ = 0; under it θ = 90°, and it bears s + c₀.
"""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import Contact, Elastic, Pressure, Problem, ResultFolder, Support
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.io.results.proof_file import proofs, write_proof
from perfplast_fenicsx.limit_analysis import adaptive_bounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.materials import Material, Tresca
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.spatial_fields import Formula
from tests.models import Read


def crossing(first: Floats, second: Floats, rho: float) -> Floats:
    """Return (x, z, s, θ) where a line at θ + 45° and one at θ − 45° cross, for c₀ = 1.

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


def under(point: Floats, rho: float) -> Floats:
    """Return the end on the footing of the line at θ − 45° through a point."""
    theta = math.pi / 2
    along = (point[3] + theta) / 2 - math.pi / 4
    x = point[0] - point[1] / math.tan(along)
    c = 2 + rho * point[1]
    return np.array([x, 0.0, point[2] + c * (theta - point[3]) - rho * (x - point[0]), theta])


def bearing(rho: float, extent: float, n: int) -> tuple[float, float]:
    """Return where the net of slip lines ends on the footing, and the force on it from there on.

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
    """Return what the half of the footing bears whose net ends in the middle, by secants."""
    before, now = 0.3, 0.2
    end, _ = bearing(rho, before, n)
    for _ in range(12):
        next_end, force = bearing(rho, now, n)
        if abs(next_end) < 1e-9:
            return force
        before, now = now, now - next_end * (now - before) / (next_end - end)
        end = next_end
    raise AssertionError(f"no net of slip lines for rho = {rho}")


def footing(read: Read, rho: float, size: float) -> Problem:
    """Return half a footing of width 2 on clay with c₀ = 1, by a stiff punch without friction."""
    mesh = read(write_strip_footing, punch=True, width=3.0, depth=1.5, size=size, grading=3.0)
    materials: dict[str, Material] = {
        "ground": Tresca(1e4, 0.3, Formula(f"1 - {rho}*y")),
        "punch": Elastic(1e6, 0.3),
    }
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    contact = Contact("ground_footing", "punch_footing")
    return Problem(mesh, materials, supports, [Pressure("top", 1.0)], [contact], degree=2)


def test_slip_lines_of_constant_strength() -> None:
    """They are those of Prandtl."""
    assert exact(0.0, 4) == pytest.approx(2 + math.pi, rel=1e-9)


def test_a_footing_on_a_coarse_mesh(read: Read) -> None:
    bounds = limit_bounds(footing(read, 2.5, 0.4), 1e-4)
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None
    rough = 2e-3  # of a net of six lines
    assert low <= exact(2.5, 6) * (1 + rough)
    assert exact(2.5, 6) * (1 - rough) <= high
    assert high / low < 1.25


@pytest.mark.long
@pytest.mark.parametrize(("rho", "width"), [(0.0, 3e-3), (0.5, 3e-3), (2.5, 3.1e-3), (10.0, 4e-3)])
def test_a_footing_between_narrow_bounds(
    read: Read, shared_tmp_path: Path, rho: float, width: float
) -> None:
    found = adaptive_bounds(footing(read, rho, 0.4), Adaptation(0.003, 4000))
    assert found.lower.strict and found.upper.strict
    low, high = found.lower.value, found.upper.value
    assert low is not None and high is not None
    net = 1e-4  # of a net of forty lines
    assert low <= exact(rho, 40) * (1 + net)
    assert exact(rho, 40) * (1 - net) <= high
    assert high - low <= width * high
    folder = ResultFolder(MPI.COMM_WORLD, shared_tmp_path, force=True)
    write_proof(folder, folder.file("bounds.h5"), *proofs(found.low, found.high))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())
