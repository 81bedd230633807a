"""Test extensions of an installed package, which the command line finds by their entry points."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from perfplast_fenicsx.extensions import GROUP
from tests.installed_package import ROOT, install, perfplast
from tests.models import steel_blocks_case

pytestmark = pytest.mark.serial

OWN = """
from dataclasses import dataclass

from perfplast_fenicsx import VonMises
from perfplast_fenicsx.materials.laws import MATERIALS


@dataclass(frozen=True)
class HalfAsStrong(VonMises):
    \"\"\"Steel of which nothing but its yield stress differs.

    Args:
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        yield_stress: Yield stress in tension (stress).
    \"\"\"


MATERIALS["half-as-strong"] = HalfAsStrong
"""


def test_a_law_of_a_package_is_known_to_the_command_line(tmp_path: Path) -> None:
    install(tmp_path, "own_law", OWN, GROUP, "law = own_law")
    text = steel_blocks_case(
        '[loading]\ncontrol = "load"\nvalues = [100.0]\n[output]\npictures = false\n'
    ).replace('"von-mises"', '"half-as-strong"', 1)
    (tmp_path / "case.toml").write_text(text)
    run = perfplast("run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r"), folder=tmp_path)
    assert run.returncode == 0, run.stderr
    given = json.loads((tmp_path / "r" / "summary.json").read_text())["given"]
    assert given["materials"]["lower"]["kind"] == "half-as-strong"
    schema = perfplast("schema", folder=tmp_path)
    assert "half-as-strong" in schema.stdout
    line = next(
        a for a in perfplast("info", folder=tmp_path).stdout.splitlines() if "extensions" in a
    )
    assert line.split() == ["extensions", "own-law", "1.5"]


def test_an_extension_in_any_folder(tmp_path: Path) -> None:
    install(tmp_path, "own_law", OWN, GROUP, "law = own_law")
    found = subprocess.run(
        [ROOT / "bin" / "perfplast", "info"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},  # without the repository
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert "own-law 1.5" in found.stdout, found.stderr


FORMAT = """
import numpy as np

from perfplast_fenicsx.cli.mesh_command import MODELS
from perfplast_fenicsx.models.element_types import Block
from perfplast_fenicsx.models.element_types import TETRAHEDRON, ElementType
from perfplast_fenicsx.models.grouped_model import GroupedMesh
from perfplast_fenicsx.models.grouped_model import model_of


def read(path):
    \"\"\"Read a text file of lines: v x y z, t a b c d, g name v v v ...\"\"\"
    rows = [line.split() for line in path.read_text().splitlines()]
    points = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    cells = np.array([row[1:] for row in rows if row[0] == "t"], dtype=int)
    groups = {row[1]: np.array(row[2:], dtype=int) for row in rows if row[0] == "g"}
    block = Block(ElementType(TETRAHEDRON, 4), 0, cells)
    mesh = GroupedMesh(points, [block], {"bar": np.arange(len(cells))}, groups)
    return model_of(mesh)


MODELS[".tets"] = read
"""


def bar() -> str:
    """Return a bar 1 x 1 x 2 of twelve tetrahedra around the diagonals of cubes, as a file."""
    lines = [f"v {x} {y} {z}" for z in range(3) for y in range(2) for x in range(2)]
    paths = [(1, 3), (1, 5), (2, 3), (2, 6), (4, 5), (4, 6)]  # Kuhn's six in a cube
    lines += [f"t {4 * k} {4 * k + a} {4 * k + b} {4 * k + 7}" for k in range(2) for a, b in paths]
    return "\n".join([*lines, "g foot 0 1 2 3", "g head 8 9 10 11", ""])


@pytest.mark.long
def test_a_mesh_format_of_a_package_is_known_to_the_command_line(tmp_path: Path) -> None:
    """The limit load of the bar in tension is its yield stress."""
    install(tmp_path, "own_law", FORMAT, GROUP, "law = own_law")
    (tmp_path / "bar.tets").write_text(bar())
    drawing, made_in = str(tmp_path / "bar.tets"), str(tmp_path / "d")
    made = perfplast("mesh", drawing, "-o", made_in, "--material", "S235", folder=tmp_path)
    assert made.returncode == 0, made.stderr
    case = (tmp_path / "d" / "case.toml").read_text(encoding="utf-8")
    rollers = '"foot"\ncomponents = "z"' + "".join(
        f'\n[[support]]\non = "bar_{axis}_low"\ncomponents = "{axis}"' for axis in "xy"
    )
    case = (
        case.replace('"NAME"', rollers, 1).replace('"NAME"', '"head"').replace('"work"', '"bounds"')
    )
    case = case.replace('until = "limit"', "") + "\n[output]\npictures = false\n"
    (tmp_path / "d" / "case.toml").write_text(case, encoding="utf-8")
    where = str(tmp_path / "d" / "case.toml"), "-o", str(tmp_path / "r")
    run = perfplast("run", *where, "--quiet", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    body = json.loads((tmp_path / "r" / "summary.json").read_text())["limit"]["body"]
    assert [body["lower"], body["upper"]] == pytest.approx([235.0, 235.0], rel=1e-4)


def test_an_extension_that_cannot_be_imported_is_named(tmp_path: Path) -> None:
    install(tmp_path, "own_law", OWN, GROUP, "law = no_such_module")
    run = perfplast("template", folder=tmp_path)
    assert (run.returncode, run.stderr) == (
        2,
        "perfplast: the extension 'law' cannot be imported from no_such_module"
        " (ModuleNotFoundError: No module named 'no_such_module'); repair or uninstall own-law.\n",
    )
