"""Test the free surface in the picture of a flow."""

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.pictures.flow_figure import free_surface
from perfplast_fenicsx.pictures.result_reader import StoredFlow


def net(n: int) -> tuple[Floats, Longs]:
    """Return points and triangles of the unit square, n by n squares cut into two."""
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.stack([first, first + 1, first + n + 2], axis=1)
    upper = np.stack([first, first + n + 2, first + n + 1], axis=1)
    return points, np.concatenate([lower, upper])


@pytest.mark.parametrize("slope", [0.0, -0.3])
@pytest.mark.parametrize("n", [3, 8])
def test_the_free_surface_is_where_the_pressure_of_a_linear_head_is_zero(
    n: int, slope: float
) -> None:
    """The surface crosses cells; half saturation would be up to half a cell higher."""
    points, cells = net(n)
    head = 0.55 + slope * (points[:, 0] - 0.5)
    depth = head - points[:, 1]
    wet = depth > 0
    head = np.where(wet, head, points[:, 1])
    flow = StoredFlow(points, cells, 9.81 * np.maximum(depth, 0.0), head, wet.astype(float), 1)
    x, y = free_surface(flow).reshape(-1, 2).T
    exact = 0.55 + slope * (x - 0.5)
    assert x.min() == pytest.approx(0.0) and x.max() == pytest.approx(1.0)
    assert np.abs(y - exact).max() < (1e-5 if slope == 0 else 0.5 * abs(slope) / n)


def test_a_level_at_points_is_met() -> None:
    """The surface passes through saturated points with zero pressure."""
    points, cells = net(4)
    level = 0.5
    wet = points[:, 1] <= level
    head = np.where(wet, level, points[:, 1])
    pressure = np.maximum(level - points[:, 1], 0.0)
    flow = StoredFlow(points, cells, pressure, head, wet.astype(float), 1)
    assert free_surface(flow)[..., 1] == pytest.approx(level, abs=1e-5)


def test_a_drain_that_water_passes_has_no_free_surface() -> None:
    """All its points are saturated, but no cell is."""
    points, cells = net(3)
    on_base = (points[:, 1] == 0).astype(float)
    flow = StoredFlow(points, cells, np.zeros(len(points)), points[:, 1], on_base, 1)
    assert free_surface(flow).shape == (0, 2, 2)


def test_ground_that_is_saturated_has_no_free_surface() -> None:
    points, cells = net(2)
    head = np.full(len(points), 2.0)
    flow = StoredFlow(points, cells, 2.0 - points[:, 1], head, np.ones(len(points)), 1)
    assert free_surface(flow).shape == (0, 2, 2)
