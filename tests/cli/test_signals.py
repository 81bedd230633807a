"""Programs that are ended for real: by signals at any moment, and by a full disk."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.run import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.results.checkpoint_header import NEWEST
from tests.functional.test_restart import case_text, fields_of, path_of, same_path

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="a program that uses MPI cannot start another"
)

LEVELS = 24
VALUES = ", ".join(f"{zeta:.1f}" for zeta in np.linspace(40, 470, LEVELS))
PATIENCE = 120
"""Longest time for anything (s)."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A case of many levels, and the results of a run that nothing ends."""
    folder = tmp_path_factory.mktemp("whole")
    case = folder / "case.toml"
    case.write_text(case_text("newton", f"values = [{VALUES}]"), encoding="utf-8")
    assert main(["run", str(case), "-o", str(folder / "results")]) == SOLVED
    return case, folder / "results"


class Run:
    """``perfplast run`` on a number of ranks, with a session of its own."""

    def __init__(self, ranks: int, *arguments: object) -> None:
        launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        program = [*launch, sys.executable, "-m", "perfplast_fenicsx", "run"]
        # mpirun leaves its ranks a second by default
        environment = os.environ | {"PRTE_MCA_odls_base_sigkill_timeout": "60"}
        self.ranks = ranks
        self.process = subprocess.Popen(
            [*program, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            start_new_session=True,
        )

    def wait_for(self, what: Callable[[], bool]) -> None:
        """Wait until something is so, which it must become while the program runs."""
        end = time.monotonic() + PATIENCE
        while not what():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end
            time.sleep(0.002)

    def rank(self, number: int) -> int:
        """Process of a rank."""
        if self.ranks == 1:
            return self.process.pid
        # of all threads: OpenMPI 6 starts the ranks from another than the first
        threads = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        return sorted(int(child) for some in threads for child in some.read_text().split())[number]

    def ended(self) -> tuple[int, str]:
        """Exit status and standard error."""
        try:
            _, err = self.process.communicate(timeout=PATIENCE)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        return self.process.returncode, err


def solved(folder: Path, levels: int) -> Callable[[], bool]:
    """Whether a run has written so many levels."""
    return lambda: (folder / NEWEST).exists() and len(path_of(folder)) >= levels


def test_one_rank_is_ended_and_others_go_on(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """kill -9 of a rank of three, SIGTERM to one of two, and one finishes."""
    case, folder = whole[0], tmp_path / "results"
    run = Run(3, case, "-o", folder)
    run.wait_for(solved(folder, 5))
    os.kill(run.rank(1), signal.SIGKILL)
    status, _ = run.ended()
    assert status != SOLVED
    levels = len(path_of(folder))
    assert 5 <= levels < LEVELS

    run = Run(2, case, "--restart", folder)
    run.wait_for(solved(folder, levels + 3))
    os.kill(run.rank(1), signal.SIGTERM)
    status, err = run.ended()
    assert status == 128 + signal.SIGTERM
    assert f"perfplast run {case} --restart {folder}" in err
    assert "Traceback" not in err
    assert levels + 3 <= len(path_of(folder)) < LEVELS

    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


def test_control_c(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """A terminal sends it to the launcher and to all ranks."""
    case, folder = whole[0], tmp_path / "results"
    run = Run(1, case, "-o", folder)
    run.wait_for(solved(folder, 4))
    os.killpg(run.process.pid, signal.SIGINT)
    status, err = run.ended()
    assert status == 128 + signal.SIGINT
    assert err.count("\n") == 1
    assert f"perfplast run {case} --restart {folder}" in err
    assert 4 <= len(path_of(folder)) < LEVELS

    run = Run(2, case, "--restart", folder)
    run.wait_for(solved(folder, len(path_of(folder)) + 2))
    run.process.send_signal(signal.SIGINT)
    status, _ = run.ended()  # what mpirun makes of it
    assert status != SOLVED
    if MPI.get_vendor()[1] < (6,):  # later an mpirun that is interrupted kills its ranks at once
        assert f"--restart {folder}" in (folder / "run.log").read_text().splitlines()[-2]
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])

    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


def test_killed_at_any_moment(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """At most the running level is lost, whatever is just being written."""
    case, folder = whole[0], tmp_path / "results"
    moments = random.Random(8)
    begin: tuple[object, ...] = ("-o", folder)
    levels = 0
    for _ in range(3):
        run = Run(1, case, *begin)
        run.wait_for(solved(folder, levels + 1 if levels else 0))
        time.sleep(moments.uniform(0, 0.3))
        shown = len(path_of(folder))
        run.process.kill()
        run.ended()
        levels = len(path_of(folder))
        assert shown <= levels < LEVELS
        assert levels == 0 or len(fields_of(folder)) >= levels
        begin = ("--restart", folder)
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    same_path(folder, whole[1])


SMALL_DISK = """
set -u
mount -t tmpfs -o size="$3" tmpfs "$2" || exit 77
trap 'umount "$2"' EXIT
mpirun -n 2 "$5" -m perfplast_fenicsx run "$1" -o "$2/results" >"$4/out" 2>"$4/err"
echo $? >"$4/status"
cp -r "$2/results" "$4/full"
mount -o remount,size=100m "$2" || exit 77
"$5" -m perfplast_fenicsx run "$1" --restart "$2/results" >"$4/out2" 2>"$4/err2"
echo $? >"$4/status2"
cp -r "$2/results" "$4/results"
"""


def test_a_full_disk(whole: tuple[Path, Path], tmp_path: Path) -> None:
    """A disk of 400 kB, in a mount namespace of its own, that grows later."""
    case, disk, out = whole[0], tmp_path / "disk", tmp_path / "out"
    disk.mkdir()
    out.mkdir()
    enter = ["unshare", "--mount", "--propagation", "unchanged"]  # a chroot can change none
    if os.geteuid() != 0:
        enter = ["unshare", "--map-root-user", "--mount"]
    command = [*enter, "bash", "-c", SMALL_DISK, "bash", case, disk, "400k", out, sys.executable]
    if not shutil.which("unshare"):
        pytest.skip("no unshare")
    done = subprocess.run(list(map(str, command)), capture_output=True, timeout=PATIENCE)
    if not (out / "status").exists():
        pytest.skip(f"no mount here: {done.stderr.decode()}")
    assert (out / "status").read_text().strip() == str(BAD_INPUT)
    err = [line for line in (out / "err").read_text().splitlines() if line.startswith("perfplast")]
    assert len(err) == 1
    assert "No space left on device" in err[0]
    assert "--restart" in err[0]
    assert "Traceback" not in (out / "err").read_text()
    levels = len(path_of(out / "full"))
    assert 0 < levels < LEVELS
    assert len(fields_of(out / "full")) >= levels
    assert not list((out / "full").rglob("*.part"))
    with h5py.File(out / "full" / NEWEST) as file:
        assert len(file["header"]) > 0
    assert (out / "status2").read_text().strip() == str(SOLVED), (out / "err2").read_text()
    same_path(out / "results", whole[1])
