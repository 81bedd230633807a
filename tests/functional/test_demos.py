"""The demos check themselves: each runs here, small, on one rank and on the ranks of the run.

Cases of the verification run once: on one rank, or on several what shows a pattern of exchange, and
of those that take long one. Their pictures are drawn by ``make verify``, which has all of them here
as well, and at their full size on two ranks.
"""

import importlib.util
from pathlib import Path
from types import ModuleType

from mpi4py import MPI

import pytest

from demos.verification.verify import CASES as VERIFIED
from perfplast_fenicsx.__main__ import main as command_line
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.cli.understood import PICTURE
from perfplast_fenicsx.pictures import drawing_process
from tests.parallel_plugin import EVERY_CASE

FOLDER = Path(__file__).resolve().parents[2] / "demos"
ON_SEVERAL = ("body_bounds", "friction", "meshed_apart")
"""Cases of the verification that run on several ranks, and not on one."""

LONG = (
    *("assemblies", "axisymmetry", "bound_costs", "bounds_in_space", "contact_patch"),
    *("cracked_strips", "curved_seams", "dead_loads", "ground", "hertz_sphere", "joints"),
    *("ground_bounds", "ground_in_space"),
    *("bounds_apart", "platens", "published", "ring_bounds"),
    *("published_blocks", "published_contact", "published_plates", "rigid_footing"),
    *("space_costs", "strip_footing", "thick_sphere"),
    *("statements", "torsion", "towers", "wall_bounds", "yield_laws"),
)
"""Cases of the verification that take more than 5 s of one core where they are coarse."""


def marks(name: str) -> list[pytest.MarkDecorator]:
    """Of a case of the verification."""
    if name in ON_SEVERAL:
        return []
    return [pytest.mark.serial, pytest.mark.costly] if name in LONG else [pytest.mark.serial]


SCRIPTS = [
    *sorted(FOLDER.glob("*.py")),
    *(pytest.param(FOLDER / "verification" / f"{name}.py", marks=marks(name)) for name in VERIFIED),
]
CASES = sorted(FOLDER.glob("*.toml"))


def name(path: Path) -> str:
    return path.stem


def load(script: Path) -> ModuleType:
    """A demo as a module; nothing of it runs yet."""
    spec = importlib.util.spec_from_file_location(f"demo_{script.stem}", script)
    assert spec is not None
    assert spec.loader is not None
    demo = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(demo)
    return demo


@pytest.mark.parametrize("script", SCRIPTS, ids=name)
def test_script(
    script: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if script.stem in ON_SEVERAL and comm.size == 1:
        pytest.skip("this case of the verification is tested once, on several ranks")
    results = shared_tmp_path / "results"
    if comm.rank == 0:  # of a first run, which the second one replaces
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


@pytest.mark.parametrize("case", CASES, ids=name)
def test_case(
    case: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Path] = []
    monkeypatch.setattr(drawing_process, "draw_case", lambda arrays, picture: drawn.append(picture))
    assert command_line(["check", str(case)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    assert ("can be run" in out) == (comm.rank == 0)
    assert drawn == ([case.parent / PICTURE] if comm.rank == 0 else [])
