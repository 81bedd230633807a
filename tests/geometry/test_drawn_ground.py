"""Test ground that is drawn by coordinates: bodies, sides, and refusals with the place."""

import itertools

import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround, DrawnLine, Region, Stratum

pytestmark = pytest.mark.serial

SLOPE: list[list[float]] = [[0.0, 0], [60, 0], [60, 10], [40, 10], [20, 20], [0, 20]]


def square(x: float, y: float, size: float = 4.0) -> list[list[float]]:
    return [[x, y], [x + size, y], [x + size, y + size], [x, y + size]]


def lengths(ground: DrawnGround) -> dict[str, float]:
    """Return the length of each whole side."""
    outline = ground.outline()
    ends = outline.plan.points[outline.plan.edges]
    each = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return {name: float(each[edges].sum()) for name, edges in outline.sides.items()}


def areas(ground: DrawnGround) -> dict[str, float]:
    outline = ground.outline()
    found = dict.fromkeys(outline.names, 0.0)
    for face, body in zip(outline.plan.faces, outline.face_body, strict=True):
        if body >= 0:
            found[outline.names[body]] += face.area
    return found


def test_sides_of_a_slope() -> None:
    for points in (SLOPE, SLOPE[::-1], [*SLOPE, SLOPE[0]], SLOPE[3:] + SLOPE[:3]):
        ground = DrawnGround([Region("soil", points)])
        assert areas(ground) == {"soil": pytest.approx(60 * 10 + 20 * 10 + 100)}
        slanting = float(np.hypot(20, 10))
        assert lengths(ground) == pytest.approx(
            {"left": 20, "base": 60, "right": 10, "surface": 40 + slanting}
        )


def test_a_base_that_is_not_level_and_an_end_that_is_a_point() -> None:
    ground = DrawnGround([Region("soil", [[0, 5], [30, -5], [60, 0], [60, 10], [20, 20]])])
    assert list(lengths(ground)) == ["base", "right", "surface"]
    assert lengths(ground)["base"] == pytest.approx(np.hypot(30, 10) + np.hypot(30, 5))


def test_regions_that_share_a_part_of_a_side() -> None:
    ground = DrawnGround([Region("a", square(0, 0)), Region("b", [[4, 1], [8, 1], [8, 3], [4, 3]])])
    script = ground.script()
    assert script.count("Physical Surface") == 2
    assert areas(ground) == pytest.approx({"a": 16, "b": 8})
    assert lengths(ground)["surface"] == pytest.approx(4 + 1 + 4)


STRATA = [
    Stratum("fill", [[0, 12], [10, 12], [20, 8], [40, 8]]),
    Stratum("seam", [[0, 9], [10, 8], [20, 8], [40, 8]]),
    Stratum("clay", [[0, 8], [40, 8]], bottom=0.0),
]


def test_strata_end_where_they_have_no_thickness() -> None:
    ground = DrawnGround(strata=STRATA)
    assert areas(ground) == pytest.approx({"fill": 35 + 20, "seam": 5, "clay": 320})
    assert lengths(ground) == pytest.approx(
        {"left": 12, "base": 40, "right": 8, "surface": 30 + np.hypot(10, 4)}
    )
    cut = Stratum("cut", [[0, 10], [5, 10], [5, 6], [20, 6]], bottom=[[0, 0], [20, -2]])
    assert areas(DrawnGround(strata=[cut])) == pytest.approx({"cut": 50 + 90 + 20})


def test_an_opening_is_cut_out_and_names_its_boundary() -> None:
    tunnel = Region("tunnel", square(10, 2), opening=True)
    ground = DrawnGround([tunnel], strata=STRATA)
    assert areas(ground)["clay"] == pytest.approx(320 - 16)
    assert 'Physical Curve("tunnel")' in ground.script()
    assert list(lengths(ground)) == ["left", "base", "right", "surface"]


def test_lines_name_the_boundary_or_divide_cells() -> None:
    pad = DrawnLine("pad", [[5, 20], [15, 20]])
    seam = DrawnLine("seam", [[10, 2], [30, 3]])
    ground = DrawnGround([Region("soil", SLOPE)], lines=[pad, seam])
    assert "In Surface" in ground.script() and 'Physical Curve("seam")' not in ground.script()
    assert ground.remarks() == [
        "the line 'seam' lies inside 'soil': mesh edges follow it, but it names no surface"
    ]
    outline = ground.outline()
    on = outline.plan.owners[:, outline.first_line]
    assert outline.plan.points[outline.plan.edges[on]][:, :, 1] == pytest.approx(20)


def test_ground_of_several_parts_has_no_sides() -> None:
    ground = DrawnGround([Region("a", square(0, 0)), Region("b", square(10, 0))])
    assert lengths(ground) == {}
    assert "several parts" in ground.remarks()[0]
    ground = DrawnGround([Region("a", square(0, 0)), Region("b", square(4, 4))])
    assert "touches itself at (4, 4)" in ground.remarks()[0]


@pytest.mark.parametrize(
    ("ground", "words"),
    [
        (
            {"regions": [Region("a", square(0, 0)), Region("b", square(3, 3))]},
            r"'a' and 'b' overlap",
        ),
        (
            {"regions": [Region("a", square(0, 0)), Region("b", square(1, 1, 2))]},
            r"area of 4 around",
        ),
        (
            {
                "regions": [
                    Region("a", [[0, 0], [9, 0], [9, 2], [5, 2], [3, 2], [0, 2]]),
                    Region("b", [[0, 2], [3, 2], [4, 3], [5, 2], [9, 2], [9, 5], [0, 5]]),
                ]
            },
            r"'b', with an area of 1, around \(4, 2\.33333\)",
        ),
        ({"regions": [Region("a", square(0, 0)), Region("b", square(4.00002, 0))]}, "2e-05 away"),
        ({"regions": [Region("a", [[0, 0], [4, 4], [4, 0], [0, 4]])]}, r"itself at \(2, 2\)"),
        (
            {"regions": [Region("a", [[0, 0], [8, 0], [8, 4], [4, 0], [0, 4]])]},
            r"itself at \(4, 0\)",
        ),
        ({"regions": [Region("a", [[0, 0], [4, 0], [8, 0]])]}, "no area"),
        ({"regions": [Region("a", [[0, 0], [9, 0], [4, 0], [4, 4]])]}, r"itself at \(4, 0\)"),
        ({"regions": [Region("a", [[0, 0], [4, 0]])]}, "2 points; give at least 3"),
        ({"regions": [Region("a", [[0, 0], [4, 0, 1], [4, 4]])]}, r"contains \[4, 0, 1\]"),
        (
            {"regions": [Region("a", [[0, 0], [0, 0], [4, 0], [4, 4]])]},
            r"contains the point \(0, 0\) twice",
        ),
        ({"regions": [Region("a", square(0, 0))] * 2}, "'a' is given 2 times"),
        ({"regions": [Region("Soft clay", square(0, 0))]}, "such as 'soft_clay'"),
        ({"regions": [Region("left", square(0, 0))]}, "reserved for a side"),
        ({"regions": [Region("a", square(0, 0), opening=True)]}, "no ground"),
        (
            {"regions": [Region("a", square(1, 1, 1)), Region("b", square(0, 0), opening=True)]},
            "no ground|cover the whole area",
        ),
        (
            {"regions": [Region("s", SLOPE)], "lines": [DrawnLine("l", [[10, 20], [30, 20]])]},
            r"'l' is outside the ground at \(25, 20\)",
        ),
        (
            {
                "regions": [Region("s", SLOPE)],
                "lines": [DrawnLine("l", [[0, 20], [20, 20], [20, 5]])],
            },
            r"\(10, 20\) and inside one region at \(20, 12\.5\)",
        ),
        ({"strata": [STRATA[0], STRATA[1]]}, "'seam', has no bottom"),
        ({"strata": [STRATA[2], STRATA[0]]}, "'clay' has a bottom"),
        (
            {"strata": [STRATA[1], Stratum("clay", [[0, 10], [40, 8]], 0.0)]},
            "the top of 'seam' at x = 10",
        ),
        ({"strata": [STRATA[0], Stratum("clay", [[0, 8], [30, 8]], 0.0)]}, "goes from x = 0 to 30"),
        ({"strata": [Stratum("a", [[0, 8], [9, 8], [5, 7], [20, 7]], 0.0)]}, r"between \(9, 8\)"),
        ({"strata": [STRATA[0], Stratum("b", STRATA[0].top, 0.0)]}, "the same line"),
    ],
)
def test_what_is_refused_is_named_with_its_place(ground: dict[str, list], words: str) -> None:
    with pytest.raises(InputError, match=words):
        DrawnGround(**ground)


def test_random_blocks_tile_their_square() -> None:
    """Regions between random lines from side to side share all their sides."""
    rng = np.random.default_rng(3)
    xs = np.array([0, *np.sort(rng.uniform(0, 9, 3)), 9])
    levels = np.sort(rng.uniform(0, 9, (3, len(xs))), axis=0)
    rows = np.vstack([np.zeros(len(xs)), levels, np.full(len(xs), 9.0)])
    regions = [
        Region(
            f"r{i}_{j}",
            [[xs[j], low[j]], [xs[j + 1], low[j + 1]], [xs[j + 1], high[j + 1]], [xs[j], high[j]]],
        )
        for (i, (low, high)), j in itertools.product(
            enumerate(itertools.pairwise(rows)), range(len(xs) - 1)
        )
    ]
    ground = DrawnGround(regions)
    assert sum(areas(ground).values()) == pytest.approx(81)
    assert lengths(ground) == pytest.approx(dict.fromkeys(("left", "base", "right", "surface"), 9))
