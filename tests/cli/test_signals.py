"""Test programs that end early: by signals at any moment, and by a full disk.

The moment is a place in the program (:mod:`tests.cli.paused_run`), not a time: at this place the
program waits for the signal.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.results import result_files
from perfplast_fenicsx.io.results.checkpoints import NEWEST
from tests.cli.paused_run import LEVEL
from tests.functional.test_restart import fields_of, path_of, same_path, solved_by

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="a program that uses MPI cannot start another"
)

LEVELS = 16
VALUES = ", ".join(f"{zeta:.1f}" for zeta in np.linspace(40, 470, LEVELS))

ROOT = Path(__file__).parents[2]
ITERATION = "perfplast_fenicsx.cli.recorder:Recorder.iteration"
FLUSH, RENAME = "os:fsync", "pathlib:Path.replace"


@dataclass(frozen=True)
class Moment:
    """The place at which ranks pause; see :mod:`tests.cli.paused_run`."""

    level: int
    call: str = LEVEL
    count: str = "1"
    ranks: tuple[int, ...] = (0,)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a case with many levels, and the results of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("whole")
    case = folder / "case.toml"
    case.write_text(solved_by("newton", f"values = [{VALUES}]"), encoding="utf-8")
    assert main(["run", str(case), "-o", str(folder / "results")]) == SOLVED
    return case, folder / "results"


class Run:
    """``perfplast run`` on a number of ranks, in a separate session.

    Attributes:
        process: The process, or its launcher.
    """

    def __init__(self, ranks: int, moment: Moment, folder: Path, *arguments: object) -> None:
        """Start the run.

        Args:
            ranks: Number of ranks.
            moment: Moment at which some of them pause.
            folder: Folder for announcements.
            arguments: Arguments of ``perfplast run``.
        """
        launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        self._paused = [folder / f"paused.{rank}" for rank in moment.ranks]
        where = (",".join(map(str, moment.ranks)), moment.level, moment.call, moment.count)
        program = [*launch, sys.executable, "-m", "tests.cli.paused_run", *map(str, where)]
        self.process = subprocess.Popen(
            [*program, str(folder / "paused"), "run", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            # by default mpirun gives its ranks a second to end
            env=os.environ | {"PRTE_MCA_odls_base_sigkill_timeout": "60"},
            start_new_session=True,
        )

    def wait(self) -> list[int]:
        """Wait until the ranks reach the moment; return their process numbers."""
        while not all(path.exists() for path in self._paused):
            assert self.process.poll() is None, "".join(self.process.communicate())
            time.sleep(0.02)
        numbers = [int(path.read_text()) for path in self._paused]
        for path in self._paused:
            path.unlink()
        return numbers

    def ended(self) -> tuple[int, str]:
        """Return the exit status and standard error."""
        try:
            _, err = self.process.communicate()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        return self.process.returncode, err


@pytest.mark.long
def test_one_rank_is_ended_and_others_go_on(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """Kill one of three ranks by SIGKILL, end one of two by SIGTERM, and let one rank finish."""
    case, folder = whole[0], tmp_path / "results"
    run = Run(3, Moment(6, ranks=(1,)), tmp_path, case, "-o", folder)
    (rank,) = run.wait()
    os.kill(rank, signal.SIGKILL)
    status, _ = run.ended()
    assert status != SOLVED
    assert len(path_of(folder)) == 5

    run = Run(2, Moment(3, ranks=(1,)), tmp_path, case, "--restart", folder, "--report")
    (rank,) = run.wait()
    os.kill(rank, signal.SIGTERM)
    status, err = run.ended()
    assert status == 128 + signal.SIGTERM
    assert f"perfplast run {case} --restart {folder}" in err
    assert "Traceback" not in err
    assert len(path_of(folder)) == 5 + 3  # the solved level is on file
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "8 of 16 steps are solved, and the run was interrupted (SIGTERM)." in page

    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


def test_control_c(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """A terminal sends the interrupt to the launcher and to all ranks."""
    case, folder = whole[0], tmp_path / "results"
    run = Run(1, Moment(4), tmp_path, case, "-o", folder)
    run.wait()
    os.killpg(run.process.pid, signal.SIGINT)
    status, err = run.ended()
    assert status == 128 + signal.SIGINT
    assert err.count("\n") == 1
    assert f"perfplast run {case} --restart {folder}" in err
    assert len(path_of(folder)) == 4

    run = Run(2, Moment(2, ranks=(0, 1)), tmp_path, case, "--restart", folder)
    run.wait()
    run.process.send_signal(signal.SIGINT)
    status, _ = run.ended()  # the exit status that mpirun reports
    assert status != SOLVED
    assert len(path_of(folder)) < LEVELS
    *_, told, last = (folder / "run.log").read_text().splitlines()
    if result_files.ENDED in last:  # an interrupted mpirun kills its ranks soon, or at once
        assert f"--restart {folder}" in told
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])

    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


@pytest.mark.long
def test_killed_at_any_moment(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """The run loses at most the current level, whatever file it is writing."""
    case, folder = whole[0], tmp_path / "results"
    moments = random.Random(8)
    begin: tuple[object, ...] = ("-o", folder)
    levels = 0
    for call in (ITERATION, FLUSH, RENAME):
        first = moments.randint(1, 3)
        moment = Moment(first, call, str(moments.randint(1, 10)))
        run = Run(1, moment, tmp_path, case, *begin)
        run.wait()
        run.process.kill()
        run.ended()
        before, levels = levels, len(path_of(folder))
        assert before + first - 1 <= levels < LEVELS
        assert levels == 0 or len(fields_of(folder)) >= levels
        begin = ("--restart", folder)
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


def is_whole(folder: Path, err: str, reason: str) -> None:
    """Check a run without disk space: one sentence, and levels from which it can be continued."""
    said = [line for line in err.splitlines() if line.startswith("perfplast")]
    assert len(said) == 1
    assert reason in said[0]
    assert "--restart" in said[0]
    assert "Traceback" not in err
    levels = len(path_of(folder))
    assert 0 < levels < LEVELS
    assert len(fields_of(folder)) >= levels
    assert not list(folder.rglob("*.part"))
    with h5py.File(folder / NEWEST) as file:
        assert len(file["header"]) > 0


@pytest.mark.long
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_files_may_grow_no_more(whole: tuple[Path, Path], tmp_path: Path, share: float) -> None:
    """From the fifth level on, files cannot grow, or cannot reach the size of a checkpoint."""
    case, folder = whole[0], tmp_path / "results"
    most = int(share * (whole[1] / NEWEST).stat().st_size)
    moment = Moment(5, count=f"<{most}", ranks=(0, 1))
    status, err = Run(2, moment, tmp_path, case, "-o", folder).ended()
    assert status == BAD_INPUT
    is_whole(folder, err, "File too large")
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


SMALL_DISK = """
set -u
mount -t tmpfs -o size=32m tmpfs "$2" || exit 77
trap 'umount "$2"' EXIT
head -c $((32 * 1024 * 1024 - $3)) /dev/zero >"$2/filler"
mpirun -n 2 "$5" -m perfplast_fenicsx run "$1" -o "$2/results" >"$4/out" 2>"$4/err"
echo $? >"$4/status"
cp -r "$2/results" "$4/full"
rm "$2/filler"
"$5" -m perfplast_fenicsx run "$1" --restart "$2/results" >"$4/out2" 2>"$4/err2"
echo $? >"$4/status2"
cp -r "$2/results" "$4/results"
"""


def test_a_full_disk(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """A disk with room for half of the results, in a separate mount namespace."""
    case, disk, out = whole[0], tmp_path / "disk", tmp_path / "out"
    disk.mkdir()
    out.mkdir()
    if not shutil.which("unshare"):
        pytest.skip("no unshare")
    enter = ["unshare", "--mount", "--propagation", "unchanged"]  # for a chroot
    if os.geteuid() != 0:
        enter = ["unshare", "--map-root-user", "--mount"]
    # Pictures are drawn at the end, and the size of logs and summaries differs between runs.
    others = (".png", ".log", ".json")
    levels = [path for path in whole[1].rglob("*") if path.suffix not in others]
    pages = sum(-(-path.stat().st_size // 4096) for path in levels)
    script = ["bash", "-c", SMALL_DISK, "bash", case, disk, pages // 2 * 4096, out, sys.executable]
    done = subprocess.run(list(map(str, [*enter, *script])), capture_output=True)
    if not (out / "status").exists():
        pytest.skip(f"no mount here: {done.stderr.decode()}")
    assert (out / "status").read_text().strip() == str(BAD_INPUT)
    is_whole(out / "full", (out / "err").read_text(), "No space left on device")
    assert (out / "status2").read_text().strip() == str(SOLVED), (out / "err2").read_text()
    same_path(out / "results", whole[1])


@pytest.mark.long(but=["arguments0"])
@pytest.mark.parametrize("arguments", [["materials"], ["run", "case.toml", "-o", "results"]])
def test_nobody_reads_to_the_end(
    whole: tuple[Path, Path], tmp_path: Path, arguments: list[str]
) -> None:
    """The run continues without output if the reader ends: ``perfplast run ... | head -1``."""
    shutil.copy(whole[0], tmp_path / "case.toml")
    program = [sys.executable, "-m", "perfplast_fenicsx", *arguments]
    with subprocess.Popen(
        program,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == SOLVED
    if "results" in arguments:
        same_path(tmp_path / "results", whole[1])


ENDED = """
import signal, sys
from mpi4py import MPI
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import commands
from perfplast_fenicsx.cli.signals import Interrupts

def command(*_):
    with Interrupts(MPI.COMM_WORLD):
        signal.raise_signal(signal.{name})
        {then}
    return 0

commands.execute = command
sys.exit(main(["info"]))
"""


@pytest.mark.serial
@pytest.mark.parametrize(
    ("name", "then"),
    [
        ("SIGTERM", 'raise OSError("cc1: interrupted")'),
        ("SIGINT", "signal.raise_signal(signal.SIGINT)"),
    ],
)
def test_ended_at_once_with_a_sentence(name: str, then: str) -> None:
    """The signal has also ended a compiler, or a second signal follows; in a separate process."""
    found = subprocess.run(
        [sys.executable, "-c", ENDED.format(name=name, then=then)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    said = f"perfplast: ended at once by {name}; solved levels are saved.\n"
    assert found.stderr == said
    assert found.returncode == 128 + signal.Signals[name]
