"""Extensions of an installed package, which the command line finds by their entry point."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from perfplast_fenicsx import Contact, Support, VonMises
from perfplast_fenicsx.extensions import GROUP
from tests.models import case_text

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]

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


def perfplast(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "perfplast_fenicsx", *arguments],
        env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def install(folder: Path, module: str) -> None:
    """Install a package of one module by hand, as pip does it."""
    (folder / "own_law.py").write_text(OWN, encoding="utf-8")
    about = folder / "own_law-1.5.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: own-law\nVersion: 1.5\n")
    (about / "entry_points.txt").write_text(f"[{GROUP}]\nlaw = {module}\n")


def test_a_law_of_a_package_is_known_to_the_command_line(tmp_path: Path) -> None:
    install(tmp_path, "own_law")
    steel = VonMises(2e5, 0.3, 300.0)
    text = case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": steel, "upper": steel},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        contacts=[Contact("lower_top", "upper_bottom")],
        more='[loading]\ncontrol = "load"\nvalues = [100.0]\n[output]\npictures = false\n',
    ).replace('"von-mises"', '"half-as-strong"', 1)
    (tmp_path / "case.toml").write_text(text)
    run = perfplast(tmp_path, "run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r"))
    assert run.returncode == 0, run.stderr
    given = json.loads((tmp_path / "r" / "summary.json").read_text())["given"]
    assert given["materials"]["lower"]["kind"] == "half-as-strong"
    schema = perfplast(tmp_path, "schema")
    assert "half-as-strong" in schema.stdout
    line = next(a for a in perfplast(tmp_path, "info").stdout.splitlines() if "extensions" in a)
    assert line.split() == ["extensions", "own-law", "1.5"]


def test_an_extension_that_cannot_be_imported_is_named(tmp_path: Path) -> None:
    install(tmp_path, "no_such_module")
    run = perfplast(tmp_path, "template")
    assert (run.returncode, run.stderr) == (
        2,
        "perfplast: the extension 'law' cannot be imported from no_such_module"
        " (ModuleNotFoundError: No module named 'no_such_module'); mend or uninstall own-law.\n",
    )
