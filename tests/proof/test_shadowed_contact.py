"""Test facets that lie behind others of their surface, and contradictory bounds."""

from collections.abc import Callable
from itertools import product

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import _Half, _together, check_lower, check_upper
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.touching import touching
from perfplast_fenicsx.proof.verdict import Checked

pytestmark = pytest.mark.serial

Arrays = dict[str, npt.NDArray]

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def plates(
    heights: tuple[float, ...], faces_down: tuple[int, ...], faces_up: tuple[int, ...]
) -> Arrays:
    """Return squares of two cells above one another; the lowest is held, the others are loaded.

    Args:
        heights: Heights of the lower sides.
        faces_down: Numbers of squares whose lower side is of surface 1.
        faces_up: Numbers of those whose upper side is of surface 2.
    """
    n = len(heights)
    x = np.concatenate([np.add(SQUARE, [0.0, h]) for h in heights])
    first = 4 * np.arange(n)[:, None]
    cells = np.concatenate([np.add(first, corners) for corners in ([0, 1, 2], [0, 2, 3])])
    facets = np.concatenate([np.add(first, side) for side in ([0, 1], [1, 2], [2, 3], [3, 0])])
    surface, held = np.zeros(4 * n, dtype=int), np.zeros((4 * n, 2), dtype=np.uint8)
    surface[list(faces_down)] = 1
    surface[[2 * n + k for k in faces_up]] = 2
    held[int(np.argmin(heights))] = 1
    traction = np.zeros((4 * n, 2, 2))
    pressed = [k for k in range(n) if k not in faces_up]
    traction[[2 * n + k for k in pressed], :, 1] = -1.0
    deviator = np.array([[0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    return {
        "vertices": x,
        "cells": cells,
        "cone": np.zeros(2 * n, dtype=int),
        "cone_bound": np.array([1.0]),
        "cone_slope": np.zeros((1, 3)),
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((2 * n, 2)),
        "facets": facets,
        "surface": surface,
        "held": held,
        "traction": traction,
        "contacts": np.array([[1, 2]]),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 2)),
    }


SHADOWED = {
    "two above one": ((0.0, 2.0, 4.0), (1, 2), (0,)),
    "three above one": ((0.0, 2.0, 4.0, 6.0), (1, 2, 3), (0,)),
    "one above two": ((0.0, 2.0, 4.0), (2,), (0, 1)),
    "far above": ((0.0, 2.0, 400.0), (1, 2), (0,)),
    "in another order": ((4.0, 0.0, 2.0), (0, 2), (1,)),
}


@pytest.mark.parametrize(("name", "turned"), [*product(SHADOWED, (False, True))])
def test_a_facet_behind_another_has_no_partner(name: str, turned: bool) -> None:
    """For any order of the surfaces its load has no carrier, and no bound is reported."""
    arrays = plates(*SHADOWED[name])
    arrays["contacts"] = arrays["contacts"][:, ::-1] if turned else arrays["contacts"]
    body = Body.of(arrays)
    pair = touching(body, *arrays["contacts"][0])
    assert len(pair.first) == len(np.unique(pair.first)) == len(np.unique(pair.second)) == 1
    assert pair.apart == len(SHADOWED[name][0]) - 2
    stress = np.tile(np.diag([0.0, -1.0]), (len(arrays["cells"]), 3, 1, 1))
    low = check_lower(arrays | {"stress": stress, "bound": np.asarray(1.0)})
    assert low.proven is None
    nodes = np.arange(6 * len(arrays["cells"])).reshape(-1, 6)
    cells, pairs = arrays["cells"], [(0, 1), (0, 2), (1, 2)]
    ends = np.sort(cells[:, pairs].reshape(-1, 2), axis=1)
    _, edges = np.unique(ends, axis=0, return_inverse=True)
    nodes = np.hstack([cells, len(arrays["vertices"]) + edges.reshape(-1, 3)])
    v = np.zeros((nodes.max() + 1, 2))
    v[nodes[cells[:, 0] != 0, :], 1] = -1.0
    high = check_upper(arrays | {"velocity": v, "nodes": nodes, "bound": np.asarray(0.0)})
    assert any("have no matching" in fault for fault in high.faults)


def test_stacks_whose_facets_all_have_a_partner() -> None:
    """Three squares are stacked, with one name for all lower and one name for all upper sides."""
    body = Body.of(plates((0.0, 1.0, 2.0), (1, 2), (0, 1)))
    pair = touching(body, np.int64(1), np.int64(2))
    assert pair.apart == 0
    assert sorted(zip(pair.first, pair.second, strict=True)) == [(1, 6), (2, 7)]


def half(kind: str, claimed: float, proven: float | None) -> _Half:
    """Return a half for arbitrary bodies."""
    body = Body.of(plates((0.0, 1.0), (1,), (0,)))
    checked = Checked(kind, claimed, proven, {}, () if proven is not None else ("fails",))
    return _Half(checked, body, 0, power=1.0)


@pytest.mark.parametrize("claims", [(2.0, 3.0), (1e-3, 1.0), (0.0, 1e9)])
def test_bounds_are_compared_by_what_is_proven(claims: tuple[float, float]) -> None:
    """This holds for any claims of the halves."""
    faults, _ = _together(half("lower", claims[0], 2.0), half("upper", claims[1], 1.0))
    assert any("the lower bound 2 is above the upper one 1" in fault for fault in faults)


@pytest.mark.parametrize("proven", [(None, 1.0), (2.0, None)])
def test_what_is_not_proven_is_not_compared(proven: tuple[float | None, float | None]) -> None:
    faults, words = _together(half("lower", 2.0, proven[0]), half("upper", 1.0, proven[1]))
    assert not faults
    assert "not proven" in words


def only_on_plate(axes: tuple[int, int], push: tuple[float, float]) -> Callable[[Arrays], None]:
    """Make the upper plate rigid, hold it along some axes, and push it."""

    def forge(them: Arrays) -> None:
        them["rigid"], them["rigid_held"] = np.array([3]), np.array([axes], dtype=np.uint8)
        top = int(np.flatnonzero(them["traction"].any(axis=(1, 2)))[0])
        them["surface"][top] = 3
        them["traction"][top] = push

    return forge


@pytest.mark.parametrize(
    ("axes", "push", "refused"),
    [
        ((1, 1), (0.0, -1.0), True),
        ((1, 1), (1.0, -1.0), True),
        ((0, 1), (0.0, -1.0), True),
        ((1, 0), (2.0, 0.0), True),
        ((0, 1), (1.0, -1.0), False),
        ((0, 0), (0.0, -1.0), False),
    ],
)
def test_loads_on_a_plate_that_is_held(
    axes: tuple[int, int], push: tuple[float, float], refused: bool
) -> None:
    """The body carries every factor of loads on held parts, so a bound has no meaning."""
    arrays = plates((0.0, 1.0), (1,), (0,))
    only_on_plate(axes, push)(arrays)
    arrays["stress"] = np.zeros((len(arrays["cells"]), 3, 2, 2))
    arrays["bound"] = np.asarray(1e9)
    if refused:
        with pytest.raises(ProofError, match="only supports are loaded"):
            check_lower(arrays)
        return
    assert check_lower(arrays).proven is None


@pytest.mark.parametrize("held", [(0, 0), (0, 1)])
def test_tractions_without_a_resultant_push_no_plate(held: tuple[int, int]) -> None:
    """The tractions are constant along each facet of the plate, and zero in the mean."""
    arrays = plates((0.0, 1.0), (1,), (0,))
    only_on_plate(held, (0.0, 0.0))(arrays)
    top = int(np.flatnonzero(arrays["surface"] == 3)[0])
    arrays["traction"][top] = [[1.0, 0.0], [-1.0, 0.0]]
    arrays["stress"] = np.zeros((len(arrays["cells"]), 3, 2, 2))
    arrays["bound"] = np.asarray(1e9)
    with pytest.raises(ProofError, match="only supports are loaded"):
        check_lower(arrays)
