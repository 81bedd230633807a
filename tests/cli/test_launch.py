"""Test environments that cannot run, and the launcher of ranks: one sentence before MPI starts."""

import sys
from pathlib import Path

import pytest

from perfplast_fenicsx import environment
from perfplast_fenicsx.cli import launch
from perfplast_fenicsx.environment import COMPLEX, WHEEL, Surroundings
from tests.installed_package import ROOT, perfplast

pytestmark = pytest.mark.serial

SITE = Path("/venv/lib/python3.13/site-packages")

SOUND = {
    "python": (3, 13),
    "system": "Linux",
    "machine": "x86_64",
    "libc": ("glibc", "2.41"),
    "distributions": frozenset([WHEEL]),
    "dolfinx": SITE / "dolfinx",
    "petsc4py": SITE / "petsc4py",
}
MISSING = {"dolfinx": None, "petsc4py": None, "distributions": frozenset()}

SPOILT = [
    ({"distributions": {WHEEL, COMPLEX}}, "overwrite each other's files; uninstall both"),
    ({"distributions": {COMPLEX}}, f"pip uninstall {COMPLEX}"),
    ({"distributions": {WHEEL, "petsc4py"}}, f"petsc4py and {WHEEL}"),
    ({"petsc4py": Path("/opt/petsc/lib/petsc4py")}, "import petsc4py from /opt/petsc/lib/petsc4py"),
    (MISSING, "pip install 'perfplast-fenicsx[all]'"),
    (MISSING | {"python": (3, 11)}, "needs Python ≥ 3.12, not 3.11"),
    (MISSING | {"machine": "aarch64"}, "PyPI has no DOLFINx for Linux on aarch64"),
    (MISSING | {"system": "Darwin", "machine": "arm64"}, "PyPI has no DOLFINx for Darwin on arm64"),
    (MISSING | {"libc": ("", "")}, "musl"),
    (MISSING | {"libc": ("glibc", "2.31")}, "glibc ≥ 2.34, not 2.31"),
]


@pytest.mark.parametrize(("spoilt", "says"), SPOILT)
def test_a_spoilt_environment_is_one_sentence(spoilt: dict[str, object], says: str) -> None:
    fault = Surroundings(**(SOUND | spoilt)).fault()  # type: ignore[arg-type]
    assert fault is not None
    assert says in fault
    assert fault.endswith(".")
    assert "\n" not in fault


def test_a_sound_environment_has_no_fault() -> None:
    assert Surroundings(**SOUND).fault() is None  # type: ignore[arg-type]
    debian = {"distributions": frozenset({"petsc4py", "slepc4py"})}
    assert Surroundings(**(SOUND | debian)).fault() is None  # type: ignore[arg-type]
    assert environment.surroundings().fault() is None


def test_forms_need_a_compiler_headers_and_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert environment.forms_fault() is None
    monkeypatch.setenv("CC", "no-such-compiler -O2")
    assert "there is no C compiler no-such-compiler" in str(environment.forms_fault())
    monkeypatch.delenv("CC")
    monkeypatch.setattr("sysconfig.get_path", lambda name: str(tmp_path))
    monkeypatch.delenv("CPATH", raising=False)
    assert "Python.h is missing" in str(environment.forms_fault())
    (tmp_path / "Python.h").touch()
    assert environment.forms_fault() is None
    monkeypatch.setattr(environment, "SPACE", 1e18)
    assert "MB left" in str(environment.forms_fault())
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert "set XDG_CACHE_HOME" in str(environment.forms_fault())


def program(path: Path, says: str) -> None:
    path.write_text(f"#!/bin/sh\n{says}\n", encoding="utf-8")
    path.chmod(0o755)


def test_the_launcher_is_that_of_the_mpi_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path / "mpirun", "echo 'mpirun (Open MPI) 5.0.7'")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    monkeypatch.setattr(launch, "mpi_family", lambda: "MPICH")
    with pytest.raises(LookupError, match="no mpirun of MPICH"):
        launch.find_launcher()
    program(tmp_path / "mpiexec", "echo 'HYDRA build details:\n    Version:    5.0.2'")
    found = launch.find_launcher()
    assert (found.family, found.version) == ("MPICH", "5.0.2")
    assert found.program == str(tmp_path / "mpiexec")
    monkeypatch.setattr(launch, "mpi_family", lambda: "Open MPI")
    assert launch.find_launcher().program == str(tmp_path / "mpirun")


def test_ranks_of_a_launcher_are_recognised() -> None:
    assert launch.launched_ranks({}) is None
    found = launch.launched_ranks({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_RANK": "3"})
    assert found == ("Open MPI", 3, 4)
    assert launch.launched_ranks({"PMI_SIZE": "2", "PMI_RANK": "0"}) == ("MPICH", 0, 2)


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"}, "a separate run"),
        ({"OMPI_COMM_WORLD_SIZE": "3"}, "-n 2 is given inside mpirun -n 3"),
    ],
)
def test_processes_that_are_no_ranks_end_in_a_sentence(
    variables: dict[str, str], says: str
) -> None:
    run = perfplast("run", "-n", "2", "case.toml", "-o", "out", **variables)
    assert run.returncode == 2
    assert says in run.stderr
    assert run.stderr.count("\n") == 1


def test_no_ranks_are_refused() -> None:
    run = perfplast("run", "-n", "0", "case.toml", "-o", "out")
    assert run.returncode == 2
    assert run.stderr == (
        "perfplast: -n 0 is less than 1; give a number of ranks, for example -n 2.\n"
    )


def test_run_starts_its_ranks(tmp_path: Path) -> None:
    run = perfplast("run", "-n", "2", str(tmp_path / "none.toml"), "-o", str(tmp_path / "out"))
    lines = run.stderr.splitlines()
    assert lines[0].startswith("perfplast: 2 ranks started by /")
    assert sum("none.toml" in line for line in lines) == 1  # only rank 0 prints it
    assert run.returncode == 2


def test_forms_that_lack_and_cannot_be_compiled_are_one_sentence(tmp_path: Path) -> None:
    """Some forms are already compiled, so the compiler is missed in the middle of a run."""
    (tmp_path / "fenics").mkdir()
    (tmp_path / "fenics" / "libffcx_forms_of_another_case.so").touch()
    case = str(ROOT / "demos" / "block_on_plane.toml")
    spoilt = {"XDG_CACHE_HOME": str(tmp_path), "CC": "/no/such/cc"}
    run = perfplast("run", case, "-o", str(tmp_path / "out"), "--quiet", **spoilt)
    assert run.returncode == 2
    assert run.stderr.splitlines()[-1].startswith("perfplast: there is no C compiler /no/such/cc")
    assert "Traceback" not in run.stderr


@pytest.mark.long
def test_the_doctor_finds_this_environment_well() -> None:
    """The test does not measure how fast this machine factorises."""
    run = perfplast("doctor")
    lines = run.stdout.splitlines()
    assert lines[1].startswith("C compiler      ok ")
    assert any("GFLOP/s" in line for line in lines)
    assert not [line for line in lines if "  FAULT  " in line and "GFLOP/s" not in line]


def test_the_doctor_names_each_fault_and_remedy(tmp_path: Path) -> None:
    run = perfplast(
        "doctor", CC="no-such-compiler", PATH=str(tmp_path), XDG_CACHE_HOME="/proc/none"
    )
    assert run.returncode == 2
    faults = [line for line in run.stdout.splitlines() if "  FAULT  " in line]
    assert len(faults) >= 2
    assert "no-such-compiler" in faults[0]
    assert "XDG_CACHE_HOME" in faults[1]
    assert "Traceback" not in run.stdout + run.stderr
    (solving,) = (line for line in faults if line.startswith("DOLFINx"))
    assert solving.endswith("see the line of the C compiler.")
