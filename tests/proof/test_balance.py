"""Test that the imbalance of a stress reduces its bound by as much as it can cost.

The bodies are single cells with known limits: strips, columns and blocks in contact.
"""

from collections.abc import Callable
from fractions import Fraction
from itertools import combinations, permutations

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof.balance import SIZE, VOLUME
from perfplast_fenicsx.proof.balls import Balls, contracted, crossed
from perfplast_fenicsx.proof.checker import check_lower
from perfplast_fenicsx.proof.plain_arrays import ProofError

pytestmark = pytest.mark.serial

Arrays = dict[str, npt.NDArray]
RADIUS = np.sqrt(2.0)
"""Yield radius of a shear strength of 1."""


def strip(length: float, cells: int, height: float = 1.0) -> Arrays:
    """Return a strip of squares of two cells, held at its left end, unloaded and without stress.

    Args:
        length: Along x.
        cells: How many squares.
        height: Along y.
    """
    x = np.linspace(0.0, length, cells + 1)
    lower, upper = (np.column_stack([x, np.full(len(x), y)]) for y in (0.0, height))
    n = cells + 1
    squares = [(i, i + 1, n + i + 1, n + i) for i in range(cells)]
    triangles = [t for a, b, c, e in squares for t in ((a, b, c), (a, c, e))]
    facets = [(i, i + 1) for i in range(cells)] + [(n + i, n + i + 1) for i in range(cells)]
    facets += [(0, n), (cells, n + cells)]
    held = np.zeros((len(facets), 2), dtype=np.uint8)
    held[-2] = 1
    deviator = np.array([[0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    count = len(triangles)
    return {
        "vertices": np.concatenate([lower, upper]),
        "cells": np.array(triangles),
        "cone": np.zeros(count, dtype=int),
        "cone_bound": np.array([RADIUS]),
        "cone_slope": np.zeros((1, 3)),
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((count, 2)),
        "facets": np.array(facets),
        "surface": np.zeros(len(facets), dtype=int),
        "held": held,
        "traction": np.zeros((len(facets), 2, 2)),
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 2)),
        "stress": np.zeros((count, 3, 2, 2)),
        "bound": np.array(1.0),
    }


def cantilever(length: float, cells: int) -> Arrays:
    """Return a strip with a shear traction at its free end, and zero stress."""
    them = strip(length, cells)
    them["traction"][-1, :, 1] = -1.0
    return them


def limit(length: float) -> float:
    """Return an upper bound on the end shear of a strip with a hinge at its root: 2k/4 over it."""
    return 0.5 / length


def pressed(them: Arrays, pressure: float) -> None:
    """Return constant pressure on all sides, with its stress, and no stress for the load."""
    x = them["vertices"][them["facets"]]
    along = x[:, 1] - x[:, 0]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    middle = x.mean(axis=1) - them["vertices"].mean(axis=0)
    normals *= np.sign(np.einsum("fi,fi->f", normals, middle))[:, None]
    free = ~np.asarray(them["held"].any(axis=1, keepdims=True))
    pushes = np.where(free, -pressure * normals, 0.0)
    them["constant_traction"] = np.repeat(pushes[:, None], 2, axis=1)
    them["stress"] = them["stress"] - pressure * np.eye(2)


@pytest.mark.parametrize("slenderness", [10.0, 1e3, 1e5, 1e6])
@pytest.mark.parametrize("share", [1e-6, 1e-2, 0.9, 1.1, 90.0])
def test_loads_far_below_the_strength(slenderness: float, share: float) -> None:
    """No claim above the limit is proven, even if both are far below the strength (B4)."""
    them = cantilever(slenderness, 8)
    pressed(them, 1.5)
    them["bound"] = np.array(share * limit(slenderness))
    found = check_lower(them)
    assert found.reached is None or found.reached <= limit(slenderness)
    if share > 1.0:
        assert found.faults


@pytest.mark.parametrize("pressure", [0.0, 1.5, 1e3])
@pytest.mark.parametrize("slenderness", [1.0, 100.0])
def test_a_body_without_the_stress_of_its_load(slenderness: float, pressure: float) -> None:
    """The checker finds a stress that balances the load; the bound is small, but not zero."""
    them = cantilever(slenderness, 8)
    if pressure:
        pressed(them, pressure)
        them["bound"] = np.array(1e-4 * limit(slenderness) / slenderness)
    found = check_lower(them)
    assert found.reached is not None
    assert 0.0 < found.reached <= limit(slenderness)


def turned(them: Arrays) -> None:
    """The load acts along the strip as a tension."""
    them["traction"] = them["traction"][..., ::-1] * -1.0


def sheared(them: Arrays) -> None:
    """One cell has a shear stress of the size of the load."""
    them["stress"][3, :, 0, 1] += 1e-3
    them["stress"][3, :, 1, 0] += 1e-3


def moved_vertex(them: Arrays) -> None:
    """A vertex moves by the rounding of a mesh, without a change of stress."""
    them["vertices"][3] += 3e-12


def heavy(them: Arrays) -> None:
    """A weight replaces the load at the end."""
    them["traction"] *= 0.0
    them["body_force"][:, 1] = -1.0


def heavy_at_the_end(them: Arrays) -> None:
    """Only the last cell has a weight."""
    them["traction"] *= 0.0
    them["body_force"][-1, 1] = -1.0


def twisting(them: Arrays) -> None:
    """A linear traction has a moment as resultant."""
    them["traction"][-1] = [[-1.0, 0.0], [1.0, 0.0]]


def asymmetric_load(them: Arrays) -> None:
    """A shear acts on one side only."""
    them["traction"][:8, :, 0] = 1.0


def wet(them: Arrays) -> None:
    """A pore pressure in one cell pushes its neighbours."""
    them["pore_pressure"] = np.zeros((len(them["cells"]), 3))
    them["pore_pressure"][5] = 1.0


def half_a_stress(them: Arrays) -> None:
    """The stress along the strip balances half of the load."""
    turned(them)
    them["stress"][..., 0, 0] += 0.5


def nothing_more(them: Arrays) -> None:
    """The load acts at the end."""


VARIANTS: dict[str, Callable[[Arrays], None]] = {
    of.__name__: of
    for of in (
        *(nothing_more, turned, sheared, moved_vertex, heavy, heavy_at_the_end, twisting),
        *(asymmetric_load, wet, half_a_stress),
    )
}


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("claim", [1e-3, 1e6])
def test_what_is_proven_does_not_exceed_what_a_mechanism_allows(name: str, claim: float) -> None:
    """The ten variants carry at most k times the section over the load, or its moment."""
    them = strip(4.0, 8)
    them["traction"][-1, :, 1] = -1.0
    VARIANTS[name](them)
    them["stress"] *= claim
    them["bound"] = np.array(claim)
    found = check_lower(them)
    areas = np.full(len(them["facets"]), 0.5)
    areas[-2:] = 1.0
    push = areas @ np.abs(them["traction"]).mean(axis=1)
    weight = 0.25 * np.abs(them["body_force"]).sum(axis=0)
    resultant = push + weight
    assert found.reached is not None
    assert found.reached > 0.0
    # The mechanism is shear across the root, or tension along it; pore pressure or moment bends.
    if resultant[1] > 0:
        assert found.reached <= 1.0 / resultant[1]
    elif resultant[0] > 0:
        assert found.reached <= 2.0 / resultant[0] * 2.0
    assert found.faults or claim <= found.reached * (1 + 1e-7)


def test_nothing_holds_a_body() -> None:
    """Without supports no stress balances even a small load, and no bound remains."""
    for size in (1.0, 1e-12, 1e-30):
        them = cantilever(2.0, 4)
        them["held"][:] = 0
        them["traction"] *= size
        found = check_lower(them)
        assert found.reached is None
        assert "neither supports nor contact" in "; ".join(found.faults)


def test_rollers_hold_what_they_hold() -> None:
    """A column on rollers is stable, but no force along the rollers is carried."""
    them = strip(2.0, 4)
    them["held"][:] = 0
    them["held"][:4, 1] = 1
    them["traction"][4:8, :, 1] = -1.0
    them["stress"][..., 1, 1] = -1.0
    assert check_lower(them).reached == pytest.approx(1.0, rel=1e-9)
    them["traction"][4:8, :, 0] = 1e-14
    assert check_lower(them).reached is None


def test_a_small_gap_of_balance_costs_little_and_is_told() -> None:
    """A load that exceeds the stress by 1e-6 lowers the bound by 1e-6 times the size."""
    them = strip(2.0, 4)
    them["traction"][-1, :, 0] = 1.0
    them["stress"][..., 0, 0] = 2.0
    them["bound"] = np.array(2.0)
    whole = check_lower(them)
    assert not whole.faults
    them["stress"] = them["stress"] * (1 - 1e-6)
    less = check_lower(them)
    assert less.faults[0].startswith("only 1.999")
    assert less.reached is not None
    assert 1e-7 < 1 - less.reached / 2.0 < 1e-4
    them["factor"], them["bound"] = them["bound"], np.array(less.reached)
    assert check_lower(them).proven == less.reached


def row_of_cubes(count: int) -> Arrays:
    """Return vertices, cells and facets of a row of unit cubes with six tetrahedra each."""
    places: dict[tuple[int, ...], int] = {}
    cells = []
    for first in range(count):
        for axes in permutations(range(3)):
            place = [first, 0, 0]
            corners = [places.setdefault(tuple(place), len(places))]
            for axis in axes:
                place[axis] += 1
                corners.append(places.setdefault(tuple(place), len(places)))
            cells.append(corners)
    sides = [tuple(sorted(set(cell) - {one})) for cell in cells for one in cell]
    facets = [side for side in dict.fromkeys(sides) if sides.count(side) == 1]
    return {
        "vertices": np.array(list(places), dtype=float),
        "cells": np.array(cells),
        "facets": np.array(facets),
    }


def cubes(edge: float, strength: float) -> Arrays:
    """Return three cubes in a row without stress, which two elastic cells at the ends pull apart.

    Args:
        edge: Edge of the cubes.
        strength: Shear strength of the cube in the middle; the others are elastic.
    """
    row = row_of_cubes(3)
    cells, facets = row["cells"], row["facets"]
    force = np.zeros((len(cells), 3))
    force[0, 0], force[12, 0] = -strength / edge, strength / edge
    deviator = np.eye(6)
    deviator[:3, :3] -= 1 / 3
    return {
        "vertices": edge * row["vertices"],
        "cells": cells,
        "cone": np.where(np.arange(len(cells)) // 6 == 1, 0, -1),
        "cone_bound": np.array([RADIUS * strength]),
        "cone_slope": np.zeros((1, 6)),
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": force,
        "facets": facets,
        "surface": np.zeros(len(facets), dtype=int),
        "held": np.zeros((len(facets), 3), dtype=np.uint8),
        "traction": np.zeros((len(facets), 3, 3)),
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 3)),
        "stress": np.zeros((len(cells), 4, 3, 3)),
        "bound": np.array(16384.0),
    }


@pytest.mark.parametrize(("edge", "strength"), [(1.0, 1.0), (1e-19, 1e-29)])
def test_very_small_forces(edge: float, strength: float) -> None:
    """The factor is below 12 because of a shear plane at 45 degrees, in any unit."""
    reached = check_lower(cubes(edge, strength)).reached
    assert reached is None or reached < 12


def test_forces_whose_squares_underflow() -> None:
    with pytest.raises(ProofError, match="1e-30 to 1e30"):
        check_lower(cubes(2.0**-185, 2.0**-193))
    with pytest.raises(ProofError, match="too small"):
        check_lower(cubes(2.0**-68, 1.0))


def test_a_residual_of_slender_cells_costs_the_square_of_their_slenderness() -> None:
    """The cost is the stress of a bent beam, L/h² times a residual moment, and not more."""
    costs = []
    for slenderness in (1e2, 1e3):
        them = strip(8 * slenderness, 8)
        them["traction"][-1, :, 0] = 1.0
        exact, noise = 2.0, 1e-11
        changes = noise * np.random.default_rng(1).normal(size=them["stress"].shape)
        them["stress"][..., 0, 0] = exact
        them["stress"] += changes + changes.swapaxes(2, 3)
        them["bound"] = np.array(exact)
        reached = check_lower(them).reached
        assert reached is not None
        costs.append(exact / reached - 1)
    assert 50 < costs[1] / costs[0] < 200


@pytest.mark.parametrize("dim", [2, 3])
def test_sizes_of_stresses_on_the_regular_simplex(dim: int) -> None:
    """The test computes the numbers in the argument from conditions on the parts of the simplex."""
    of_facets, of_force = sizes_on(dim)
    assert SIZE[dim][0] * 0.98 <= of_facets <= SIZE[dim][0] * (1 - 1e-3)
    assert SIZE[dim][1] * 0.98 <= of_force <= SIZE[dim][1] * (1 - 1e-3)
    corners = regular(dim)
    volume = abs(np.linalg.det(corners[1:] - corners[0])) / (2 if dim == 2 else 6)
    assert VOLUME[dim] == pytest.approx(volume, rel=1e-12)


def regular(dim: int) -> npt.NDArray:
    """Return the vertices of the regular simplex with unit edges."""
    found = np.zeros((dim + 1, dim))
    for i in range(1, dim + 1):
        found[i] = found[:i].mean(axis=0)
        found[i, i - 1] = np.sqrt(1 - ((found[0] - found[i]) ** 2).sum())
    return found


def sizes_on(dim: int) -> tuple[float, float]:
    """Return the largest stress for unit tractions on a facet, and for a unit force."""
    corners = regular(dim)
    centre = corners.mean(axis=0)
    points = np.vstack([corners, centre])
    parts = [[*(j for j in range(dim + 1) if j != i), dim + 1] for i in range(dim + 1)]
    basis = []
    for i in range(dim):
        for j in range(i, dim):
            one = np.zeros((dim, dim))
            one[i, j] = one[j, i] = 1.0 if i == j else np.sqrt(0.5)
            basis.append(one)
    m, wide = len(basis), dim + 1
    unknowns, given = wide * wide * m, wide * dim * dim + dim

    def area(places: npt.NDArray, away: npt.NDArray) -> npt.NDArray:
        edges = places[1:] - places[0]
        vector = (
            np.array([edges[0][1], -edges[0][0]]) if dim == 2 else np.cross(edges[0], edges[1]) / 2
        )
        return vector if vector @ (places[0] - away) > 0 else -vector

    rows: list[npt.NDArray] = []
    sides: list[npt.NDArray] = []

    def condition(terms: list[tuple[int, int, npt.NDArray]], of: dict[int, float]) -> None:
        for axis in range(dim):
            row, side = np.zeros(unknowns), np.zeros(given)
            for part, vertex, vector in terms:
                first = (part * wide + parts[part].index(vertex)) * m
                row[first : first + m] += [(one @ vector)[axis] for one in basis]
            for number, factor in of.items():
                side[number + axis] = factor
            rows.append(row)
            sides.append(side)

    for s, t in combinations(range(wide), 2):
        shared = [p for p in parts[s] if p in parts[t]]
        vector = area(points[shared], points[next(p for p in parts[s] if p not in shared)])
        for p in shared:
            condition([(s, p, vector), (t, p, -vector)], {})
    for s in range(wide):
        vector = area(points[parts[s][:-1]], centre)
        for k, p in enumerate(parts[s][:-1]):
            condition([(s, p, vector)], {(s * dim + k) * dim: 1.0})
        terms = []
        for p in parts[s]:
            rest = points[[q for q in parts[s] if q != p]]
            terms.append((s, p, -area(rest, points[p]) / dim))
        condition(terms, {given - dim: -1 / wide})
    balance = np.zeros((dim * (dim + 1) // 2, given))
    means = (np.eye(dim) + 1) / (dim * (dim + 1))
    for axis in range(dim):
        balance[axis, axis : given - dim : dim] = 1 / dim
        balance[axis, given - dim + axis] = 1.0
    for number, (i, j) in enumerate(combinations(range(dim), 2), start=dim):
        for s in range(wide):
            arms = means @ (points[parts[s][:-1]] - centre)
            for k in range(dim):
                first = (s * dim + k) * dim
                balance[number, first + j] += arms[k, i]
                balance[number, first + i] -= arms[k, j]
    kept = np.linalg.svd(balance)[2][len(balance) :]
    onto = kept.T @ kept
    left, right = np.array(rows), np.array(sides) @ onto
    found = np.linalg.lstsq(left, right, rcond=None)[0]
    assert np.abs(left @ found - right).max() < 1e-12  # such a stress exists
    stress = found.reshape(wide * wide, m, given)
    of_facets = max(
        sum(
            float(np.linalg.norm(at[:, first : first + dim], 2))
            for first in range(s * dim * dim, (s + 1) * dim * dim, dim)
        )
        for at in stress
        for s in range(wide)
    )
    return of_facets, max(float(np.linalg.norm(at[:, -dim:], 2)) for at in stress)


def test_numbers_of_twice_the_digits_contain_exact_results() -> None:
    """Compare with fractions for numbers of very different size that almost cancel."""

    random = np.random.default_rng(7)
    values = random.normal(size=(200, 6)) * 10.0 ** random.integers(-8, 8, (200, 6))
    values[:, 5] = -values[:, 4]
    values[::3, 0] = 0.0
    one, other = Balls.exact(values[:, :3]), Balls.exact(values[:, 3:])
    found = {
        "sum": one + other,
        "product": (one * other) * (other - one),
        "contracted": contracted(one, other)[:, None],
        "crossed": crossed(one, other),
        "third": one * Balls.part(3),
    }
    for row in range(len(values)):
        a = [Fraction(v) for v in values[row, :3]]
        b = [Fraction(v) for v in values[row, 3:]]
        exact: dict[str, list[Fraction]] = {
            "sum": [x + y for x, y in zip(a, b, strict=True)],
            "product": [x * y * (y - x) for x, y in zip(a, b, strict=True)],
            "contracted": [sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))],
            "crossed": [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))],
            "third": [x / 3 for x in a],
        }
        for name, balls in found.items():
            for k, true in enumerate(exact[name]):
                middle = Fraction(float(balls.mid[row, k])) + Fraction(float(balls.low[row, k]))
                assert abs(true - middle) <= Fraction(float(balls.rad[row, k])), name
    roots = Balls.exact(np.abs(values[:, 1])).root()
    for row in range(len(values)):
        middle = Fraction(float(roots.mid[row])) + Fraction(float(roots.low[row]))
        lost = Fraction(float(roots.rad[row]))
        assert (middle - lost) ** 2 <= Fraction(abs(values[row, 1])) <= (middle + lost) ** 2
    assert all(a.rad.max() <= 1e-25 * np.abs(a.mid).max() for a in found.values())


@pytest.mark.parametrize(("adhesion", "friction"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.3), (0.1, 0.3)])
@pytest.mark.parametrize("claim", [1e-3, 0.05, 0.2, 10.0])
def test_friction_alone_holds_a_body(adhesion: float, friction: float, claim: float) -> None:
    """A strip on a plane, pressed by 1 and pushed along it: at most c + μ is proven."""
    them = strip(2.0, 4)
    them["held"][:] = 0
    them["surface"][:4] = 1
    them["obstacles"], them["obstacle_normals"] = np.array([1]), np.array([[0.0, -1.0]])
    them["obstacle_adhesion"] = np.array([adhesion])
    them["obstacle_friction"] = np.array([friction])
    them["constant_traction"] = np.zeros_like(them["traction"])
    them["constant_traction"][4:8, :, 1] = -1.0
    them["traction"][4:8, :, 0] = 1.0
    them["stress"][..., 1, 1] = -1.0
    them["bound"] = np.array(claim)
    reached = check_lower(them).reached
    assert reached is None or reached <= adhesion + friction
    if claim == 1e-3:
        assert (reached is not None) == (adhesion + friction > 0)
