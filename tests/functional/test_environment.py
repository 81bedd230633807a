"""Test the script ./fenicsx, as far as possible inside the environment that it has made."""

import os
import re
import subprocess
import tomllib
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


@pytest.mark.parametrize("way", ["Pip", "conda", "native "])
def test_only_three_ways(way: str) -> None:
    run = fenicsx("true", PERFPLAST_WAY=way)
    assert run.returncode == 125
    assert run.stderr == f"fenicsx: PERFPLAST_WAY must be native, pip or rootfs, not {way}\n"


def test_the_way_is_shown() -> None:
    run = fenicsx("--way", PERFPLAST_WAY="native")
    assert run.returncode == 0
    assert re.fullmatch(r"fenicsx: native: /\S+ \(\d+ s\)\n", run.stderr)


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ("Python 3.11.2 (/usr/bin/python3) is older than 3.12", "is older than 3.12"),
        ("there are no wheels of DOLFINx for Linux on aarch64", "for Linux on aarch64"),
        ("", "python3 does not run"),
    ],
)
def test_why_not_by_pip(tmp_path: Path, says: str, reason: str) -> None:
    """The message gives the reason why the wheels do not fit this Python."""
    for name in ("python3", "python3.12", "python3.13", "python3.14"):
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{says}'; exit 1\n", encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    run = fenicsx("true", PERFPLAST_WAY="pip", PATH=path, FENICSX_SUITE="")
    assert run.returncode == 125
    assert reason in run.stderr
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("pip_says", "reason"),
    [
        ("ERROR: [Errno 28] No space left on device", "is full"),
        ("WARNING: ProxyError('Cannot connect to proxy.')", "the proxy http://nowhere:1"),
        ("NewConnectionError: Failed to establish a new connection", "is there a network"),
        ("ERROR: something else", "see the end of"),
    ],
)
def test_why_pip_failed(tmp_path: Path, pip_says: str, reason: str) -> None:
    """A full disk, a proxy or a missing network gives one sentence; the log has the rest."""
    text = SCRIPT.read_text(encoding="utf-8")
    found = re.search(r"^install_by_pip\(\) \{.*?^\}", text, re.M | re.S)
    assert found is not None
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python3").write_text(f'#!/bin/sh\necho "{pip_says}"; exit 1\n')
    (tmp_path / "bin" / "python3").chmod(0o755)
    run = subprocess.run(
        [
            "bash",
            "-uc",
            f'requirements() {{ :; }}\n{found[0]}\ninstall_by_pip "$1" "$1/log" all',
            "-",
            str(tmp_path),
        ],
        env=os.environ
        | {"https_proxy": "http://nowhere:1", "base": str(tmp_path), "repo": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 1
    assert reason in run.stdout
    assert run.stdout.count("\n") == 1


def test_the_locked_versions_are_those_that_the_extras_ask_for() -> None:
    """Each requirement in pyproject.toml that ./fenicsx installs has a fixed version."""
    lines = (ROOT / "share/pip/constraints.txt").read_text(encoding="utf-8").splitlines()
    locked = {re.split("==", line)[0].replace("_", "-").lower() for line in lines if "==" in line}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *extras["test"]]
    for name in ("solver", "meshes", "pictures", "shell"):
        asked += extras[name]
        assert name in extras["all"][0]
    names = {re.split(r"[\[<>=; ]", text)[0].replace("_", "-").lower() for text in asked}
    assert names <= locked


def test_empty_suite_is_none() -> None:
    run = fenicsx("echo", "here", FENICSX_SUITE="", PERFPLAST_WAY="native")
    assert (run.returncode, run.stdout, run.stderr) == (0, "here\n", "")


def test_a_suite_is_no_other() -> None:
    """At most one of the suites is this system."""
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
    """Commands in the image may bypass the script."""
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


def test_what_nothing_loads_is_removed_from_a_virtual_environment(tmp_path: Path) -> None:
    """VTK's list of modules omits the removed modules, so VTK can be imported."""
    found = re.search(r"^slim\(\) \{.*?^\}", SCRIPT.read_text(encoding="utf-8"), re.M | re.S)
    assert found is not None
    packages = tmp_path / "lib" / "python3.13" / "site-packages"
    gone = ["vtkmodules/libviskores_cont-1.0.so", "vtkmodules/vtkAcceleratorsVTKmCore.so"]
    gone += ["numpy/linalg/tests/test_linalg.py", "scipy/sparse/tests/data/x.npz"]
    kept = ["vtkmodules/libvtkCommonCore.so", "numpy/testing/__init__.py", "pyvista/tests/x.py"]
    for name in (*gone, *kept):
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).touch()
    lists = [packages / "vtkmodules" / "all.py", packages / "vtk.py"]
    for each in lists:
        each.write_text("from x.vtkAcceleratorsVTKmCore import *\nfrom x.vtkCommonCore import *\n")
    subprocess.run(["bash", "-euc", f'{found[0]}\nslim "$1"', "-", tmp_path], check=True)
    assert [name for name in gone if (packages / name).exists()] == []
    assert [name for name in kept if not (packages / name).exists()] == []
    assert {each.read_text() for each in lists} == {"from x.vtkCommonCore import *\n"}


def test_what_chooses_instructions_reaches_the_command() -> None:
    """The clean environment of the root file system keeps the variables that may change numbers."""
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
