"""Test that ``perfplast plot --follow`` reports and draws new levels until the run ends."""

import io
import json
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.follow import Follower
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.cli.terminal import Terminal, next_level, remaining
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import hold, is_held
from tests.cli import growing_folder
from tests.models import STEEL, punch_case, write_case

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]


def follow(folder: Path, end: str) -> tuple[list[str], int]:
    """Follow a folder that a child process writes; return messages and the number of drawings."""
    program = [sys.executable, growing_folder.__file__, str(folder), "3", end]
    drawn = 0
    stream = io.StringIO()
    with subprocess.Popen(program, cwd=ROOT, env={"PYTHONPATH": str(ROOT)}) as child:

        def draw() -> None:
            nonlocal drawn
            drawn += 1
            if drawn == 3 and end == "killed":
                child.kill()
                child.wait()
            (folder / f"seen.{drawn}").touch()
            if drawn == 2:
                raise InputError("there is no ink")

        Follower(folder, Terminal(MPI.COMM_SELF, stream), draw, wait=60.0).follow()
    return stream.getvalue().splitlines(), drawn


def test_a_run_that_ends(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lines, drawn = follow(tmp_path / "results", "by itself")
    heads, *levels, end = lines
    assert heads.split()[:3] == ["step", "zeta", "alpha"]
    assert [line.split()[:2] for line in levels] == [["1", "10"], ["2", "20"], ["3", "30"]]
    assert levels[0].endswith("2 levels left, about 0:04")
    assert levels[2].endswith("2.00")
    assert end == "The run ended; 3 levels are stored."
    assert drawn == 3
    assert "no ink" in caplog.text  # and goes on


def test_a_run_that_is_killed(tmp_path: Path) -> None:
    lines, drawn = follow(tmp_path / "results", "killed")
    assert drawn == 3
    assert lines[-1].startswith(
        "The run was killed; 3 levels are stored. Continue it with --restart "
    )


def test_no_folder(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shared_tmp_path / "nowhere"
    assert main(["plot", "--follow", "--wait", "0", str(folder)]) == BAD_INPUT
    out, err = capsys.readouterr()
    if comm.rank == 0:
        assert (out, err.count("\n")) == ("", 1)
        assert "no results" in err


@pytest.mark.parametrize("seconds", ["nan", "-1"])
def test_what_is_no_time_to_wait(
    seconds: str, comm: MPI.Intracomm, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plot", "--follow", f"--wait={seconds}", str(tmp_path)]) == BAD_INPUT
    if comm.rank == 0:
        assert "--wait = " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("summary", "part"),
    [({"steps": []}, "'planned'"), ([], "does not have the form"), ("{", "cannot be read")],
)
def test_results_of_another_version(summary: object, part: str, tmp_path: Path) -> None:
    text = summary if isinstance(summary, str) else json.dumps(summary)
    (tmp_path / "summary.json").write_text(text)
    (tmp_path / "run.log").touch()
    follower = Follower(tmp_path, Terminal(MPI.COMM_SELF, io.StringIO()), lambda: None, wait=0.0)
    with pytest.raises(InputError, match=part):
        follower.follow()


def test_numbers_that_are_null_on_file(tmp_path: Path) -> None:
    step = growing_folder.STEP | {"zeta": 10.0, "alpha": None, "duality_gap": None}
    summary = {"steps": [step], "planned": 1, "limit": None}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    (tmp_path / "run.log").touch()
    stream = io.StringIO()
    Follower(tmp_path, Terminal(MPI.COMM_SELF, stream), lambda: None, wait=0.0).follow()
    assert stream.getvalue().splitlines()[1].split()[:3] == ["1", "10", "none"]


def test_a_run_that_has_ended(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Check the real command on the folder of a run that has ended."""
    more = "[loading]\nvalues = [10.0]\n[output]\nfields = false\npictures = false\n"
    case = write_case(comm, shared_tmp_path / "case.toml", punch_case(STEEL, STEEL, more=more))
    folder = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    assert main(["plot", "--follow", str(folder)]) == SOLVED
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert out.splitlines()[-1] == "The run ended; 1 level is stored."
        assert "\r" not in out  # no reader waits
    assert (folder / "path.png").exists()


def test_a_lock_is_held_as_long_as_its_file_is_open(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    assert not is_held(path)
    with path.open("w") as first, path.open("a") as second:
        assert hold(first)
        assert is_held(path)
        assert hold(second)
        second.close()
        assert is_held(path)
    assert not is_held(path)


@pytest.mark.parametrize(
    ("planned", "seconds", "words"),
    [
        (None, [1.0], ""),
        (2, [1.0, 1.0], ""),
        (5, [], "5 levels left"),
        (5, [100.0, 1.0, 2.0, 3.0], "1 level left, about 0:02"),
        (9, [3600.0], "8 levels left, about 8:00:00"),
    ],
)
def test_what_remains(planned: int | None, seconds: list[float], words: str) -> None:
    assert remaining(planned, seconds) == words


def test_the_next_level() -> None:
    assert next_level(None, [1.0]) == next_level(1, [1.0]) == "level 2"
    assert next_level(3, []) == "level 1/3"
    assert next_level(3, [2.0]) == "level 2/3, 0:04 left"
