"""Test the wheel: its content, and that the command works from it, without the sources."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from mpi4py import MPI

import pytest

from docs.man_page import man_page
from perfplast_fenicsx import Contact, Elastic, Support, VonMises
from perfplast_fenicsx.environment import environment_apart
from tests.models import case_text
from tests.test_walls import BELOW

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="a program that uses MPI cannot start another"
)

CASE = case_text(
    {"builder": "stacked_blocks", "n": 1},
    {"lower": Elastic(2e5, 0.3), "upper": VonMises(2e5, 0.3, 300.0)},
    [Support("bottom"), Support("x0", "x"), Support("y0", "y")],
    contacts=[Contact("lower_top", "upper_bottom")],
    more="[loading]\nvalues = [100.0]\n[output]\nfields = false\npictures = false\n",
)


COMPLETE = """PATH=$0:$PATH
. "$1/bash-completion/completions/perfplast"
COMP_LINE='perfplast ru' COMP_POINT=12 COMP_TYPE=9 COMP_WORDBREAKS=' '
_python_argcomplete perfplast
echo "${COMPREPLY[@]}"
"""
"""Script for completion in bash, with the folders of commands and shared files."""


def run(*command: str | Path, cwd: Path) -> str:
    """Return the output of a command; a failed command fails the test."""
    environment = environment_apart()
    environment.pop("PYTHONPATH", None)
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{done.args}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel from a copy of the sources, because building leaves files in them."""
    folder = tmp_path_factory.mktemp("wheel")
    unwanted = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "perfplast_fenicsx", folder / "perfplast_fenicsx", ignore=unwanted)
    shutil.copytree(ROOT / "share", folder / "share")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    offline = ("--no-deps", "--no-build-isolation", "--no-index")
    run(sys.executable, "-m", "pip", "wheel", *offline, "-w", "dist", ".", cwd=folder)
    (found,) = (folder / "dist").glob("*.whl")
    return found


def test_the_wheel_holds_every_module(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    files = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "perfplast_fenicsx").rglob("*")
        if path.suffix in (".py", ".pyi", ".typed", ".html", ".css", ".js")
    }
    assert files <= held
    assert {f"perfplast_fenicsx/{room.replace('.', '/')}/__init__.py" for room in BELOW} <= held


def test_the_man_page_is_that_of_the_parser() -> None:
    page = (ROOT / "share" / "man" / "man1" / "perfplast.1").read_text(encoding="utf-8")
    remedy = "./fenicsx python3 -m docs.man_page > share/man/man1/perfplast.1"
    assert page == man_page(), remedy
    for command in ("run", "plot", "materials"):
        assert f"\n.SS perfplast {command}\n" in page


@pytest.mark.long
def test_the_command_of_an_installed_wheel(wheel: Path, tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    run(sys.executable, "-m", "venv", "--system-site-packages", venv, cwd=tmp_path)
    # if the system also has the package, pip would use that package
    offline = ("--ignore-installed", "--no-deps", "--no-index", "--quiet")
    run(venv / "bin/python3", "-m", "pip", "install", *offline, wheel, cwd=tmp_path)
    code = "import perfplast_fenicsx.io.case.case as case; print(case.__file__)"
    where = run(venv / "bin/python3", "-c", code, cwd=tmp_path)
    assert where.startswith(str(venv))
    shown = run("bash", "-c", COMPLETE, venv / "bin", venv / "share", cwd=tmp_path)
    assert (venv / "share" / "man" / "man1" / "perfplast.1").exists()
    assert shown.split() == ["run"]
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    told = run(venv / "bin/perfplast", "run", "case.toml", "-o", "results", cwd=tmp_path)
    assert "zeta" in told or "ζ" in told
    assert (tmp_path / "results" / "summary.json").exists()
