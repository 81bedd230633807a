"""Test a kind of cone from outside the package: one file and an entry point, in whole runs."""

import json
import math
import subprocess
from pathlib import Path

import pytest

from perfplast_fenicsx import DruckerPrager
from perfplast_fenicsx.extensions import GROUP
from tests.installed_package import install, perfplast

pytestmark = pytest.mark.serial

OWN = Path(__file__).with_name("two_cones.py").read_text(encoding="utf-8")
TENSION = 8.0

GROUND = f"""
law = "two-cones"
young = 1e4
poisson = 0.3
cohesion = 10.0
friction_angle = 25.0
match = "compression"
tension = {TENSION}
"""

CASE = f"""
mesh = {{builder = "stacked_blocks", n = 1}}
[material.lower]{GROUND}[material.upper]{GROUND}[[support]]
on = "x0"
components = "x"
[[support]]
on = "y0"
components = "y"
[[support]]
on = "bottom"
components = "z"
[[tie]]
primary = "lower_top"
secondary = "upper_bottom"
[[load]]
on = "top"
pressure = SIGN
[element]
degree = 2
[loading]
LOADING
[output]
pictures = false
"""


def carried(sign: float) -> float:
    """Return the uniaxial strength in compression (1) or tension (−1), from the weaker cone."""
    eta, strength = DruckerPrager(1e4, 0.3, 10.0, 25.0, "compression").cone
    cones = [(strength, eta), (2 * eta * TENSION, 2 * eta)]
    limits = [c / (1 / math.sqrt(3) - sign * a / 3) for c, a in cones]
    return min(it for it in limits if it > 0)


def run(
    folder: Path, sign: float, loading: str, ranks: int = 1
) -> subprocess.CompletedProcess[str]:
    install(folder, "two_cones", OWN, GROUP, "law = two_cones")
    text = CASE.replace("SIGN", str(sign)).replace("LOADING", loading)
    (folder / "case.toml").write_text(text)
    case, results = str(folder / "case.toml"), str(folder / "r")
    return perfplast("run", case, "-o", results, ranks=ranks, folder=folder)


@pytest.mark.long(but=["1.0-1"])
@pytest.mark.parametrize(("sign", "ranks"), [(1.0, 1), (-1.0, 2)])
def test_a_whole_run(tmp_path: Path, sign: float, ranks: int) -> None:
    """The first cone bounds compression, the second one tension."""
    done = run(tmp_path, sign, 'control = "work"\nuntil = "limit"\nlimit_tolerance = 1e-6', ranks)
    assert done.returncode == 0, done.stderr
    limit = json.loads((tmp_path / "r" / "summary.json").read_text())["limit"]
    assert limit["method"] == "interior-point"
    assert "a proof file cannot contain the yield set" in done.stdout
    assert limit["lower"] == pytest.approx(carried(sign), rel=2e-6)
    assert limit["upper"] == pytest.approx(carried(sign), rel=2e-6)


def test_bounds_have_no_proof_for_it(tmp_path: Path) -> None:
    done = run(tmp_path, 1.0, 'control = "bounds"')
    assert done.returncode == 2
    assert "yield set of CutLaw (volume 'lower')" in done.stderr
