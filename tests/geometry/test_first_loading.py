"""Test the loading of a first case."""

import tomllib

import pytest

from perfplast_fenicsx.geometry import MeshingOptions, Survey
from perfplast_fenicsx.geometry.first_case import loading_for
from perfplast_fenicsx.geometry.survey import Body, Joint

pytestmark = pytest.mark.serial


def survey(cells: int = 100, dim: int = 3, degree: int = 1, shape: str = "flat") -> Survey:
    bodies = [Body(a, a, 1.0, (0.0,) * 3, (1.0,) * 3, cells // 2, 1.0) for a in ("lid", "box")]
    joint = Joint(("lid", "box"), ("lid_joint_1", "box_joint_1"), 1.0, (shape,))
    return Survey(dim, degree, 4, bodies, [joint])


def asked(found: Survey, apart: bool = False) -> tuple[dict, str]:
    options = MeshingOptions(meshed="apart" if apart else "together")
    text = loading_for(found, options)
    return tomllib.loads(text), text


def test_bounds_on_finer_meshes() -> None:
    case, _ = asked(survey(4213))
    assert case["loading"] == {"control": "bounds", "limit_tolerance": 5e-3}
    assert case["mesh"]["adapt"] == {"until": 0.1, "cells": 12000}


def test_bounds_on_one_mesh() -> None:
    case, text = asked(survey(7_500))
    assert case == {"loading": {"control": "bounds"}}
    assert "7500 elements take long" in text


@pytest.mark.parametrize(
    ("found", "apart", "why"),
    [
        (survey(), True, "need matching nodes"),
        (survey(degree=2), False, "curved elements"),
        (survey(40_000), False, "40000 elements"),
    ],
)
def test_estimates_say_why(found: Survey, apart: bool, why: str) -> None:
    case, text = asked(found, apart)
    assert case["loading"] == {"control": "work", "until": "limit"}
    assert why in text


def test_curved_faces_are_as_good_as_flat_ones() -> None:
    case, _ = asked(survey(4213, shape="cylindrical"))
    assert case["loading"] == {"control": "bounds", "limit_tolerance": 5e-3}
    assert case["mesh"]["adapt"] == {"until": 0.1, "cells": 12000}


def test_plane_bodies_that_are_meshed_apart() -> None:
    for shape in ("straight", "circular"):
        plane = survey(4213, dim=2, shape=shape)
        assert asked(plane, True)[0]["loading"]["control"] == "bounds"


def test_the_plane_is_cheaper() -> None:
    assert "mesh" in asked(survey(13_000, dim=2, shape="straight"))[0]
