"""The script ./fenicsx, as far as it can be tried inside the environment that it has made."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "fenicsx"


def fenicsx(*command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [SCRIPT, *command], env=os.environ | variables, capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize("suite", ["bookworm", "Sid", "sid ", "../sid"])
def test_only_two_suites(suite: str) -> None:
    run = fenicsx("true", FENICSX_SUITE=suite)
    assert run.returncode == 125
    assert run.stderr == f"fenicsx: FENICSX_SUITE must be trixie or sid, not {suite}\n"
    assert not run.stdout


def test_empty_suite_is_none() -> None:
    run = fenicsx("echo", "here", FENICSX_SUITE="", PERFPLAST_WAY="native")
    assert (run.returncode, run.stdout, run.stderr) == (0, "here\n", "")


def test_a_suite_is_no_other() -> None:
    """At most one of them is this system itself."""
    runs = [
        fenicsx("echo", "here", FENICSX_SUITE=suite, PERFPLAST_WAY="native")
        for suite in ("trixie", "sid")
    ]
    assert [run.stdout for run in runs].count("here\n") < 2
    for run in runs:
        if run.returncode:
            assert run.returncode == 125
            assert not run.stdout
            assert "this is no Debian" in run.stderr
            assert run.stderr.count("\n") == 1


def test_usage_names_the_suites() -> None:
    run = fenicsx("--help")
    assert run.returncode == 0
    assert "FENICSX_SUITE=trixie|sid" in run.stdout
