"""Test the clipping of facets: random pairs, slivers, and almost coinciding facets."""

import os

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.mortar.facet_overlap import overlaps
from perfplast_fenicsx.contact.mortar.mortar_rows import integrate, mortar_rows
from perfplast_fenicsx.contact.surfaces.surface_facets import facet_type
from perfplast_fenicsx.mesh.kinematics import KINDS

pytestmark = pytest.mark.serial


def grid(counts: tuple[int, int], turn: float, degree: int, seed: int, side: float) -> Floats:
    """Return the facets of a flat square of random triangles, rotated about the centre."""
    random = np.random.default_rng(seed)
    n, m = counts
    x = np.stack(np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, m + 1)), axis=-1)
    x[1:-1, 1:-1] += 0.8 * (random.random((m - 1, n - 1, 2)) - 0.5) / np.array([n, m])
    x = x.reshape(-1, 2) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    number = np.arange((n + 1) * (m + 1)).reshape(m + 1, n + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    cells = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    flat = np.concatenate([x, np.zeros((len(x), 1))], axis=1)[cells]
    facets = np.zeros(len(cells), dtype=facet_type(3, 3 if degree == 1 else 6, 3))
    facets["x"] = flat
    facets["at"][:, :3] = flat
    facets["normal"] = [0.0, 0.0, side]
    return facets


def area(x: Floats) -> Floats:
    return np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2


@pytest.mark.parametrize("size", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_triangles_that_nearly_coincide(size: float) -> None:
    """Areas are not negative, do not exceed the facet, and add up to it."""
    random = np.random.default_rng(3)
    host = random.random((20_000, 3, 3))
    guest = host[:, [0, 2, 1]] + size * (random.random(host.shape) - 0.5)
    found = overlaps(host, guest)
    assert (found.share > 0).all()
    covered = np.bincount(found.pair, found.share, len(host))
    fat = area(host) > 1e-2
    assert covered.max() < 1 + 1e-12
    assert covered[fat].min() > 1 - 200 * size - 1e-12


def test_random_triangles_against_points() -> None:
    """The areas agree with the fractions of random points that lie in both triangles."""
    random = np.random.default_rng(4)
    host, guest = random.random((2, 100, 3, 3))
    host[..., 2] = guest[..., 2] = 0
    found = overlaps(host, guest)
    covered = np.bincount(found.pair, found.share, len(host))
    points = random.dirichlet([1.0, 1.0, 1.0], 4_000)
    edges = (guest[:, 1:] - guest[:, :1])[..., :2]
    at = np.einsum("qc,nci->nqi", points, host)[..., :2] - guest[:, :1, :2]
    local = np.einsum("nqi,nij->nqj", at, np.linalg.inv(edges))
    inside = (local >= 0).all(axis=2) & (local.sum(axis=2) <= 1)
    assert np.abs(covered - inside.mean(axis=1)).max() < 0.05
    # both parametrisations refer to the same points
    for corners, of in ((found.host, host), (found.guest, guest)):
        assert (corners > -1e-9).all()
        assert corners.sum(axis=2) == pytest.approx(1.0)
        assert of.shape == host.shape
    there = np.einsum("nvc,nci->nvi", found.host, host[found.pair])
    again = np.einsum("nvc,nci->nvi", found.guest, guest[found.pair])
    assert there == pytest.approx(again, abs=1e-9)


def common_area(a: Floats, b: Floats) -> float:
    """Return the common area of two polygons, by shapely."""
    shapely = pytest.importorskip("shapely")
    return float(shapely.Polygon(a).intersection(shapely.Polygon(b)).area)


def test_areas_against_shapely() -> None:
    random = np.random.default_rng(7)
    host, guest = np.zeros((2, 300, 3, 3))
    host[..., :2], guest[..., :2] = random.random((2, 300, 3, 2))
    fat = np.minimum(area(host), area(guest)) > 1e-2
    host, guest = host[fat], guest[fat]
    found = overlaps(host, guest)
    covered = np.bincount(found.pair, found.share, len(host)) * area(host)
    exact = [common_area(a[:, :2], b[:, :2]) for a, b in zip(host, guest, strict=True)]
    assert covered == pytest.approx(np.array(exact), abs=1e-12)
    assert (covered > 0).sum() > 50


def line(count: int, degree: int, seed: int, side: float) -> Floats:
    """Return the facets of a straight line from −1 to 1 with random nodes."""
    random = np.random.default_rng(seed)
    ends = np.array([-1.0, 1.0])
    x = np.sort(np.concatenate([ends, 2 * random.random(count - 1) - 1]))
    facets = np.zeros(count, dtype=facet_type(2, 1 + degree, 2))
    facets["x"][..., 0] = np.stack([x[:-1], x[1:]], axis=1)
    facets["at"][:, :2] = facets["x"]
    facets["normal"] = [0.0, side]
    return facets


def number_nodes(facets: Floats) -> int:
    """Number the nodes of straight facets, all on this rank; return the number of nodes."""
    corners = facets["x"]
    gdim = corners.shape[2]
    edges = [(0, 1)] if gdim == 2 else [(1, 2), (0, 2), (0, 1)]
    middles = [(corners[:, i] + corners[:, j]) / 2 for i, j in edges]
    at = np.concatenate([corners, np.stack(middles, axis=1)], axis=1)
    facets["at"] = at[:, : facets["at"].shape[1]]
    places = facets["at"].reshape(-1, gdim).round(9) + 0.0
    nodes, number = np.unique(places, axis=0, return_inverse=True)
    facets["place"] = facets["node"] = number.reshape(facets["place"].shape)
    return len(nodes)


PAIRS = 40 * int(os.environ.get("PERFPLAST_FUZZ", "1"))
"""Number of pairs of random surfaces; 2000 with PERFPLAST_FUZZ=50."""


def test_random_pairs_of_surfaces() -> None:
    """Area is conserved, weights are positive, and both sides of a row are in equilibrium.

    If only a small part of a shape function is covered, a row has terms of thousands that cancel.
    The sum is then accurate to the rounding errors of these terms.
    """
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for seed in range(PAIRS):
        random = np.random.default_rng(seed)
        degree, flat = 1 + seed % 2, seed % 5 == 0
        shift = (random.random(2) - 0.5) * random.choice([0.0, 1e-9, 0.5, 3.0])
        turn = float(random.choice([0.0, 1e-9, 3 * random.random()]))
        counts = [(int(n), int(m)) for n, m in random.integers(1, 9, (2, 2))]
        if flat:
            host = line(counts[0][0], degree, seed, 1.0)
            guest = line(counts[1][0], degree, seed + 100, -1.0)
            shift[1] = 0
            guest["x"] += shift
            exact = max(0.0, 2 - abs(shift[0]))
        else:
            host = grid(counts[0], 0.0, degree, seed, 1.0)
            guest = grid(counts[1], turn, degree, seed + 100, -1.0)
            guest["x"] += [*shift, 0.0]
            turned = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
            exact = common_area(square, square @ turned + shift)
        for one, other in ((host, guest), (guest, host)):
            found = integrate(one, other, 0.3, KINDS["space"].around)
            assert found.covered.sum() == pytest.approx(exact, rel=1e-12, abs=1e-12), seed
            assert found.on_guest.sum() == pytest.approx(exact, rel=1e-12, abs=1e-12), seed
            assert found.d.sum() == pytest.approx(found.covered.sum(), rel=1e-12), seed
            weights = np.zeros_like(found.d)
            np.add.at(weights, found.host, found.M.sum(axis=2))
            assert weights == pytest.approx(found.d, abs=1e-12), seed
            able = np.ones(number_nodes(one), dtype=np.bool_)
            number_nodes(other)
            rows = mortar_rows(MPI.COMM_SELF, one, other, found, able)
            assert not rows.lost, seed
            assert (rows.d > 0).all(), seed
            assert rows.d.sum() == pytest.approx(exact, rel=1e-12, abs=1e-12), seed
            for side, sum_of_weights in ((rows.own, 1.0), (~rows.own, -1.0)):
                row, weight = rows.row[side], rows.weight[side]
                sums, sizes = (np.bincount(row, w, len(rows.d)) for w in (weight, np.abs(weight)))
                assert (np.abs(sums - sum_of_weights) <= 1e-13 * sizes).all(), seed
