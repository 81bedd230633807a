"""Test the number of elements through the thickness of a body."""

import numpy as np
import pytest

from perfplast_fenicsx.geometry.mesher import through
from tests.contact.blocks_apart import block

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(("layers", "low", "high"), [(1, 0.6, 1.0), (2, 0.0, 0.05), (4, 0.0, 0.05)])
def test_a_plate_of_layers(layers: int, low: float, high: float) -> None:
    points, cells = block((12, 12, layers), (0, 0, 0), (12, 12, 1.0), 0.0, 1, 0.0)
    assert low <= through(points, cells) <= high


def test_a_strip_in_the_plane() -> None:
    points, cells = block((20, 1), (0, 0), (20, 1.0), 0.0, 1, 0.0)
    assert through(points, cells) > 0.8
    points, cells = block((20, 3), (0, 0), (20, 1.0), 0.0, 1, 0.0)
    assert through(points, cells) == pytest.approx(0.0)
    assert np.isfinite(points).all()
