"""Test ``perfplast export`` and ``RunResults``: other readers read the files, a notebook runs."""

import csv
import shutil
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import InputError, RunResults
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from tests.functional.browser_page import PATIENCE, alone
from tests.functional.test_command_line import CASE, one_line, write

LIMIT = CASE.replace("values = [50.0, 80.0]", 'control = "bounds"')


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return two levels, with the quadrature points."""
    return solved(tmp_path_factory, CASE.replace("[output]\n", "[output]\npoints = true\n"))


@pytest.fixture(scope="module")
def bounded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return bounds for the body."""
    return solved(tmp_path_factory, LIMIT)


def solved(factory: pytest.TempPathFactory, text: str) -> Path:
    """Return a run with everything that can be exported."""
    comm = MPI.COMM_WORLD
    place = comm.bcast(factory.mktemp("run"))
    folder = place / "results"
    with redirect_stdout(StringIO()):
        assert main(["run", str(write(comm, place, text)), "-o", str(folder)]) == SOLVED
        assert main(["export", str(folder)]) == SOLVED
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.mpi2("fields/level_0002")
@pytest.mark.parametrize("name", ["fields/level_0002", "fields/points_0002", "mechanism"])
def test_vtk_reads_the_same_from_both(
    name: str, results: Path, bounded: Path, comm: MPI.Intracomm
) -> None:
    pyvista = pytest.importorskip("pyvista")
    if comm.rank:
        return
    folder = bounded if name == "mechanism" else results
    one = pyvista.HDFReader(folder / f"{name}.vtkhdf").read()
    other = pyvista.read(folder / "export" / f"{Path(name).name}.vtu")
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.cells, other.cells)
    np.testing.assert_array_equal(one.celltypes, other.celltypes)
    for kind in ("point_data", "cell_data", "field_data"):
        here, there = getattr(one, kind), getattr(other, kind)
        assert set(here) == set(there)
        for field in here:
            np.testing.assert_array_equal(here[field], there[field])
    if name != "fields/points_0002":
        assert list(other.field_data["body_names"]) == ["base", "punch"]


def test_points_of_the_quadrature(results: Path, comm: MPI.Intracomm) -> None:
    """The stresses have the means of the cells, each in its cell; volumes sum to the bodies."""
    if comm.rank:
        return
    with h5py.File(results / "fields/level_0002.vtkhdf", locking=False) as cells:
        corners = np.asarray(cells["VTKHDF/Connectivity"]).reshape(-1, 4)
        place = np.asarray(cells["VTKHDF/Points"])[corners]
        mean = np.asarray(cells["VTKHDF/CellData/stress"])
        ratio = np.asarray(cells["VTKHDF/CellData/yield_ratio"])
        body = np.asarray(cells["VTKHDF/CellData/body"])
    with h5py.File(results / "fields/points_0002.vtkhdf", locking=False) as points:
        stress = np.asarray(points["VTKHDF/PointData/stress"])
        n = len(mean), -1
        np.testing.assert_allclose(stress.reshape(*n, 3, 3).mean(axis=1).ravel(), mean.ravel())
        at = np.asarray(points["VTKHDF/Points"]).reshape(*n, 3)
        np.testing.assert_allclose(at.mean(axis=1), place.mean(axis=1), atol=1e-12)
        ratios = np.asarray(points["VTKHDF/PointData/yield_ratio"]).reshape(n)
        np.testing.assert_allclose(ratios.max(axis=1), ratio, atol=1e-12)
        assert (np.asarray(points["VTKHDF/CellData/body"]).reshape(n) == body[:, None]).all()
        edges = place[:, 1:] - place[:, :1]
        volume = np.asarray(points["VTKHDF/PointData/volume"]).reshape(n).sum(axis=1)
        np.testing.assert_allclose(volume, np.abs(np.linalg.det(edges)) / 6)


def test_tables_of_levels(results: Path, comm: MPI.Intracomm) -> None:
    if comm.rank:
        return
    levels, path = rows(results / "export/levels.csv"), rows(results / "path.csv")
    assert [row["level"] for row in levels] == ["1", "2"]
    for level, row in zip(levels, path, strict=True):
        shared = set(level) & set(row)
        assert {"zeta", "alpha", "duality_gap", "seconds"} <= shared
        assert {key: level[key] for key in shared} == {key: row[key] for key in shared}
    forces = [row for row in rows(results / "export/resultants.csv") if row["level"] == "2"]
    assert {row["unit"] for row in forces} == {"N"}
    assert [row["name"] for row in forces][:2] == ["loads", "support x0"]
    outside = [row for row in forces if not row["name"].startswith("contact")]
    for axis in "xyz":
        column = [float(row[axis]) for row in outside]
        assert sum(column) == pytest.approx(0, abs=1e-6 * max(map(abs, column), default=0) + 1e-9)
    assert not (results / "export/bounds.csv").exists()


def test_tables_of_bounds(bounded: Path, comm: MPI.Intracomm) -> None:
    """Loads at a bound are the bound times the loads at ζ = 1; the row agrees with path.csv."""
    if comm.rank:
        return
    (row,) = rows(bounded / "export/bounds.csv")
    assert [row] == rows(bounded / "path.csv")
    told = rows(bounded / "export/resultants.csv")
    table = {(one["state"], one["quantity"], one["name"]): one for one in told}
    given, lower = (table[state, "force", "load top"] for state in ("given", "lower"))
    assert float(given["zeta"]) == 1
    assert float(lower["zeta"]) == float(row["body_lower"])
    assert float(lower["z"]) == pytest.approx(float(row["body_lower"]) * float(given["z"]))
    held = table["lower", "force", "support bottom"]
    assert float(held["z"]) == pytest.approx(-float(lower["z"]))
    assert not (bounded / "export/levels.csv").exists()


def test_a_new_run_removes_what_was_exported(
    results: Path, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    folder = shared_tmp_path / "again"
    if comm.rank == 0:
        shutil.copytree(results, folder)
    case = write(comm, shared_tmp_path, LIMIT.replace("pictures", "fields = false\npictures"))
    with redirect_stdout(StringIO()):
        assert main(["run", str(case), "-o", str(folder), "--force"]) == SOLVED
    if comm.rank == 0:
        assert not (folder / "export").exists()
        assert not list(folder.glob("**/*points*"))


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["{results}/fields"], "contains no summary.json"),
        (["{results}", "-o", "/dev/null/a"], "cannot be written"),
        (["{spoilt}", "--vtu"], "level_0001.vtkhdf' cannot be read"),
        (["{bare}", "--vtu"], "contains nothing to export yet"),
    ],
)
def test_what_cannot_be_exported(
    arguments: list[str],
    part: str,
    results: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    spoilt, bare = shared_tmp_path / "spoilt", shared_tmp_path / "bare"
    if comm.rank == 0:
        shutil.copytree(results, spoilt)
        (spoilt / "fields/level_0001.vtkhdf").write_bytes(b"no HDF5")
        bare.mkdir()
        for name in ("summary.json", "path.csv", "scene.json"):
            shutil.copy(results / name, bare)
    comm.barrier()
    places = {"results": results, "spoilt": spoilt, "bare": bare}
    given = [argument.format(**places) for argument in arguments]
    assert main(["export", *given]) == BAD_INPUT
    assert part in one_line(comm, capsys)


def test_results_that_are_not_there() -> None:
    with pytest.raises(InputError, match="does not exist"):
        RunResults("nowhere")


CELLS = (
    "from perfplast_fenicsx import RunResults\nrun = RunResults({levels!r})\nrun",
    "run.levels[['level', 'zeta', 'converged']]",
    "RunResults({bounds!r}).bounds",
    "run.resultants.query(\"name == 'support bottom'\")[['zeta', 'z']]",
    "print(RunResults({bounds!r}))",
)


@pytest.mark.long
@alone
def test_a_notebook(results: Path, bounded: Path, tmp_path: Path, browser: Any) -> None:
    """Jupyter's kernel runs the notebook; a cell shows the report, which works in a browser."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    book = nbformat.v4.new_notebook()
    places = {"levels": str(results), "bounds": str(bounded)}
    book.cells = [nbformat.v4.new_code_cell(cell.format(**places)) for cell in CELLS]
    nbclient.NotebookClient(book, timeout=PATIENCE).execute()
    report, levels, bounds, forces, printed = (cell.outputs[0] for cell in book.cells)
    assert "80.0" in levels.data["text/html"]
    assert "body_lower" in bounds.data["text/html"]
    assert "support" not in forces.data["text/html"]
    assert "both bounds are strict" in printed.text
    page = tmp_path / "book.html"
    page.write_text(f"<!DOCTYPE html><body>{report.data['text/html']}</body>", encoding="utf-8")
    browser.get(page.as_uri())
    from selenium.webdriver.support.ui import WebDriverWait

    browser.switch_to.frame(0)
    wait = WebDriverWait(browser, PATIENCE, 0.05)
    ready = "return document.getElementById('canvas')?.hasAttribute('data-ready')"
    wait.until(lambda page: page.execute_script(ready))
    assert "A punch on a block" in browser.find_element("tag name", "h1").text
    told = [line["message"] for line in browser.get_log("browser") if line["level"] == "SEVERE"]
    assert not told
    browser.save_screenshot(str(tmp_path / "book.png"))
    shown = browser.execute_script("return document.getElementById('canvas').clientHeight")
    assert shown > 200
