"""Test colours, colour bars, and the displayed deformation."""

from itertools import pairwise

import numpy as np
import pytest

from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.picture_file import FRONT
from perfplast_fenicsx.units import Units

pytestmark = pytest.mark.serial

figure_panels = pytest.importorskip("perfplast_fenicsx.pictures.renderer")


def triangles(names: list[str], ratios: list[float]) -> Surface:
    """Return bodies of one triangle each, with yield ratios; the last one is in contact."""
    count = len(names)
    corners = np.arange(3 * count).reshape(-1, 3)
    points = np.tile([[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]], (count, 1))
    points[:, 2] = np.repeat(np.arange(count), 3)
    return Surface(
        points=points,
        triangles=corners,
        edges=np.zeros((0, 2), dtype=np.int64),
        body=np.arange(count),
        names=names,
        at_points={"displacement": 0.1 * points, "contact_pressure": points[:, 2]},
        at_cells={"yield_ratio": np.array(ratios)},
        marks={"contact": np.arange(count) == count - 1},
    )


def labels_of(names: list[str]) -> list[str]:
    """Return the words below the stress, after a check that no words in a picture overlap.

    Axes in 3D also have labels.
    """
    surface = triangles(names, [0.5] * len(names))
    shown = figure_panels.panels([surface], Units("mm", "MPa"))
    blank = np.zeros((8, 10, 3), dtype=np.uint8)
    figure = figure_panels.compose(shown, [blank] * len(shown), ("A title", "a caption"), FRONT)
    figure.canvas.draw()
    bars = [axes for axes in figure.axes if axes.get_xlabel()]
    words = [axes.xaxis.label for axes in bars]
    numbers = [text for axes in bars for text in axes.get_xticklabels() if text.get_text()]
    for texts in (words, numbers):
        boxes = sorted((text.get_window_extent() for text in texts), key=lambda box: box.x0)
        assert all(a.x1 < b.x0 for a, b in pairwise(boxes))
        assert 0 <= boxes[0].x0
        assert boxes[-1].x1 <= figure.bbox.x1
    assert {"x", "y", "z"} <= {text.get_text() for axes in figure.axes for text in axes.texts}
    return [text.get_text() for text in words[:-2]]


def test_names_of_letters_that_the_font_lacks() -> None:
    assert labels_of(["梁_1", "a$b$"]) == ["?_1", "a$b$"]


@pytest.mark.parametrize("repeats", [1, 40])
def test_a_caption_is_never_wider_than_its_picture(repeats: int) -> None:
    shown = figure_panels.panels([triangles(["a"], [0.5])], Units())
    blank = np.zeros((8, 10, 3), dtype=np.uint8)
    caption = " ".join(["strengths divided by F"] * repeats)
    figure = figure_panels.compose(shown, [blank] * len(shown), ("A title", caption), FRONT)
    figure.canvas.draw()
    (text,) = [text for text in figure.texts if text.get_text() == caption]
    box = text.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.x1


def test_pressures_of_a_limit_load_are_said_to_be_arbitrary() -> None:
    for unique in (True, False):
        shown = figure_panels.panels([triangles(["a"], [0.5])], Units(), unique=unique)
        labels = [label for panel in shown for *_, label in panel.bars]
        said = [label for label in labels if "arbitrary without plastic flow" in label]
        assert bool(said) != unique
        assert all("pressure" in label for label in said)


@pytest.mark.parametrize(
    "names",
    [["lower", "upper"], ["a"], ["a body with a long name, as one may have it"], list("abcd")],
    ids=len,
)
def test_a_colour_bar_for_each_of_few_bodies(names: list[str]) -> None:
    assert labels_of(names) == names


@pytest.mark.parametrize(
    "names",
    [[f"body_{i}" for i in range(10)], list("abcde"), [f"body_number_{i}" for i in range(4)]],
    ids=len,
)
def test_one_colour_bar_for_many_bodies(names: list[str]) -> None:
    assert labels_of(names) == [f"all {len(names)} bodies"]


@pytest.mark.parametrize("count", [2, 6])
def test_colours_of_stress(count: int) -> None:
    ratios = [0.0, 1.0, 0.5, 0.5, 1.0, 0.5][:count]
    surface = triangles([f"{i}" for i in range(count)], ratios)
    stress, displacement, contact = figure_panels.panels([surface], Units())
    (colours,) = stress.colours
    assert colours[0].min() > 0.9  # pale
    red = np.array([int(figure_panels.PLASTIC[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    assert np.allclose(colours[np.array(ratios) == 1], red, atol=0.01)
    if count > 2:
        assert np.allclose(colours[2], colours[5])  # all bodies have the same scale
    assert stress.loads
    assert displacement.colours.shape == (1, 3 * count, 3)
    assert contact.facets is not None
    assert contact.facets.tolist() == [False] * (count - 1) + [True]
    opacity = contact.colours[0][:, 3]
    assert (opacity[surface.points[:, 2] > 0] == 1).all()
    assert (opacity[surface.points[:, 2] == 0] < 0.5).all()  # nothing under pressure is hidden
    assert displacement.bars[0][1].vmax == pytest.approx(
        np.linalg.norm(surface.at_points["displacement"], axis=1).max()
    )


def test_slip_and_friction_are_shown_on_contact_surfaces() -> None:
    surface = triangles(["a", "b"], [0.5, 0.5])
    surface.at_points["slip"] = surface.points * [0.0, 0.0, 3.0]
    surface.at_points["friction_stress"] = surface.points * [0.0, 0.0, -40.0]
    shown = figure_panels.panels([surface], Units("mm", "MPa"))
    slip, friction = shown[-2:]
    assert [panel.title.split(",")[0] for panel in shown[-2:]] == ["Slip", "Friction"]
    for panel, largest, unit in ((slip, 3.0, "(mm)"), (friction, 40.0, "(MPa)")):
        _, norm, label = panel.bars[0]
        assert (norm.vmin, norm.vmax) == pytest.approx((0.0, largest))
        assert unit in label
        assert panel.facets.tolist() == [False, True]
    assert len(figure_panels.panels([surface], Units(), middle=False)) == len(shown) - 3


@pytest.mark.parametrize(
    ("largest", "scale"),
    [(0.1, 1.0), (0.099, 1.0), (0.05, 2.0), (3e-5, 2000.0), (40.0, 0.002), (0, 1)],
)
def test_deformation_scale(largest: float, scale: float) -> None:
    field_figure = pytest.importorskip("perfplast_fenicsx.pictures.field_figure")
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0, 0]])
    moved = {"displacement": np.array([[0.0, 0, 0], [0, largest, 0], [0, 0, 0]])}
    none = np.zeros(1, dtype=np.int64)
    no_edges = np.zeros((0, 2), dtype=np.int64)
    surface = Surface(points, np.array([[0, 1, 2]]), no_edges, none, ["a"], moved, {}, {})
    assert field_figure.deformation_scale([surface]) == pytest.approx(scale, rel=1e-12)
    drawn = field_figure.velocity_in_words(scale * largest / surface.size)
    assert drawn.endswith("% of the size of the bodies")
    assert 5 <= float(drawn.split(" % ")[0].split()[-1]) <= 10 or not largest
