"""Test that ``scene.json`` agrees with the input."""

import json
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Cylinder, Plane, Sphere
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.scene import Scene, read_scene, write_scene
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.problem.declared.loads import BodyForce, Pressure, Traction
from perfplast_fenicsx.units import Units

pytestmark = pytest.mark.serial

SCENE = Scene(
    "A „title“",
    [Traction("top", [0.0, 0.0, -1.0]), BodyForce("upper", [0.0, 0.0, 1.0]), Pressure("left", 2.0)],
    [Contact("upper_bottom", "lower_top", gap="0.1*x")],
    [
        Plane("top", [0.0, 0.0, 3.0], [0.0, 0.0, -1.0], move=[0.0, 0.0, -0.1]),
        Sphere("left", [0.0, 1.0, 2.0], 0.5, hollow=True, move=[]),
        Cylinder("top", [0.0, 1.0, 2.0], [1.0, 0.0, 0.0], 0.5, move=[]),
    ],
    Units("mm", "MPa"),
    axisymmetric=True,
    driven=True,
)


def test_written_and_read(tmp_path: Path) -> None:
    tagged_mesh = build(MPI.COMM_SELF, "two_blocks", n=1)
    path = tmp_path / "scene.json"
    write_scene(SCENE, tagged_mesh, path)
    found = read_scene(json.loads(path.read_text(encoding="utf-8")), "scene.json")
    assert found.scene == SCENE
    assert found.volumes == {"lower": 1, "upper": 2}
    assert found.surfaces == {name: [tag] for name, tag in tagged_mesh.surfaces.items()}
    assert found.scene.marks == {
        "load 0": ["top"],
        "load 1": ["left"],
        "contact": ["lower_top", "top", "left", "top"],
        "opposite": ["upper_bottom"],
    }


def test_arrays_are_written_as_lists(tmp_path: Path) -> None:
    tagged_mesh = build(MPI.COMM_SELF, "two_blocks", n=1)
    path = tmp_path / "scene.json"
    write_scene(Scene("", [Traction("top", np.array([0.0, 0.0, -1.0]))]), tagged_mesh, path)
    (load,) = json.loads(path.read_text(encoding="utf-8"))["loads"]
    assert load["value"] == [0.0, 0.0, -1.0]
    assert load["kind"] == "traction"


@pytest.mark.parametrize(
    ("table", "part"),
    [
        ({}, "'title' is missing"),
        ({"loads": [{"kind": "push", "on": "top", "value": 1}]}, "kind = 'push' is unknown"),
        ({"units": {"mass": "kg"}}, "no key 'mass'"),
    ],
)
def test_what_is_no_model(table: dict, part: str) -> None:
    names = ("loads", "contacts", "obstacles")
    whole = {"title": "", "volumes": {}, "surfaces": {}, "units": {}} | {name: [] for name in names}
    with pytest.raises(InputError, match=part):
        read_scene(whole | table if table else {}, "scene.json")


def test_units_in_legends() -> None:
    plane = Scene("", units=Units("mm", "MPa"))
    assert [plane.unit_of_work(2), SCENE.unit_of_work(2)] == ["N mm/mm", "N mm"]
    assert [plane.view, SCENE.view] == ["", ",   axisymmetric about z"]
