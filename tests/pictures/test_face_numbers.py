"""Test that numbers lie on their faces, and that each visible face has one."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.parts_figure import (
    DPI,
    ENOUGH,
    labels,
    rooms,
    shared_out,
    title_lines,
)

pytestmark = pytest.mark.serial


def picture() -> np.ndarray:
    """A large face has a hole that shows another face; one face is thin; one pixel is different."""
    seen = np.zeros((200, 300), dtype=np.int64)
    seen[20:180, 20:200] = 1
    seen[80:120, 80:120] = 4
    seen[20:180, 220:224] = 2
    seen[5, 5] = 3
    return seen


def test_numbers_stand_on_their_faces() -> None:
    seen = picture()
    found = rooms(seen)
    assert set(found) == {1, 2, 4}  # a single pixel is not visible
    for number, (x, y, free) in found.items():
        assert seen[int(y), int(x)] == number
        near = seen[int(y) - int(free) + 1 : int(y) + int(free), int(x)]
        assert (near == number).all()


def test_numbers_of_thin_faces_stand_beside_them() -> None:
    found = {label.number: label for label in labels(rooms(picture()), (300, 200))}
    assert found[1].at == found[1].words_at
    assert found[2].at != found[2].words_at
    for one in found.values():
        for other in found.values():
            apart = np.abs(np.subtract(one.words_at, other.words_at)).max()
            assert one is other or apart > ENOUGH


def test_each_face_has_its_number_where_it_has_most_room() -> None:
    few, many = {1: (0.0, 0.0, 5.0), 2: (0.0, 0.0, 40.0)}, {1: (0.0, 0.0, 9.0), 2: (0.0, 0.0, 80.0)}
    assert [set(view) for view in shared_out([few, many])] == [{2}, {1, 2}]


@pytest.mark.parametrize("columns", [1, 2])
def test_the_title_fits_on_the_picture(columns: int) -> None:
    hidden = [*range(80, 200), 7]
    lines = title_lines(hidden, columns)
    figure = Figure(figsize=(7.0 * columns, 7.0), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    extent = figure.suptitle("\n".join(lines)).get_window_extent(canvas.get_renderer())
    assert 0 < extent.x0 < extent.x1 < figure.bbox.x1
    numbers = " ".join(lines).partition("visible: ")[2]
    assert numbers.startswith("7, 80, 81, ")
    assert title_lines([], columns) == ["Bodies, and the numbers of their free faces"]
