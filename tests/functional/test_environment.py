"""The script ./fenicsx, as far as it can be tried inside the environment that it has made."""

import os
import re
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "fenicsx"


def fenicsx(*command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [SCRIPT, *command], env=os.environ | variables, capture_output=True, text=True
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


def test_the_image_sets_what_the_script_sets() -> None:
    """Commands in the image need not go through the script."""
    found = re.search(r"^defaults=\((.*?)^\)", SCRIPT.read_text(encoding="utf-8"), re.M | re.S)
    assert found is not None
    defaults = set(re.sub(r"#.*", "", found[1]).split())
    dockerfile = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    found = re.search(r"^ENV (.*?[^\\])$", dockerfile, re.M | re.S)
    assert found is not None
    assert set(found[1].replace("\\\n", " ").split()) == defaults | {"LANG=C.UTF-8"}


def test_what_killed_runs_left_half_compiled_is_removed(tmp_path: Path) -> None:
    found = re.search(r"^sweep_forms\(\) \{.*?^\}", SCRIPT.read_text(encoding="utf-8"), re.M | re.S)
    assert found is not None
    forms = tmp_path / "fenics"
    forms.mkdir()
    for name in ("libffcx_forms_whole", "libffcx_forms_old", "libffcx_expressions_new"):
        for suffix in (".c", ".o", ".cpython-313-x86_64-linux-gnu.so"):
            (forms / f"{name}{suffix}").touch()
    (forms / "libffcx_forms_whole.c.cached").touch()
    os.utime(forms / "libffcx_forms_old.c", (0, 0))

    def left(*which: str) -> set[str]:
        script = f'{found[0]}\nsweep_forms "$@"' if found else ""
        subprocess.run(["bash", "-euc", script, "-", tmp_path, *which], check=True)
        return {path.name.partition(".")[0] for path in forms.iterdir()}

    assert left("-mmin", "+30") == {"libffcx_forms_whole", "libffcx_expressions_new"}
    assert left() == {"libffcx_forms_whole"}
    assert len(list(forms.iterdir())) == 4


def test_what_chooses_instructions_reaches_the_command() -> None:
    """The clean environment of the root file system has what the numbers may depend on."""
    chosen = {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "PETSC_OPTIONS"}
    found = re.search(r"^passed_on\(\) \{.*?^\}", SCRIPT.read_text(encoding="utf-8"), re.M | re.S)
    assert found is not None
    run = subprocess.run(
        ["bash", "-c", f"{found[0]}\npassed_on"],
        env=os.environ | dict.fromkeys([*chosen, "ANYTHING_ELSE"], ""),
        capture_output=True,
        text=True,
    )
    assert chosen <= set(run.stdout.split())
    assert "ANYTHING_ELSE" not in run.stdout
