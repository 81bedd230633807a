"""Test the checker on squares for which an attack proved false bounds."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check, check_halves, check_lower, check_upper
from perfplast_fenicsx.proof.halves import differences
from perfplast_fenicsx.proof.plain_arrays import ProofError
from tests.proof.forging import Arrays, write
from tests.proof.small_bodies import (
    BOTTOM,
    LEFT,
    RIGHT,
    ROUNDED,
    TOP,
    UNDONE,
    UNLIKE,
    adhering_square,
    beside_a_fast_body,
    columns_under_a_plate,
    cut_square,
    hanging_square,
    plate_with_free_load,
    pulled_square,
    pushed_square,
    squares,
    stacked_walls,
    thin_triangles,
    unlike_halves,
    unloaded_square,
    with_stress,
    with_velocity,
)
from tests.proof.test_balance import row_of_cubes


@pytest.mark.parametrize(("x", "force"), [(0.0, (0.0, 1.0)), (4e6, (0.0, 1.0)), (0.0, (1e7, 1.0))])
def test_a_free_load_that_cancels_the_load_of_a_plate(x: float, force: tuple[float, float]) -> None:
    """Held components, and moments about a distant origin, can do no work."""
    found = check_upper(plate_with_free_load(x, force))
    assert found.proven is None
    assert any("work of others" in fault for fault in found.faults)


def test_guides_beside_held_components() -> None:
    """A guide that locks an elastic square is not one that lets it slide."""
    bodies = [Body.of(pulled_square((1.0, y))) for y in (9e-10, 0.0, 5e-10)]
    assert "supports" in differences(bodies[0], bodies[1])[0]
    assert not differences(bodies[0], bodies[2])
    lower = with_stress(pulled_square((1.0, 9e-10)), [[0, 0], [0, 1]], [[0, 0], [0, 0]])
    upper = with_velocity(pulled_square((1.0, 0.0)), lambda x, y: (-x, y) if x < 2 else (0, 0), 1.5)
    assert all(half.faults for half in check_halves({"lower": lower, "upper": upper}).values())


def test_obstacles_must_have_equal_normals() -> None:
    bodies = []
    for y in (0.0, 9e-10):
        them = squares((0.0, 0.0)) | {"obstacles": np.array([1 + RIGHT])}
        them["held"][BOTTOM] = 1
        normal = np.array([[-1.0, y]])
        bodies.append(Body.of(them | {"obstacle_normals": normal / np.linalg.norm(normal)}))
    assert differences(*bodies)
    assert not differences(bodies[0], bodies[0])


@pytest.mark.parametrize("of", ROUNDED)
def test_nearly_supported_numbers_are_refused(of: Callable[[], Arrays], tmp_path: Path) -> None:
    with pytest.raises(ProofError):
        check(write(tmp_path / "lower.h5", {"lower": of()}))
    plain = check(write(tmp_path / "plain.h5", {"lower": unloaded_square()}))
    assert plain["lower"].proven == 0.0


def test_contact_does_not_pass_a_body_in_between() -> None:
    """The middle square's top is split, so only the square behind it matches the first square."""
    them = squares((0.0, 4.0), (0.0, 2.0), (0.0, 0.0))
    them["vertices"] = np.append(them["vertices"], [[0.5, 3.0]], axis=0)
    them["cells"] = np.append(them["cells"], [[6, 7, 12]], axis=0)
    them["cells"][2:4] = [[4, 5, 12], [5, 6, 12]]
    them["cells"][6] = [4, 12, 7]
    for name in ("cone", "body_force"):
        them[name] = np.append(them[name], them[name][:1], axis=0)
    them["facets"] = np.append(them["facets"], [[12, 7]], axis=0)
    them["facets"][4 + TOP] = [6, 12]
    for name in ("held", "traction"):
        them[name] = np.append(them[name], them[name][:1], axis=0)
    them["surface"] = np.append(them["surface"], 5 + TOP)
    them["surface"][8 + TOP] = 5 + TOP
    them["held"][[4 + BOTTOM, 8 + BOTTOM]] = 1
    them["held"][LEFT, 0] = 1
    them["traction"][TOP, :, 1] = -1.0
    them["contacts"] = np.array([[1 + BOTTOM, 5 + TOP]])
    stress = np.zeros((7, 3, 2, 2))
    stress[[0, 1, 4, 5], :, 1, 1] = -1.0
    found = check_lower(them | {"stress": stress})
    assert any("no matching opposite facet" in fault for fault in found.faults)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_block_slides_between_opposite_guides(sign: float) -> None:
    """Normals g and −g are one direction. The block slides upwards along an obstacle."""
    them = row_of_cubes(1)
    sides = them["vertices"][them["facets"]]
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    guided = np.zeros((len(sides), 3))
    guided[(sides[..., 0] == 1).all(axis=1)] = turn[:, 0]
    guided[(sides[..., 0] == 0).all(axis=1)] = sign * turn[:, 0]
    count = len(sides)
    them |= {
        "vertices": them["vertices"] @ turn.T,
        "cone": np.full(6, -1),
        "cone_bound": np.zeros(0),
        "cone_slope": np.zeros((0, 6)),
        "cone_matrix": np.zeros((0, 6, 6)),
        "cone_sine": np.zeros(0),
        "body_force": np.tile([0.0, 0.0, 1.0], (6, 1)),
        "surface": np.where((sides[..., 1] == 0).all(axis=1), 1, 0),
        "held": np.zeros((count, 3), dtype=np.uint8),
        "guided": guided,
        "traction": np.zeros((count, 3, 3)),
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.ones(1, dtype=int),
        "obstacle_normals": turn[:, 1][None],
        "obstacle_adhesion": np.ones(1),
        "obstacle_friction": np.zeros(1),
    }
    found = check_upper(with_velocity(them, lambda *_: (0.0, 0.0, 1.0), 1.0001))
    assert found.reached == pytest.approx(1.0)


def test_a_floating_body_carries_no_load() -> None:
    """Adhesion transfers the load to it, but nothing holds it."""
    assert check_lower(adhering_square()).proven is None


def test_strength_factors_do_not_apply_to_tensile_strength() -> None:
    with pytest.raises(ProofError, match="cell_strength"):
        Body.of(cut_square())


def test_a_held_plate_holds_each_column() -> None:
    """The residual forces of both columns pass to the support of the plate."""
    them = columns_under_a_plate((1, 0))
    assert check_lower(them).proven == pytest.approx(1 / 3)


@pytest.mark.parametrize("kind", UNLIKE)
def test_halves_that_differ_by_more_than_rounding(kind: str) -> None:
    """Free loads without work, or large loads that supports carry, multiply small differences."""
    for by, unlike in ((9e-10, True), (0.0, False)):
        found = check_halves(unlike_halves(kind, by))["lower"]
        assert any("the halves have different" in fault for fault in found.faults) == unlike


@pytest.mark.parametrize("speed", [0.0, 1e7])
def test_a_fast_body_hides_no_work_of_free_loads(speed: float) -> None:
    found = check_upper(beside_a_fast_body(speed))
    assert found.proven is None
    assert any("work of others" in fault for fault in found.faults)


def test_tags_beyond_the_numbers_of_a_page_are_refused() -> None:
    them = with_velocity(squares((0.0, 0.0)), lambda x, y: (0.0, 0.0), 1.0)
    them["surface"][0] = 2**53 + 1
    with pytest.raises(ProofError, match="surface has numbers that are too large"):
        check_upper(them)


@pytest.mark.parametrize("last", ["nothing", "obstacle", "square"])
def test_volume_does_not_pass_a_contact_into_a_third_surface(last: str) -> None:
    """The pushed square must not enter the third surface when it pushes its neighbour."""
    found = check_upper(pushed_square(last))
    assert (found.proven is None) == (last != "nothing")


@pytest.mark.parametrize("width", [1.0, 5e-7])
def test_thin_walls_are_in_contact(width: float) -> None:
    """A wall can be thinner than a millionth of its length."""
    assert any(
        "no matching opposite facet" in of for of in check_upper(stacked_walls(width)).faults
    )
    apart = stacked_walls(width) | {"contacts": np.zeros((0, 2), dtype=int)}
    assert check_upper(apart).proven == 0


@pytest.mark.parametrize("width", [5e-7, 2e-11])
def test_a_narrow_strip_connects_bodies(width: float) -> None:
    """A strip of elastic material carries any load, however narrow it is."""
    for half in check_halves(hanging_square(width)).values():
        assert half.proven is None
        assert half.reached == pytest.approx(1.1, rel=0.1)


def test_rounding_does_not_hide_the_height_of_a_body() -> None:
    """The heights differ by much more than rounding, but the coordinates are much larger."""
    for half in check_halves(thin_triangles(0.4375, 0.75, 6e10)).values():
        assert half.proven is None
        assert half.reached is not None
    for half in check_halves(thin_triangles(0.75, 0.75, 6e10)).values():
        assert not half.faults


def test_loads_and_contacts_may_be_missing() -> None:
    them = columns_under_a_plate((1, 0))
    for name in ("body_force", "traction", "contacts", "obstacles", "obstacle_normals"):
        del them[name]
    assert check_lower(them).proven == pytest.approx(1 / 3)


@pytest.mark.parametrize("name", UNDONE)
def test_the_flow_that_undoes_volume_changes_does_work(name: str) -> None:
    make, (words, _) = UNDONE[name]
    found = check_upper(make())
    assert found.proven is None
    assert any(words in fault for fault in found.faults), found.faults
