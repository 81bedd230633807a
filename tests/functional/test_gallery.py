"""Test the gallery of real structures, from geometry files to limit loads, on small meshes."""

import json
import math
import shutil
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from meshes.bolted_bracket import write_bolted_bracket
from meshes.engine_bracket import write_engine_bracket
from perfplast_fenicsx.__main__ import main

pytestmark = pytest.mark.serial

GALLERY = Path(__file__).resolve().parents[2] / "docs" / "gallery"

COARSE = {
    "bolted_bracket": {
        "size = 12.0": "size = 40.0\ncurvature = 4",
        "bracket = 5.0": "bracket = 40.0",
    },
    "lug": {"size = 5.0": "size = 9.0\ncurvature = 6"},
    "nozzle": {"size = 16.0": "size = 60.0", "curvature = 32": "curvature = 10"},
    "press_fit": {"size = 1.0": "size = 6.0", "curvature = 48": "curvature = 16"},
    "slope": {"size = 1.0": "size = 2.0"},
    "retaining_wall": {"size = 1.5": "size = 2.5", "cells = 2500": "cells = 250"},
    "arch": {},
    "footing": {"size = 1.5": "size = 3.0", "cells = 2500": "cells = 250", "path = true": ""},
    "dovetail": {"size = 1.5": "size = 5.0", "{blade = 1.0}": "{blade = 3.0}"},
    "engine_bracket": {"size = 9.0": "size = 30.0\ncurvature = 6", "cells = 4500": "cells = 10"},
}
"""Changes in the cases that give small meshes."""

STEP = {"bolted_bracket": write_bolted_bracket, "engine_bracket": write_engine_bracket}
"""Functions that write the geometry of cases without a script."""


def run_small(folder: Path, name: str) -> dict[str, Any]:
    """Run a case of the gallery on a coarse mesh, and return its summary. Collective."""
    case = folder / f"{name}.toml"
    if MPI.COMM_WORLD.rank == 0:
        if name in STEP:
            STEP[name](folder / f"{name}.step")
        else:
            shutil.copy(GALLERY / f"{name}.geo", folder)
        text = (GALLERY / f"{name}.toml").read_text(encoding="utf-8")
        for old, new in COARSE[name].items():
            assert old in text
            text = text.replace(old, new)
        case.write_text(f"{text}\n[output]\nfields = false\npictures = false\n", encoding="utf-8")
    MPI.COMM_WORLD.barrier()
    assert main(["run", str(case), "-o", str(folder / name), "--quiet", "--trust"]) == 0
    found = folder / name / "summary.json"  # each combination has a summary
    return dict(json.loads(found.read_text(encoding="utf-8"))) if found.is_file() else {}


@pytest.mark.long(but=["nozzle-23.8"])
@pytest.mark.parametrize(
    ("name", "limit"),
    [("bolted_bracket", 15.59), ("lug", 106.8), ("nozzle", 23.8), ("slope", 288.0)],
)
def test_limit_loads(shared_tmp_path: Path, name: str, limit: float) -> None:
    """The known limits come from such coarse meshes, with gmsh 4.13 and other versions."""
    found = run_small(shared_tmp_path, name)["limit"]
    assert found["levelled_off"]
    assert found["estimate"] == pytest.approx(limit, rel=0.05)


def test_arch(shared_tmp_path: Path) -> None:
    """With rigid stones both bounds equal the collapse acceleration on any mesh."""
    body = run_small(shared_tmp_path, "arch")["limit"]["body"]
    assert body["strict"]
    assert body["lower"] == pytest.approx(body["upper"], rel=1e-9)
    assert body["upper"] == pytest.approx(0.37, abs=5e-3)


@pytest.mark.long
def test_dovetail(shared_tmp_path: Path) -> None:
    """A neck of 12 mm carries at most 2/√3 of its yield stress."""
    limit = run_small(shared_tmp_path, "dovetail")["limit"]["estimate"]
    assert limit == pytest.approx(575.0, rel=0.05)
    assert limit < 2 / math.sqrt(3) * 830


def test_press_fit(shared_tmp_path: Path) -> None:
    """Lamé's pressure acts between two tubes of one elastic material, in plane strain."""
    a, c, b, interference, young, poisson = 8.0, 20.0, 40.0, 0.03, 210e3, 0.3
    softness = (b**2 + c**2) / (b**2 - c**2) + (c**2 + a**2) / (c**2 - a**2)
    pressure = interference * young / (1 - poisson**2) / (c * softness)
    at_rest = run_small(shared_tmp_path, "press_fit")["steps"][0]
    (force,) = [f for name, f in at_rest["reactions"].items() if name.startswith("contact")]
    assert [abs(component) for component in force] == pytest.approx([pressure * c] * 2, rel=1e-3)


def test_parts_have_names_in_each_file_of_a_process(tmp_path: Path) -> None:
    texts = []
    for name in ("first.step", "second.step"):
        write_bolted_bracket(tmp_path / name)
        texts.append((tmp_path / name).read_text(encoding="ascii"))
    for text in texts:
        assert all(f"PRODUCT('{part}'" in text for part in ("wall", "bracket", "bolt_1", "nut_4"))


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "stands", "falls"), [("retaining_wall", 1.1939, 1.2350), ("footing", 1.3720, 1.3918)]
)
def test_a_factor_of_safety(shared_tmp_path: Path, name: str, stands: float, falls: float) -> None:
    """On finer meshes F is between both bounds."""
    found = run_small(shared_tmp_path, name)["limit"]["strength"]
    assert 0.65 * stands < found["lower"] < falls
    assert stands < found["upper"] < 1.35 * falls


@pytest.mark.long
def test_four_loads_of_one_bracket(shared_tmp_path: Path) -> None:
    """On a coarse mesh each limit load lies between both bounds, which are wider apart."""
    run_small(shared_tmp_path, "engine_bracket")
    loads = {
        "vertical": (17.09, 22.28),
        "horizontal": (13.55, 17.94),
        "oblique": (14.31, 19.92),
        "twisted": (8.912, 12.07),
    }
    for name, (lower, upper) in loads.items():
        text = (shared_tmp_path / "engine_bracket" / name / "summary.json").read_text()
        body = json.loads(text)["limit"]["body"]
        assert 0.75 * lower < body["lower"] < upper
        assert lower < body["upper"] < 1.25 * upper
