"""Test the page that compares two runs: numbers, different units, cases, and refusals."""

import re
import shutil
from pathlib import Path

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.beside import apart
from tests.functional.test_bolted_run import CASE, PRELOAD

pytestmark = pytest.mark.serial


def ran(folder: Path, name: str, *changes: tuple[str, str]) -> Path:
    """Return the results of the case after a replacement of words."""
    text = CASE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    case, results = folder / f"{name}.toml", folder / name
    case.write_text(text)
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    return results


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return runs: one, the same with twice the preload, in other units, and up to another load."""
    folder = tmp_path_factory.mktemp("runs")
    twice = (f"preload = {PRELOAD}", f"preload = {2 * PRELOAD}")
    metres = ('length = "mm"\nstress = "MPa"', 'length = "m"\nstress = "Pa"')
    bare = ("[loading]", "[output]\npictures = false\n[loading]")
    return [
        ran(folder, "one"),
        ran(folder, "two", twice, bare),
        ran(folder, "three", metres, ("pressure = 1.0", "pressure = 2.0"), bare),
        ran(folder, "four", ("20.0]", "30.0]"), bare),
    ]


def row(page: str, words: str) -> list[str]:
    """Return the cells of a row."""
    found = re.search(rf'<th scope="row">{re.escape(words)}</th>(.*?)</tr>', page)
    assert found, words
    return re.findall(r"<td>([^<]*)</td>", found[1])


@pytest.mark.long
def test_two_preloads(runs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Preloads and their lines differ; meshes and loads agree; only one run has pictures."""
    assert main(["report", str(runs[0]), str(runs[1])]) == SOLVED
    path = runs[0] / "beside_two.html"
    assert str(path) in capsys.readouterr().out
    page = path.read_text(encoding="utf-8")
    assert row(page, "ζ of the last solved level") == ["20", "20", "the same"]
    forces = [ResultReader(run).summary.steps[-1]["bolts"]["anchor"] for run in runs[:2]]
    told = row(page, "force of bolt anchor at this level")
    assert told[:2] == [f"{force:.6g} N" for force in forces]
    assert float(told[2].rstrip(" %")) == pytest.approx(100 * (forces[1] / forces[0] - 1), rel=0.01)
    assert f"-preload = {PRELOAD}" in page
    assert f"+preload = {2 * PRELOAD}" in page
    assert page.count('src="data:image/png;base64,') == 2
    assert page.count("B has no such picture.") == 2
    assert "Notes on this comparison" not in page


def test_other_units_and_loads_are_told(runs: list[Path], tmp_path: Path) -> None:
    """The page shows no difference of numbers that are not comparable."""
    assert main(["report", str(runs[0]), str(runs[2]), "-o", str(tmp_path / "a.html")]) == SOLVED
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    units, loads = apart([ResultReader(runs[0]), ResultReader(runs[2])])
    assert "A uses mm, N, MPa, B uses m, N, Pa" in units
    assert "pressure 1 MPa" in loads
    assert "pressure 2 Pa" in loads
    assert row(page, "ζ of the last solved level")[2] == "–"
    assert row(page, "largest displacement at this level")[2] == "–"
    assert row(page, "cells of the mesh (of the last one, if several)")[2] == "the same"


def test_other_last_loads(runs: list[Path], tmp_path: Path) -> None:
    """The page does not compare displacements at different loads."""
    assert main(["report", str(runs[0]), str(runs[3]), "-o", str(tmp_path / "a.html")]) == SOLVED
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert row(page, "ζ of the last solved level") == ["20", "30", "+50 %"]
    assert row(page, "largest displacement at this level")[2] == "–"


def test_what_is_no_pair_is_refused(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each refusal is one sentence."""
    one, two = map(str, runs[:2])
    assert main(["report", one, two, one]) == BAD_INPUT
    assert "but 3 folders are given;" in capsys.readouterr().err
    assert main(["report", one, str(tmp_path / "none")]) == BAD_INPUT
    assert "does not exist" in capsys.readouterr().err
    damaged = tmp_path / "damaged"
    shutil.copytree(runs[1], damaged)
    (damaged / "summary.json").write_text("{}")
    assert main(["report", one, str(damaged)]) == BAD_INPUT
    assert "summary.json' cannot be read" in capsys.readouterr().err
