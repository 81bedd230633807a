"""Test that residuals of bodies of revolution and rigid plates reduce a lower bound.

The bodies are single cells with known limits: cylinders, tubes, and strips with a plate.
"""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof.balance import QUADRATIC
from perfplast_fenicsx.proof.checker import check_lower
from perfplast_fenicsx.proof.rings import PAIRS
from tests.proof.test_balance import RADIUS, regular, strip

pytestmark = pytest.mark.serial

Arrays = dict[str, npt.NDArray]
PULL = np.sqrt(3.0)
"""The largest tension along a cylinder with a shear strength of 1."""


def tube(inner: float, cells: tuple[int, int] = (2, 3)) -> Arrays:
    """Return a tube of outer radius 1 and height 1, held axially at the bottom, without stress."""
    nr, nz = cells
    r, z = np.linspace(inner, 1.0, nr + 1), np.linspace(0.0, 1.0, nz + 1)
    places = np.array([(x, y) for y in z for x in r])
    number = np.arange(len(places)).reshape(nz + 1, nr + 1)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, e = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, e])])
    sides = [number[0], number[-1], number[:, 0], number[:, -1]]
    facets = np.concatenate([np.column_stack([of[:-1], of[1:]]) for of in sides])
    surface = np.repeat([1, 2, 3, 4], [nr, nr, nz, nz])
    held = np.zeros((len(facets), 2), dtype=np.uint8)
    held[surface == 1, 1] = 1
    count = len(triangles)
    mean = np.zeros((4, 4))
    mean[:3, :3] = 1 / 3
    return {
        "revolved": np.array(1),
        "vertices": places,
        "cells": triangles,
        "cone": np.zeros(count, dtype=int),
        "cone_bound": np.array([RADIUS]),
        "cone_slope": np.zeros((1, 4)),
        "cone_matrix": (np.eye(4) - mean)[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((count, 2)),
        "facets": facets,
        "surface": surface,
        "held": held,
        "traction": np.zeros((len(facets), 2, 2)),
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 2)),
        "stress": np.zeros((count, 6, 2, 2)),
        "bound": np.array(1.0),
    }


def stretched(them: Arrays, size: float) -> None:
    """Set a uniform stress along the axis."""
    r = them["vertices"][them["cells"]][..., 0]
    pairs = [(a, b) for a in range(3) for b in range(a, 3)]
    for a, b in pairs:
        them["stress"][:, PAIRS[a, b], 1, 1] += size * (r[:, a] + r[:, b]) / 2


def pulled(them: Arrays, share: float) -> None:
    """Set a load along the axis at the top, and a fraction of the stress that balances it."""
    them["traction"][them["surface"] == 2, :, 1] = 1.0
    stretched(them, share)


@pytest.mark.parametrize("inner", [0.0, 0.5, 0.999])
@pytest.mark.parametrize("share", [1.0, 1 - 1e-12, 1 - 1e-6, 0.9, 0.0])
def test_a_pulled_tube(inner: float, share: float) -> None:
    """The imbalance lowers the bound, and nothing above the limit is proven."""
    them = tube(inner)
    pulled(them, share)
    them["stress"] *= PULL
    them["bound"] = np.array(PULL)
    found = check_lower(them)
    assert found.reached is not None
    assert 0.0 < found.reached <= PULL * (1 + 1e-12)
    assert found.reached >= PULL * (1 - 1e6 * (1 - share) - 1e-9)
    if abs(share - 1) < 1e-15 or share < 1 - 1e-9:
        assert bool(found.faults) == (share < 1.0)


def heavy(them: Arrays) -> None:
    """Replace the load at the top by a weight: the bottom carries all of it."""
    them["traction"] *= 0.0
    them["body_force"][:, 1] = -1.0


def heavy_in_one_cell(them: Arrays) -> None:
    """Give a weight to the last cell only."""
    them["traction"] *= 0.0
    them["body_force"][-1, 1] = -1.0


def sheared(them: Arrays) -> None:
    """Replace the load at the top by a shear traction on the outer side."""
    them["traction"] *= 0.0
    them["traction"][them["surface"] == 4, :, 1] = 1.0


def burst(them: Arrays) -> None:
    """Add an outer pressure, without a stress."""
    them["constant_traction"] = np.zeros_like(them["traction"])
    them["constant_traction"][them["surface"] == 4, :, 0] = -1e-9


def a_jump(them: Arrays) -> None:
    """Set a stress in one cell only, away from the axis."""
    them["stress"][1, 1] += 1e-3 * np.eye(2)


def spun(them: Arrays) -> None:
    """Set a radial force, which hoop stresses balance."""
    them["constant_body_force"] = np.zeros_like(them["body_force"])
    them["constant_body_force"][:, 0] = 1e-3


def moved(them: Arrays) -> None:
    """Move a vertex without a change of the stress."""
    them["vertices"][5] += 3e-12


def plated(them: Arrays) -> None:
    """Put a rigid plate on top, with the load."""
    them["traction"] *= 0.0
    them["rigid"], them["rigid_held"] = np.array([2]), np.array([[1, 0]], dtype=np.uint8)
    inner = them["vertices"][:, 0].min()
    them["rigid_force"] = np.array([[0.0, np.pi * (1 - inner**2)]])
    them["rigid_moment"] = np.zeros((1, 1))


def on_a_plane(them: Arrays) -> None:
    """Replace the support by a plane without friction, with compression."""
    them["held"][:] = 0
    them["traction"] *= -1.0
    them["stress"] *= -1.0
    them["obstacles"], them["obstacle_normals"] = np.array([1]), np.array([[0.0, -1.0]])


def held_at_the_top(them: Arrays) -> None:
    """Hold only the top, where the load acts: the load acts only on held facets."""
    them["held"][:] = 0
    them["held"][them["surface"] == 4, 1] = 1


VARIANTS: dict[str, Callable[[Arrays], None]] = {
    of.__name__: of
    for of in (
        *(heavy, heavy_in_one_cell, sheared, burst, a_jump, spun, moved, plated, on_a_plane),
        held_at_the_top,
    )
}


def most(them: Arrays, name: str) -> float:
    """Return a load factor that no stress exceeds: by tension, or shear, across the whole tube."""
    inner = float(them["vertices"][:, 0].min())
    area = np.pi * (1 - inner**2)
    if name == "heavy":
        return PULL
    if name == "heavy_in_one_cell":
        return np.inf
    if name == "sheared":
        return PULL * area / (2 * np.pi)
    return PULL if name != "held_at_the_top" else np.inf


@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("name", VARIANTS)
def test_what_is_proven_does_not_exceed_the_section(name: str, share: float, inner: float) -> None:
    them = tube(inner)
    pulled(them, share)
    VARIANTS[name](them)
    found = check_lower(them)
    if name in ("burst", "spun"):  # such a stress cannot be scaled down
        assert found.reached is None or found.reached <= 1.0
        return
    if name == "on_a_plane" and share != 1.0:  # contact cannot push with a larger force
        assert found.reached is None
        return
    assert found.reached is not None
    assert 0.0 < found.reached <= most(them, name) * (1 + 1e-9)


def test_nothing_holds_a_tube() -> None:
    for size in (1.0, 1e-12, 1e-30):
        them = tube(0.5)
        pulled(them, 0.0)
        them["held"][:] = 0
        them["traction"] *= size
        found = check_lower(them)
        assert found.reached is None
        assert "neither supports nor contact" in "; ".join(found.faults)


def test_stress_on_the_axis_proves_nothing() -> None:
    them = tube(0.0)
    pulled(them, 1.0)
    assert not check_lower(them).faults
    them["stress"][0, 0, 1, 1] = 1e-14
    found = check_lower(them)
    assert found.reached is None
    assert "axis is" in "; ".join(found.faults)


@pytest.mark.parametrize("axis", [None, 0, 1, 2])
def test_sizes_of_stresses_on_the_regular_triangle(axis: int | None) -> None:
    """The test computes the numbers in the argument from the conditions on the three parts."""
    of_sides, of_force = sizes_on(axis)
    exact = (3.6901, 1.3946) if axis is None else (2.7690, 1.5461)
    assert (of_sides, of_force) == pytest.approx(exact, abs=1e-4)
    assert QUADRATIC[0] > of_sides
    assert QUADRATIC[1] > of_force


def test_a_stress_is_zero_where_tractions_are() -> None:
    """At a vertex where both sides have no traction, in both parts of the triangle there."""
    stress = stresses_on(None, bare=0)
    assert np.abs(stress[[6, 12]]).max() < 1e-12  # first of the six coefficients in each part
    assert np.abs(stress).max() > 1


def sizes_on(axis: int | None) -> tuple[float, float]:
    """Return the largest coefficient for unit tractions on a side, and for a unit force."""
    found = stresses_on(axis)

    def size(at: npt.NDArray, start: int, count: int) -> float:
        columns = range(start, start + 2 * count, 2)
        return float(sum(np.linalg.norm(at[:, k : k + 2], 2) for k in columns))

    of_sides = max(size(at, 6 * s, 3) for at in found for s in range(3))
    return of_sides, max(size(at, 18, 3) for at in found)


def stresses_on(axis: int | None, bare: int | None = None) -> npt.NDArray:
    """Return coefficients of stresses for balanced unit tractions and forces.

    Args:
        axis: The side on which the stress is zero, with the tractions at its ends; None for none.
        bare: A vertex at which tractions are zero; None for none.
    """
    corners = regular(2)
    centre, whole = corners.mean(axis=0), np.sqrt(3.0) / 4
    points = np.vstack([corners, centre])
    parts = [[*(j for j in range(3) if j != i), 3] for i in range(3)]
    basis = [np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), np.sqrt(0.5) * np.eye(2)[::-1]]
    unknowns, given = 3 * 6 * 3, 18 + 6
    rows: list[npt.NDArray] = []
    sides: list[npt.NDArray] = []

    def column(part: int, a: int, b: int) -> int:
        return (part * 6 + PAIRS[parts[part].index(a), parts[part].index(b)]) * 3

    def area(ends: list[int], away: int) -> npt.NDArray:
        edge = points[ends[1]] - points[ends[0]]
        vector = np.array([edge[1], -edge[0]])
        return vector if vector @ (points[ends[0]] - points[away]) > 0 else -vector

    def condition(terms: list[tuple[int, int, int, npt.NDArray]], of: dict[int, float]) -> None:
        for along in range(2):
            row, side = np.zeros(unknowns), np.zeros(given)
            for part, a, b, vector in terms:
                first = column(part, a, b)
                row[first : first + 3] += [(one @ vector)[along] for one in basis]
            for number, factor in of.items():
                side[number + along] += factor
            rows.append(row)
            sides.append(side)

    for s, t in combinations(range(3), 2):
        p, q = (of for of in parts[s] if of in parts[t])
        vector = area([p, q], next(of for of in parts[s] if of not in (p, q)))
        for a, b in ((p, p), (q, q), (p, q)):
            condition([(s, a, b, vector), (t, a, b, -vector)], {})
    places = []
    for s in range(3):
        p, q = parts[s][:2]
        for k, (a, b) in enumerate(((p, p), (q, q), (p, q))):
            condition([(s, a, b, area([p, q], 3))], {(s * 3 + k) * 2: 1.0})
            places.append((s, a, b))
        for a in parts[s]:
            terms = []
            for b in parts[s]:
                rest = [of for of in parts[s] if of != b]
                terms.append((s, a, b, -area(rest, b) / (whole / 3)))
            share = {18 + 2 * k: -1 / whole if a == k else 0.0 for k in range(3)}
            third = {18 + 2 * k: -1 / (3 * whole) for k in range(3)}
            condition(terms, third if a == 3 else share)
    if axis is not None:
        p, q = parts[axis][:2]
        for a, b in ((p, p), (q, q), (p, q)):
            for k in range(3):
                row = np.zeros(unknowns)
                row[column(axis, a, b) + k] = 1.0
                rows.append(row)
                sides.append(np.zeros(given))
    known = [*_balance(points, places)]
    if axis is not None:
        ends = parts[axis][:2]
        for number, (s, a, b) in enumerate(places):
            if s == axis or (a == b and a in ends):
                known += list(np.eye(given)[2 * number : 2 * number + 2])
    if bare is not None:
        for number, (_, a, b) in enumerate(places):
            if a == b == bare:
                known += list(np.eye(given)[2 * number : 2 * number + 2])
    values, turned = np.linalg.svd(np.array(known))[1:]
    kept = turned[(values > 1e-9).sum() :]
    left, right = np.array(rows), np.array(sides) @ (kept.T @ kept)
    found = np.linalg.lstsq(left, right, rcond=None)[0]
    assert np.abs(left @ found - right).max() < 1e-12  # such a stress exists
    return np.asarray(found.reshape(18, 3, given))


def _balance(points: npt.NDArray, places: list[tuple[int, int, int]]) -> npt.NDArray:
    """Return rows of the resultants of tractions and forces: two forces and the moment."""
    rows = np.zeros((3, 24))
    arms = points[:3] - points[3]
    for number, (_, a, b) in enumerate(places):
        others = [of for s, of, second in places if s == places[number][0] and of == second]
        p, q = others
        if a == b:
            arm = arms[a] / 4 + arms[q if a == p else p] / 12
        else:
            arm = (arms[p] + arms[q]) / 6
        first = 2 * number
        rows[0, first] = rows[1, first + 1] = 1 / 3
        rows[2, first], rows[2, first + 1] = -arm[1], arm[0]
    for k in range(3):
        arm = (arms.sum(axis=0) + arms[k]) / 12
        rows[0, 18 + 2 * k] = rows[1, 19 + 2 * k] = 1 / 3
        rows[2, 18 + 2 * k], rows[2, 19 + 2 * k] = -arm[1], arm[0]
    return rows


def with_plate(length: float = 4.0, cells: int = 8) -> Arrays:
    """Return a strip held at its left end, with a rigid plate under tension at the other end."""
    them = strip(length, cells)
    them["surface"][-1] = 5
    them["rigid"], them["rigid_held"] = np.array([5]), np.zeros((1, 2), dtype=np.uint8)
    them["rigid_force"], them["rigid_moment"] = np.array([[1.0, 0.0]]), np.array([[-0.5]])
    them["stress"][..., 0, 0] = 1.0
    return them


def plate_turned(them: Arrays) -> None:
    """Apply a moment on the plate, with the force removed."""
    them["rigid_moment"] += 0.25


def plate_pushed_across(them: Arrays) -> None:
    """Apply a force along the plate."""
    them["rigid_force"], them["rigid_moment"] = np.array([[0.0, 1.0]]), np.array([[4.0]])


def plate_held(them: Arrays) -> None:
    """Hold the plate against rotation and lateral motion; nothing else holds the strip so."""
    them["rigid_held"][0, 1] = 1
    them["held"][-2] = [1, 0]


def plate_without_stress(them: Arrays) -> None:
    them["stress"] *= 0.0


def plate_with_traction(them: Arrays) -> None:
    """Apply the load as a traction on the plate, whose resultant matters."""
    them["rigid_force"] *= 0.0
    them["rigid_moment"] *= 0.0
    them["traction"][-1, :, 0] = [0.0, 2.0]


def plate_pulled_apart(them: Arrays) -> None:
    """Set half of the stress."""
    them["stress"] *= 0.5


def plate_at_the_side(them: Arrays) -> None:
    """Add a second plate on facets of the top, without loads."""
    them["surface"][8:12] = 6
    them["rigid"], them["rigid_held"] = np.array([5, 6]), np.zeros((2, 2), dtype=np.uint8)
    them["rigid_force"] = np.append(them["rigid_force"], [[0.0, 0.0]], axis=0)
    them["rigid_moment"] = np.append(them["rigid_moment"], [[0.0]], axis=0)


def plate_over_two_pieces(them: Arrays) -> None:
    """Let the plate connect the strip with a second strip, which is also held."""
    more = strip(4.0, 8)
    count = len(them["vertices"])
    more["vertices"] = more["vertices"] + [0.0, 2.0]
    more["surface"][-1] = 5
    more["held"][-2] = [1, 0]
    more["stress"][..., 0, 0] = 1.0
    for name in ("cells", "facets"):
        them[name] = np.concatenate([them[name], more[name] + count])
    for name in ("vertices", "cone", "body_force", "surface", "held", "traction", "stress"):
        them[name] = np.concatenate([them[name], more[name]])
    them["rigid_force"], them["rigid_moment"] = np.array([[2.0, 0.0]]), np.array([[-3.0]])


def plate_as_it_is(them: Arrays) -> None:
    """Apply the load along the strip."""


PLATES: dict[str, tuple[Callable[[Arrays], None], float]] = {
    of.__name__: (of, limit)
    for of, limit in (
        (plate_as_it_is, 2.0),
        (plate_turned, 2.0),
        (plate_pushed_across, 1.0),
        (plate_held, 2.0),
        (plate_without_stress, 2.0),
        (plate_with_traction, 2.0),
        (plate_pulled_apart, 2.0),
        (plate_at_the_side, 2.0),
        (plate_over_two_pieces, 2.0),
    )
}


@pytest.mark.parametrize("name", PLATES)
@pytest.mark.parametrize("claim", [1e-3, 1.0, 2.0, 1e3])
def test_a_plate_does_not_pull_by_more_than_the_section_bears(name: str, claim: float) -> None:
    them = with_plate()
    change, limit = PLATES[name]
    change(them)
    them["stress"] *= claim
    them["bound"] = np.array(claim)
    found = check_lower(them)
    assert found.reached is not None, found.faults
    assert 0.0 < found.reached <= limit * (1 + 1e-12)
    if name in ("plate_as_it_is", "plate_over_two_pieces", "plate_held") and claim <= 2.0:
        assert not found.faults


def test_nothing_holds_what_a_plate_pulls() -> None:
    for size in (1.0, 1e-12, 1e-30):
        them = with_plate()
        plate_without_stress(them)
        them["held"][:] = 0
        them["rigid_force"] *= size
        them["rigid_moment"] *= size
        found = check_lower(them)
        assert found.reached is None
        assert "neither supports nor contact" in "; ".join(found.faults)
