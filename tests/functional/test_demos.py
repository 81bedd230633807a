"""The demos check themselves: each runs here on the ranks of the run, small."""

import importlib.util
from pathlib import Path
from types import ModuleType

from mpi4py import MPI

import pytest

from demos.verification.verify import CASES as VERIFIED
from perfplast_fenicsx.__main__ import main as command_line
from perfplast_fenicsx.cli.run import SOLVED

FOLDER = Path(__file__).resolve().parents[2] / "demos"
SCRIPTS = [
    *sorted(FOLDER.glob("*.py")),
    *(FOLDER / "verification" / f"{name}.py" for name in VERIFIED),
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
) -> None:
    if script.parent != FOLDER and comm.size == 1:
        pytest.skip("cases of the verification are tested once, on several ranks")
    results = shared_tmp_path / "results"
    if comm.rank == 0:  # of a first run, which the second one replaces
        results.mkdir()
        (results / "summary.json").write_text("old", encoding="utf-8")
    comm.barrier()
    load(script).main(["--coarse", "-o", str(results)])
    comm.barrier()
    assert any(results.rglob("*.png"))
    out, _ = capsys.readouterr()
    assert (str(results) in out) == (comm.rank == 0)


@pytest.mark.parametrize("case", CASES, ids=name)
def test_case(case: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line(["check", str(case)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    assert ("can be run" in out) == (comm.rank == 0)
