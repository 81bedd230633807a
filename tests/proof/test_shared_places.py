"""Test where two meshes share a place: boxes, cells and facets, against all pairs."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.box_pairs import box_pairs
from perfplast_fenicsx.proof.checker import overlapping
from perfplast_fenicsx.proof.crossed_facets import _crossed, crossed
from perfplast_fenicsx.proof.halves import differences
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.shared_cells import have_common_volume
from perfplast_fenicsx.proof.shared_facets import shared_facets
from tests.proof.test_balance import row_of_cubes
from tests.proof.test_shadowed_contact import plates

pytestmark = pytest.mark.serial

Floats = npt.NDArray[np.float64]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("away", [0.0, -1e9])
def test_boxes_that_meet(dim: int, away: float) -> None:
    """Boxes have sizes over six decades, and each pair is found once."""
    random = np.random.default_rng(dim)
    sets = []
    for count in (150, 200):
        low = random.random((count, dim)) + away
        size = 10.0 ** random.uniform(-6, 0, (count, 1)) * random.random((count, dim))
        sets.append(np.stack([low, low + size]))
    ones, others = sets
    meet = (ones[0][:, None] <= others[1]) & (others[0] <= ones[1][:, None])
    wanted = np.argwhere(meet.all(axis=2))
    found = np.concatenate([np.stack(pair, axis=1) for pair in box_pairs(ones, others)])
    assert len(found) == len(wanted) > 100
    assert (found[np.lexsort(found.T[::-1])] == wanted).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_boxes_of_many_sizes(dim: int) -> None:
    """Each of 120 boxes in one corner has half the size of the previous box: all meet, once."""
    high = 2.0 ** -np.arange(120)[:, None] * np.ones(dim)
    boxes = np.stack([0 * high, high])
    found = np.concatenate([np.stack(pair, axis=1) for pair in box_pairs(boxes, boxes)])
    assert len(found) == len(np.unique(found, axis=0)) == 120**2


def test_boxes_of_a_graded_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cell of a grid with doubling edges has six boxes: long boxes meet few others."""
    monkeypatch.setattr("perfplast_fenicsx.proof.box_pairs.FEW_PAIRS", 0)
    edges = 2.0 ** np.arange(13)
    low, high = (
        np.stack(np.meshgrid(*[ends] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        for ends in (edges[:-1], edges[1:])
    )
    boxes = np.repeat(np.stack([low, high]), 6, axis=1)
    found = sum(len(a) for a, _ in box_pairs(boxes, boxes))
    assert found == 36 * 34**3  # 34 pairs of intervals along each axis meet


def test_too_many_boxes_in_one_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """The checker says so if the pairs would take too long."""
    monkeypatch.setattr("perfplast_fenicsx.proof.box_pairs.FEW_PAIRS", 10)
    monkeypatch.setattr("perfplast_fenicsx.proof.box_pairs.MOST_PAIRS", 10)
    boxes = np.stack([np.zeros((100, 2)), np.ones((100, 2))])
    with pytest.raises(ProofError, match="too long"):
        list(box_pairs(boxes, boxes))


def test_cells_in_one_place_are_seen_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search does not examine all pairs of two thousand times two coinciding cells."""
    looked_at = []

    def counted(ones: Floats, others: Floats) -> npt.NDArray[np.bool_]:
        looked_at.append(len(ones))
        return have_common_volume(ones, others)

    monkeypatch.setattr("perfplast_fenicsx.proof.checker.have_common_volume", counted)
    body = Body.of(plates((0.0,) * 2000, (), ()) | {"contacts": np.zeros((0, 2), dtype=int)})
    assert overlapping(body) > 0
    assert sum(looked_at) < 1_000_000


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_with_a_common_volume(dim: int) -> None:
    """The search finds all pairs with a random point in both, and few other pairs."""
    random = np.random.default_rng(dim)
    ones, others = random.random((2, 100, dim + 1, dim))
    found = have_common_volume(ones, others)
    points = random.random((10_000, dim))
    inside = [
        [(points - x[0]) @ np.linalg.inv(x[1:] - x[0]) for x in simplices]
        for simplices in (ones, others)
    ]
    hits = np.array(
        [
            sum((shares > 0).all(axis=1) & (shares.sum(axis=1) < 1) for shares in pair).max() == 2
            for pair in zip(*inside, strict=True)
        ]
    )
    assert found[hits].all()
    assert 0 < (~found).sum()
    assert (found & ~hits).sum() <= (8 if dim == 2 else 25)


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_that_touch_have_none(dim: int) -> None:
    """A cell and its image about a facet or vertex share none; a thin slice shares some."""
    cell = np.concatenate([np.zeros((1, dim)), np.eye(dim)])[None]
    beside = cell * ([-1.0] + [1.0] * (dim - 1))
    assert not have_common_volume(cell, beside)[0]
    assert not have_common_volume(cell, -cell)[0]
    assert have_common_volume(cell, 0.5 * cell)[0]
    flat = cell * ([1e-9] + [0.5] * (dim - 1))
    assert have_common_volume(cell, flat)[0]
    assert not have_common_volume(beside, flat)[0]


def box(count: int, dim: int, change: Callable[[Floats], Floats] = lambda x: x) -> Body:
    """Return a unit box of triangles or tetrahedra, strong above the middle, pressed and heavy."""
    axes = np.stack(np.meshgrid(*[np.arange(count + 1)] * dim, indexing="ij"), axis=-1)
    x = axes.reshape(-1, dim) / count
    numbers = np.arange(len(x)).reshape(axes.shape[:-1])
    corner = np.stack(np.meshgrid(*[np.arange(count)] * dim, indexing="ij"), axis=-1)
    cells = []
    for turn in range(6 if dim == 3 else 2):
        steps = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]][turn]
        steps = steps if dim == 3 else [[0, 1], [1, 0]][turn]
        at = corner.reshape(-1, dim)
        path = [numbers[tuple(at.T)]]
        for axis in steps:
            at = at + np.eye(dim, dtype=int)[axis]
            path.append(numbers[tuple(at.T)])
        cells.append(np.stack(path, axis=1))
    every = np.concatenate(cells)
    facets = np.concatenate([np.delete(every, i, axis=1) for i in range(dim + 1)])
    _, first, counts = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    facets = facets[first[counts == 1]]
    middle = x[facets].mean(axis=1)
    top = middle[:, -1] > 1 - 1e-9
    above = x[every].mean(axis=1)[:, -1] > 0.5
    traction = np.zeros((len(facets), dim, dim))
    traction[top, :, -1] = -1 - x[facets[top]][..., 0]
    size = dim * (dim + 1) // 2
    deviator = np.eye(size)
    deviator[:dim, :dim] -= 1 / dim
    return Body.of(
        {
            "vertices": change(x),
            "cells": every,
            "cone": above.astype(np.int64),
            "cone_bound": np.array([1.0, 2.0]),
            "cone_slope": np.zeros((2, size)),
            "cone_matrix": np.stack([deviator, deviator]),
            "cone_sine": np.full(2, np.nan),
            "body_force": np.where(above[:, None], 0.3, 0.1) * np.ones(dim),
            "facets": facets,
            "surface": np.where(top, 1, 0),
            "held": np.repeat(middle[:, -1:] < 1e-9, dim, axis=1),
            "traction": traction,
            "contacts": np.zeros((0, 2), dtype=np.int64),
            "obstacles": np.zeros(0, dtype=np.int64),
            "obstacle_normals": np.zeros((0, dim)),
        }
    )


@pytest.mark.parametrize(("dim", "counts"), [(2, (6, 10)), (2, (8, 8)), (3, (2, 4)), (3, (4, 6))])
def test_boxes_whose_cells_cross(dim: int, counts: tuple[int, int]) -> None:
    """Neither mesh is a refinement of the other, and all surfaces are covered."""
    one, other = (box(count, dim) for count in counts)
    assert not differences(one, other)
    assert not differences(other, one)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_corner_that_is_not_the_same(dim: int) -> None:
    def moved(x: Floats) -> Floats:
        corner = (x == 1).all(axis=1)
        return np.asarray(x - 1e-6 * corner[:, None])

    one, other = box(4, dim), box(6, dim, moved)
    assert len(shared_facets(one, other).alone)
    assert "volume or position" in differences(one, other)[0]


def test_divided_bodies_are_the_same_far_away() -> None:
    """Other divisions, and rounding of coordinates, change nothing; a common facet does."""
    row = row_of_cubes(2)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    bodies = []
    for mirror in (1.0, -1.0):
        x = (row["vertices"] - [1.0, 0.5, 0.5]) * [mirror, 1.0, 1.0]
        bodies.append(solid(row | {"vertices": x @ turn + 1e4}))
    assert not differences(*bodies)
    apart = row_of_cubes(1)
    cut = {
        "vertices": np.concatenate([apart["vertices"] + [k, 0, 0] for k in range(2)]),
        "cells": np.concatenate([apart["cells"], apart["cells"] + 8]),
        "facets": np.concatenate([apart["facets"], apart["facets"] + 8]),
    }
    assert len(crossed(solid(row), solid(cut))) == 2
    assert not len(crossed(solid(cut), solid(cut | {"vertices": cut["vertices"] + 0.0})))


@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_a_cell_lies_on_both_sides_of_a_facet(size: float) -> None:
    """The cell need not contain an edge of the facet, nor be large."""
    row = row_of_cubes(1)
    x = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0], [0.2, 0.2, 1.0]])
    for shift, through in ((0.0, 1), (2e-3, 1), (1.0, 0)):
        cell = {
            "vertices": np.array([0.3, 0.3, 1.0]) + size * (x + shift * np.eye(3)[2]),
            "cells": np.arange(4)[None],
            "facets": np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]),
        }
        assert len(_crossed(solid(cell), solid(row))) == through


def solid(mesh: dict[str, npt.NDArray]) -> Body:
    """Return a body of one material without loads."""
    count, facets = len(mesh["cells"]), len(mesh["facets"])
    return Body.of(
        {
            **mesh,
            "cone": np.zeros(count, dtype=int),
            "cone_bound": np.ones(1),
            "cone_slope": np.zeros((1, 6)),
            "cone_matrix": np.eye(6)[None],
            "cone_sine": np.full(1, np.nan),
            "body_force": np.zeros((count, 3)),
            "surface": np.zeros(facets, dtype=int),
            "held": np.zeros((facets, 3), dtype=np.uint8),
            "traction": np.zeros((facets, 3, 3)),
            "contacts": np.zeros((0, 2), dtype=int),
            "obstacles": np.zeros(0, dtype=int),
            "obstacle_normals": np.zeros((0, 3)),
        }
    )
