"""Clipping of pieces: random pairs, slivers and what nearly coincides."""

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.clipping import overlaps
from perfplast_fenicsx.contact.facet_pairing import candidates
from perfplast_fenicsx.contact.mortar_integrals import integrate
from perfplast_fenicsx.contact.surface_facets import facet_type, pieces_of
from perfplast_fenicsx.mesh.kinematics import KINDS


def grid(counts: tuple[int, int], turn: float, degree: int, seed: int, side: float) -> Floats:
    """Facets of a flat square of random triangles, turned about its centre."""
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
    """No negative area, none more than there is, and none of it lost."""
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
    """The shares are those of random points that lie in both triangles."""
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
    # both parametrisations mean the same points
    for corners, of in ((found.host, host), (found.guest, guest)):
        assert (corners > -1e-9).all()
        assert corners.sum(axis=2) == pytest.approx(1.0)
        assert of.shape == host.shape
    there = np.einsum("nvc,nci->nvi", found.host, host[found.pair])
    again = np.einsum("nvc,nci->nvi", found.guest, guest[found.pair])
    assert there == pytest.approx(again, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_random_pairs_of_surfaces(seed: int) -> None:
    """Area is conserved, weights are positive, and both sides of a row are in balance."""
    random = np.random.default_rng(seed)
    degree = 1 + seed % 2
    counts = [(int(n), int(m)) for n, m in random.integers(2, 9, (2, 2))]
    host = grid(counts[0], 0.0, degree, seed, 1.0)
    guest = grid(counts[1], random.random() * 3, degree, seed + 100, -1.0)
    shift = np.array([*(random.random(2) - 0.5), 0.0]) * random.choice([0.0, 1e-9, 0.5])
    guest["x"] += shift
    one = KINDS["space"].around
    both = [integrate(host, guest, 0.3, one), integrate(guest, host, 0.3, one)]
    assert both[0].covered.sum() == pytest.approx(both[1].covered.sum(), rel=1e-12)
    assert both[0].on_guest == pytest.approx(both[0].covered.sum(), rel=1e-12)
    for found in both:
        assert (found.d >= 0).all()
        assert found.d.sum() == pytest.approx(found.covered.sum(), rel=1e-12)
        weights = np.zeros_like(found.d)
        np.add.at(weights, found.host, found.M.sum(axis=2))
        assert weights == pytest.approx(found.d, abs=1e-12)
        assert (found.d <= found.full * (1 + 1e-9)).all()
    first, second = candidates(pieces_of(host), pieces_of(guest), 0.3, 0.3)
    assert len(first) == len(second)
