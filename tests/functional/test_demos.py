"""Test the examples and demos, which check themselves, on coarse meshes.

``make test`` runs three of them, and draws no pictures of the verification. ``make verify`` runs
all of them, with pictures. It also runs the verification at full size on two ranks.
"""

import ast
import copy
import importlib.util
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from mpi4py import MPI

import pytest

from demos.verification.verify import CASES as VERIFIED
from docs import commands, examples
from perfplast_fenicsx.__main__ import main as command_line
from perfplast_fenicsx.cli.case_picture import PICTURE
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.pictures import drawing_process, result_figures
from tests.parallel_plugin import EVERY_CASE

FOLDER = Path(__file__).resolve().parents[2] / "demos"
SHORT = ("bolted_ring", "press_fit", "two_blocks")
"""Demos that ``make test`` runs, on one rank."""


def marks(script: Path) -> list[pytest.MarkDecorator]:
    """Return the marks that determine in which runs a demo takes part."""
    serial = [] if script.parent == FOLDER else [pytest.mark.serial]
    return serial if script.stem in SHORT else [*serial, pytest.mark.long]


NAMED = (*VERIFIED, "compare_algorithms", "random_fields", "tfeti_scaling")
SCRIPTS = [FOLDER / "two_blocks.py", *(FOLDER / "verification" / f"{name}.py" for name in NAMED)]
CASES = sorted(FOLDER.glob("*.toml"))


def name(path: Path) -> str:
    return path.stem


def load(script: Path) -> ModuleType:
    """Load a demo as a module, without running it."""
    spec = importlib.util.spec_from_file_location(f"demo_{script.stem}", script)
    assert spec is not None
    assert spec.loader is not None
    demo = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(demo)
    return demo


@pytest.mark.long(
    but=[
        "assemblies",
        "autofrettage",
        "axisymmetry",
        "body_bounds",
        "bolted_ring",
        "bound_costs",
        "bounds_apart",
        "bounds_in_space",
        "compare_algorithms",
        "contact_patch",
        "corner_seat",
        "cracked_strips",
        "curved_seams",
        "dead_loads",
        "friction",
        "ground",
        "ground_bounds",
        "ground_in_space",
        "hertz_line",
        "hertz_sphere",
        "hollow_shaft",
        "joints",
        "meshed_apart",
        "plate_with_hole",
        "platens",
        "press_fit",
        "published",
        "published_blocks",
        "published_contact",
        "published_plates",
        "random_fields",
        "rigid_footing",
        "ring_bounds",
        "safety_factors",
        "shakedown",
        "space_costs",
        "statements",
        "strip_footing",
        "tension_and_shear",
        "tfeti_scaling",
        "thick_sphere",
        "thick_tube",
        "torsion",
        "towers",
        "wall_bounds",
        "yield_laws",
    ]
)
@pytest.mark.parametrize(
    "script", [pytest.param(script, marks=marks(script)) for script in sorted(SCRIPTS)], ids=name
)
def test_script(
    script: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results = shared_tmp_path / "results"
    if comm.rank == 0:  # from a first run, which the second run replaces
        results.mkdir()
        (results / "summary.json").write_text("old", encoding="utf-8")
    comm.barrier()
    drawn: list[Path] = []
    if script.parent != FOLDER and comm.size == 1 and not EVERY_CASE:
        monkeypatch.setattr(drawing_process, "plot", drawn.append)
    load(script).main(["--coarse", "-o", str(results)])
    comm.barrier()
    assert drawn or any(results.rglob("*.png"))
    assert all(results in folder.parents or folder == results for folder in drawn)
    out, _ = capsys.readouterr()
    assert (str(results) in out) == (comm.rank == 0)


@pytest.mark.parametrize("example", examples.EXAMPLES, ids=name)
def test_example(
    example: Path, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch, comm: MPI.Intracomm
) -> None:
    """Each demo compares its numbers with known values; as a module it draws nothing."""
    monkeypatch.chdir(shared_tmp_path)
    runpy.run_path(str(example), run_name=example.stem)
    comm.barrier()


@pytest.mark.serial
def test_examples_are_short_and_in_the_gallery() -> None:
    assert len(examples.EXAMPLES) == 11
    for example in examples.EXAMPLES:
        text = example.read_text(encoding="utf-8")
        assert 40 <= len(text.splitlines()) <= 100
        assert ast.get_docstring(ast.parse(text))
        assert examples.stored(example).exists()
    assert examples.GALLERY.read_text(encoding="utf-8") == examples.page()


@pytest.mark.serial
@pytest.mark.long
@pytest.mark.parametrize("example", examples.EXAMPLES, ids=name)
def test_picture_of_an_example(example: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, example], cwd=tmp_path, check=True, timeout=300)
    assert (tmp_path / examples.picture(example)).stat().st_size > 5_000


@pytest.mark.parametrize("case", CASES, ids=name)
def test_case(
    case: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Path] = []
    for module in (drawing_process, result_figures):
        monkeypatch.setattr(module, "draw_case", lambda arrays, picture: drawn.append(picture))
    assert command_line(["check", str(case)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    assert ("can be run" in out) == (comm.rank == 0)
    assert drawn == ([case.parent / PICTURE] if comm.rank == 0 else [])


@pytest.mark.long
@pytest.mark.serial
def test_the_notebook_prints_what_it_shows() -> None:
    """Run all cells with Jupyter's kernel; numbers may differ, as on pages of the documentation."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    shown = nbformat.read(FOLDER / "limit_load.ipynb", as_version=4)
    nbformat.validate(shown)
    place = {"metadata": {"path": FOLDER.parent}}
    run = nbclient.NotebookClient(copy.deepcopy(shown), timeout=600, resources=place).execute()
    pairs = list(zip(printed(shown), printed(run), strict=True))
    assert len(pairs) == 3
    for before, after in pairs:
        assert commands.same(before, after)


def printed(notebook: Any) -> list[str]:
    """Return the text that each printing cell of a notebook prints."""
    outputs = (cell.outputs for cell in notebook.cells if cell.cell_type == "code")
    texts = ("".join(output.get("text", "") for output in cell) for cell in outputs)
    return [text for text in texts if text]
