"""Test ``run --watch``: the page is current during the run, and contains nothing that expires."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.environment import environment_with_package
from perfplast_fenicsx.report import report_file
from perfplast_fenicsx.report.report_file import LiveReport
from perfplast_fenicsx.rounding import rounded_down
from tests.functional.test_adapted_run import CASE
from tests.functional.test_command_line import CASE as LEVELS
from tests.functional.test_command_line import write
from tests.models import write_case

GOING_ON = re.compile(r"<strong>At [-0-9: ]{19} this run was in progress\.</strong>(.*?)</p>")


@pytest.mark.mpi2
def test_bounds_as_they_narrow(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each page has the stored bounds; the last page equals that of a run without a watch."""
    if comm.rank == 0:
        write_strip_footing(shared_tmp_path / "ground.msh", size=0.4)
    case = write_case(comm, shared_tmp_path / "case.toml", CASE)
    results = shared_tmp_path / "results"
    seen = []
    refresh = LiveReport.refresh

    def noted(self: LiveReport) -> None:
        refresh(self)
        page = (results / "report.html").read_text(encoding="utf-8")
        body = (json.loads((results / "summary.json").read_text())["limit"] or {}).get("body")
        seen.append((page, body))

    monkeypatch.setattr(LiveReport, "refresh", noted)
    assert main(["run", str(case), "-o", str(results), "--watch"]) == SOLVED
    before, *during = seen
    assert "No step is solved yet" in before[0]
    assert len(during) >= 1
    for page, body in during:
        assert GOING_ON.search(page)
        assert f"carry ζ&nbsp;=&nbsp;{rounded_down(body['lower'])} for certain" in page
        assert "Found on this mesh" not in page
    lower = [body["lower"] for _, body in during]
    assert lower == sorted(lower)
    last = (results / "report.html").read_text(encoding="utf-8")
    assert not GOING_ON.search(last)
    meshes = json.loads((results / "summary.json").read_text())["limit"]["body"]["meshes"]
    rows = re.findall(r'row">(\d+)</th><td>(\d+)</td>', last[last.index('id="meshes"') :])
    assert rows[: len(meshes)] == [(str(one["number"]), str(one["cells"])) for one in meshes]
    comm.Barrier()
    assert main(["report", str(results), "-o", str(results / "again.html")]) == SOLVED
    assert (results / "again.html").read_text(encoding="utf-8") == last


def test_what_the_run_is_doing(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Levels appear on the page when they are solved, and steps between them."""
    case, results = write(comm, shared_tmp_path, LEVELS), shared_tmp_path / "results"
    seen = []
    say = LiveReport.say

    def noted(self: LiveReport, words: str) -> None:
        self._written = 0.0  # as if the last page were old
        say(self, words)
        seen.append((results / "report.html").read_text(encoding="utf-8"))

    monkeypatch.setattr(LiveReport, "say", noted)
    assert main(["run", str(case), "-o", str(results), "--watch"]) == SOLVED
    doing = [found[1] for page in seen if (found := GOING_ON.search(page))]
    assert any("Level 1" in text or "First step" in text for text in doing)
    assert len(set(doing)) > 2
    assert not GOING_ON.search((results / "report.html").read_text(encoding="utf-8"))


@pytest.mark.serial
def test_a_page_that_cannot_be_written_is_no_end(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    comm = MPI.COMM_WORLD
    case, results = write(comm, shared_tmp_path, LEVELS), shared_tmp_path / "results"

    def refused(*_: object) -> Path:
        raise report_file.InputError("'report.html' cannot be written (No space left).")

    monkeypatch.setattr(report_file, "write_page", refused)
    assert main(["run", str(case), "-o", str(results), "--watch"]) == SOLVED
    assert "No space left" in caplog.text


@pytest.mark.serial
def test_a_killed_run_leaves_a_page_that_is_true(shared_tmp_path: Path) -> None:
    """The page gives the time of the run, and the bounds proven so far; then the run continues."""
    write_strip_footing(shared_tmp_path / "ground.msh", size=0.4)
    case = shared_tmp_path / "case.toml"
    case.write_text(CASE.replace("until = 0.2, cells = 800", "until = 1e-3, cells = 100000"))
    results = shared_tmp_path / "results"
    command = [sys.executable, "-m", "perfplast_fenicsx", "run", str(case)]
    page = results / "report.html"
    with subprocess.Popen(
        [*command, "-o", str(results), "--watch"],
        stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    ) as process:
        while process.poll() is None:
            if page.exists() and "for certain" in page.read_text(encoding="utf-8"):
                process.send_signal(signal.SIGKILL)
                break
            time.sleep(0.05)
        process.wait()
    assert process.returncode == -signal.SIGKILL
    text = page.read_text(encoding="utf-8")
    assert GOING_ON.search(text)
    assert main(["report", str(results)]) == SOLVED
    assert "for certain" in page.read_text(encoding="utf-8")


WATCHED = """
import os, shutil, signal, sys
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.report.report_file import LiveReport

when, left, pages, *arguments = sys.argv[1:]
left, plain = int(left), LiveReport.refresh

def refresh(self):
    global left
    left -= 1
    if left == 0 and when == "before the page is written":
        os.kill(os.getpid(), signal.SIGKILL)
    plain(self)
    if self._folder.comm.rank == 0:
        os.makedirs(pages, exist_ok=True)
        shutil.copy(self._folder.path / "report.html", f"{pages}/{len(os.listdir(pages)):03}.html")
    if left == 0 and when == "behind it":
        os.kill(os.getpid(), signal.SIGKILL)

LiveReport.refresh = refresh
sys.exit(main(arguments))
"""
"""A run with a watch that stores each page, and may end without a warning."""


def zetas(page: str) -> list[float]:
    """Return the load factors in the table of levels; an empty list without the table."""
    _, there, table = page.partition('id="levels"')
    rows = re.findall(r'row">\d+</th><td>([^<]+)</td>', table.partition("</table>")[0])
    assert bool(rows) == bool(there)
    return [float(one) for one in rows]


@pytest.mark.long
@pytest.mark.serial
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("when", ["before the page is written", "behind it"])
def test_a_watched_run_that_is_killed_and_goes_on(tmp_path: Path, ranks: int, when: str) -> None:
    """Each page has only stored levels, and all levels of earlier pages."""
    text = LEVELS.replace("[50.0, 80.0]", "[30.0, 50.0, 70.0, 80.0]")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    results = tmp_path / "results"
    run = ["run", str(tmp_path / "case.toml"), "--watch"]
    several = ["mpirun", "-n", str(ranks)] if ranks > 1 else []

    def watched(left: int, into: str) -> tuple[int, list[str]]:
        pages = tmp_path / f"pages {left}"
        arguments = [
            sys.executable,
            "-c",
            WATCHED,
            when,
            str(left),
            str(pages),
            *run,
            into,
            str(results),
        ]
        environment = environment_with_package(dict(os.environ)) | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run([*several, *arguments], env=environment, capture_output=True)
        texts = [page.read_text(encoding="utf-8") for page in sorted(pages.iterdir())]
        return done.returncode, texts

    def on_file() -> list[float]:
        with (results / "path.csv").open(encoding="utf-8", newline="") as file:
            return [float(row["zeta"]) for row in csv.DictReader(file)]

    status, pages = watched(3, "-o")  # the first page has no levels
    assert status != SOLVED
    killed, known = (results / "report.html").read_text(encoding="utf-8"), on_file()
    assert killed == pages[-1]
    assert GOING_ON.search(killed)
    assert zetas(killed) == known[: len(zetas(killed))]
    assert len(known) - len(zetas(killed)) == (1 if when.startswith("before") else 0)

    status, pages = watched(1000, "--restart")
    assert status == SOLVED
    counts = [len(zetas(page)) for page in pages]
    assert counts == sorted(counts)
    assert counts[0] == len(known)
    assert all(GOING_ON.search(page) for page in pages)
    assert all(zetas(page) == on_file()[: len(zetas(page))] for page in pages)
    last = (results / "report.html").read_text(encoding="utf-8")
    assert not GOING_ON.search(last)
    assert zetas(last) == on_file() == [30, 50, 70, 80]
