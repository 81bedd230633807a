"""Test ``perfplast run`` and ``check``: exit statuses, messages, and files that a run leaves."""

import csv
import io
import json
import logging
import re
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import h5py
import numpy as np
import pytest

import perfplast_fenicsx
from perfplast_fenicsx import Elastic, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import commands
from perfplast_fenicsx.cli.parser import BAD_INPUT, FAULT, NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.run_log import RunLog
from perfplast_fenicsx.cli.terminal import Terminal, shows
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.rounding import rounded_up
from tests.io.results.test_result_folder import report
from tests.models import punch_case, write_case

CASE = punch_case(
    Elastic(2e5, 0.3),
    VonMises(2e5, 0.3, yield_stress=100.0),
    more="[loading]\nvalues = [50.0, 80.0]\n[output]\npictures = false\n"
    '[units]\nsystem = "mm-N-MPa"\n',
    title="A punch on a block",
)

DEMO = Path(__file__).parents[2] / "demos" / "two_blocks.toml"


@pytest.fixture
def case(shared_tmp_path: Path, comm: MPI.Intracomm) -> Path:
    """Write the case above."""
    return write(comm, shared_tmp_path, CASE)


def write(comm: MPI.Intracomm, folder: Path, text: str) -> Path:
    return write_case(comm, folder / "case.toml", text)


def one_line(comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the only line on standard error, which rank 0 has written."""
    err = capsys.readouterr().err
    assert comm.rank == 0 or err == ""
    err = comm.bcast(err)
    assert err.startswith("perfplast: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    return err


@pytest.mark.mpi2
def test_run(
    case: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    if comm.rank == 0:
        understood, _, solved = out.partition("A punch on a block: ")
        assert understood.startswith("Loads at zeta = 1:\n  top: pressure 1 MPa on 'top'; area ")
        assert "\nSupports:\n" in understood
        header, columns, first, second, *forces, meaning, units, files = solved.splitlines()
        levels = (first, second)
        assert header.startswith("base, punch; ")
        assert "9 contact pairs" not in header
        assert "4 contact pairs; method newton on" in header
        assert forces[0].startswith("Forces (N) at zeta = 80, in balance to ")
        assert meaning == "zeta = 1 is pressure 1 MPa on 'top'."
        assert units == (
            "Units: lengths in mm, forces in N, stresses in MPa, works in N mm, moments of results"
            " in N m."
        )
        words = [line.split() for line in forces[1:]]
        assert [" ".join(line[:-3]) for line in words] == [
            *("loads", "support x0", "support y0", "support bottom"),
            "contact punch_bottom base_top",
        ]
        assert (words[0][-1], words[3][-1]) == ("-20", "20")  # on a quarter of the area 1
        assert {len(line) for line in levels} == {len(columns)}
        assert levels[0].split()[:2] == ["1", "50"]
        assert "\r" not in out
        assert str(results) in files
    else:
        assert out == ""
    assert {entry.name for entry in results.iterdir()} == {
        *("summary.json", "path.csv", "run.log", "scene.json", "fields.vtkhdf.series"),
        *("fields", "checkpoint.h5", "checkpoint_before.h5"),
    }
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    assert [step["zeta"] for step in summary["steps"]] == [50.0, 80.0]
    assert all(step["converged"] for step in summary["steps"])
    assert set(summary["timings"]) == {"setup", "solve", "output", "total"}
    assert summary["version"] == perfplast_fenicsx.__version__

    comm.barrier()
    before = (results / "summary.json").stat().st_mtime_ns
    assert main(["run", str(case), "-o", str(results)]) == BAD_INPUT
    assert "already has results" in one_line(comm, capsys)
    assert (results / "summary.json").stat().st_mtime_ns == before


def test_a_load_above_the_limit(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    text = CASE.replace("[50.0, 80.0]", "[50.0, 99.9, 101.0, 110.0]")
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == NO_SOLUTION
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert "No solution at zeta = 101: " in out
    with (results / "path.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["converged"] for row in rows] == ["True", "True", "False"]
    assert len(json.loads((results / "fields.vtkhdf.series").read_text())["files"]) == 2


CONSTANT = """[[load]]
on = "top"
pressure = {pressure}
constant = true
[[load]]"""


def test_a_constant_load(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    """The level at ζ = 0 is a separate level."""
    text = CASE.replace("[[load]]", CONSTANT.format(pressure='"30 + 0*x"'))
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results), "--quiet"]) == NO_SOLUTION
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    assert [step["zeta"] for step in summary["steps"]] == [0.0, 50.0, 80.0]
    assert [step["converged"] for step in summary["steps"]] == [True, True, False]
    loads = [step["reactions"]["loads"][2] for step in summary["steps"]]
    assert loads == pytest.approx([-7.5, -20.0, -27.5])
    assert max(step["balance"] for step in summary["steps"][:2]) < 1e-10

    heavy = write(comm, shared_tmp_path, text.replace("30 + 0*x", "130"))
    assert main(["run", str(heavy), "-o", str(shared_tmp_path / "heavy")]) == NO_SOLUTION
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert "No solution at zeta = 0: the bodies cannot carry the constant loads alone" in out


def test_limit_load_by_a_path(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    control = 'control = "work"\nuntil = "limit"\nlimit_tolerance = 1e-4\nlimit_method = "path"'
    text = CASE.replace("values = [50.0, 80.0]", control)
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, _ = capsys.readouterr()
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    limit = summary["limit"]
    assert (summary["method"], summary["prescribed"]) == ("work-newton", "alpha")
    assert limit["levelled_off"]
    assert limit["lower"] == pytest.approx(100.0, rel=1e-4)
    assert limit["lower"] <= limit["estimate"] <= 100.0 * (1 + 1e-4)
    assert limit["upper"] is None or limit["upper"] >= limit["lower"]
    assert limit["alpha"] == summary["steps"][-1]["alpha"]
    assert limit["linear_solves"] > len(summary["steps"])
    assert (limit["method"], limit["iterations"]) == ("path", len(summary["steps"]))
    assert limit["factorisations"] is limit["body"] is None
    assert (results / "mechanism.vtkhdf").exists()
    if comm.rank == 0:
        found = re.search(r"Limit load of this mesh: ([0-9.]+) \(.*an estimate for the body", out)
        assert found is not None
        assert float(found[1]) == pytest.approx(limit["estimate"], rel=1e-3)
        assert "upper bound" not in out


@pytest.mark.mpi2
def test_limit_load_by_default(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    """The default finds the limit load without a path, in few factorisations."""
    text = CASE.replace("values = [50.0, 80.0]", 'control = "work"\nuntil = "limit"')
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, _ = capsys.readouterr()
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    limit = summary["limit"]
    assert (summary["method"], limit["method"]) == ("interior-point", "interior-point")
    assert summary["steps"] == []
    assert set(summary["timings"]) == {"setup", "solve", "output", "total"}
    assert limit["levelled_off"]
    assert limit["lower"] <= limit["estimate"] <= limit["upper"] <= limit["lower"] * 1.001
    assert limit["estimate"] == pytest.approx(100.0, rel=1e-3)
    assert limit["iterations"] < limit["factorisations"] <= 35
    body = limit["body"]
    assert body["upper"] == pytest.approx(100.0, rel=1e-3)
    assert body["lower"] is None
    assert not body["strict"]
    assert body["why_not"] == ["lower bound: not computed; control = 'bounds' computes it"]
    assert re.fullmatch("static and kinematic load are .* % apart", limit["reason"])
    with (results / "path.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["body_lower"] == ""
    proven = check(results / "bounds.h5")
    assert list(proven) == ["upper"]
    assert proven["upper"].proven == pytest.approx(body["upper"], rel=1e-9)
    assert body["certificates"]["inadmissible"] < 1e-9
    log = (results / "run.log").read_text(encoding="utf-8")
    assert log.count(" step ") == limit["iterations"]
    if comm.rank == 0:
        assert "method interior-point" in out
        assert "MUMPS Cholesky" in out
        assert "Newton" not in out
        assert f"({limit['factorisations']} factorisations)" in out
        assert (
            f"The body that the mesh fills collapses at {rounded_up(body['upper'])} or less" in out
        )


@pytest.mark.mpi2
def test_bounds(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    """In 3D, the upper bound has quadratic mechanisms on a split mesh, which is on file."""
    text = CASE.replace("values = [50.0, 80.0]", 'control = "bounds"\nlimit_tolerance = 1e-3')
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    out, _ = capsys.readouterr()
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    body = summary["limit"]["body"]
    assert body["upper"] == pytest.approx(100.0, rel=2e-3)
    assert body["lower"] == pytest.approx(100.0, rel=2e-3)
    assert body["strict"]
    assert body["why_not"] == []
    with (results / "path.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["mesh"], row["cells"]) == ("1", str(summary["mesh"]["cells"]))
    for column, key in (("static", "lower"), ("estimate", "estimate"), ("kinematic", "upper")):
        assert float(row[column]) == pytest.approx(summary["limit"][key], rel=1e-12)
    for key in ("lower", "upper"):
        assert float(row[f"body_{key}"]) == pytest.approx(body[key], rel=1e-12)
    assert float(row["seconds"]) > 0
    proven = check(results / "bounds.h5")
    for kind in ("lower", "upper"):
        assert not proven[kind].faults
        assert proven[kind].proven == pytest.approx(body[kind], rel=1e-9)
    with h5py.File(results / "mechanism.vtkhdf", locking=False) as file:
        cells = file["VTKHDF/CellData"]
        assert {*file["VTKHDF/PointData"]} == {"mechanism", "contact_pressure"}
        ours = {"lower_bound_stress", "gap_share"}
        assert {*cells} == {"body", "dissipation", "stress", "yield_ratio"} | ours
        assert np.sum(cells["gap_share"]) == pytest.approx(4)  # fractions sum to 1 in each part
        stress = np.reshape(cells["lower_bound_stress"], (-1, 3, 3))
        assert np.allclose(stress, stress.transpose(0, 2, 1))
        assert stress[:, 2, 2].mean() < -10
        assert len(cells["dissipation"]) == 4 * summary["mesh"]["cells"]
    if comm.rank == 0:
        assert "P2" in out
        lines = out.splitlines()
        of_body = next(k for k, line in enumerate(lines) if line.startswith("The body that the"))
        assert lines[of_body].startswith("The body that the mesh fills collapses between")
        of_mesh, *forces = lines[of_body + 1 :]
        assert forces[0].split() == ["Forces", "(N)", "x", "y", "z"]
        assert of_mesh.startswith("Limit load of this mesh: 100 (static and kinematic sides ")


@pytest.mark.parametrize("control", ['control = "work"\nuntil = "limit"', 'control = "bounds"'])
@pytest.mark.parametrize(
    ("old", "new", "status", "part"),
    [
        ("pressure = 1.0", "pressure = -1.0", BAD_INPUT, "no stress can carry the loads"),
        ('on = "bottom"', 'on = "bottom"\ncomponents = "x"', BAD_INPUT, "can move as a rigid body"),
        (
            'law = "von-mises"\nyoung = 200000.0\npoisson = 0.3\nyield_stress = 100.0',
            'law = "elastic"\nyoung = 2e5\npoisson = 0.3',
            NO_SOLUTION,
            "nothing can yield",
        ),
    ],
)
def test_no_limit_load(
    control: str,
    old: str,
    new: str,
    status: int,
    part: str,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    text = CASE.replace("values = [50.0, 80.0]", control).replace(old, new)
    if "elastic" in new and "work" in control:  # bounds may find that contacts limit the load
        status = BAD_INPUT
    case, results = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    if "elastic" in new:
        assert main(["check", str(case)]) == (BAD_INPUT if status == BAD_INPUT else SOLVED)
        checked = "".join(capsys.readouterr())
        words = part if status == BAD_INPUT else "No body can yield"
        assert comm.rank or words in checked
    assert main(["run", str(case), "-o", str(results)]) == status
    out, err = capsys.readouterr()
    if comm.rank == 0:
        assert part in (err if status == BAD_INPUT else out)
        assert err.count("\n") == (status == BAD_INPUT)
    assert not (results / "mechanism.vtkhdf").exists()


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("young", "yung", "did you mean 'young'?"),
        ('on = "top"', 'on = "tip"', "'tip'"),
        ("[50.0, 80.0]", "[]", "[loading]: values is empty"),
    ],
)
@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_case(
    command: str,
    old: str,
    new: str,
    part: str,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    case, results = write(comm, shared_tmp_path, CASE.replace(old, new)), shared_tmp_path / "out"
    more = ["-o", str(results)] if command == "run" else []
    assert main([command, str(case), *more]) == BAD_INPUT
    assert part in one_line(comm, capsys)
    assert not results.exists()


def test_bad_input_leaves_older_results(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    case = write(comm, shared_tmp_path, CASE.replace("base_top", "base_bottom"))
    old = shared_tmp_path / "summary.json"
    if comm.rank == 0:
        old.write_text("old")
    comm.barrier()
    assert main(["run", str(case), "-o", str(shared_tmp_path), "--force"]) == BAD_INPUT
    assert "base_bottom" in one_line(comm, capsys)
    assert old.read_text() == "old"


@pytest.mark.mpi2("arguments0-COMMAND")
@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ([], "COMMAND"),
        (["ran"], "ran"),
        (["run", "case.toml"], "-o/--output"),
        (["check", "no-such-case.toml"], "'no-such-case.toml' cannot be read"),
        (["check", str(DEMO), "--", "ksp_type", "cg"], "'ksp_type'"),
        (["run", "case.toml", "-o", "r", "--log-level", "loud"], "'loud' (choose from"),
        (["run", "case.toml", "-o", "r", "--frce"], "did you mean '--force'?"),
        (["plot", "a", "b"], "perfplast plot has no argument 'b';"),
        (["info", "--", "-ksp_type", "cg"], "takes no PETSc options"),
    ],
)
def test_bad_arguments(
    arguments: list[str],
    part: str,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(arguments) == BAD_INPUT
    assert part in one_line(comm, capsys)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--version"], f"perfplast {perfplast_fenicsx.__version__}"),
        (["--help"], "3 a load level has no solution"),
        (["run", "--help"], "-perfplast_ksp_rtol"),
    ],
)
def test_information(
    arguments: list[str],
    part: str,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(arguments) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    assert (part in " ".join(out.split())) == (comm.rank == 0)


@pytest.mark.mpi2
def test_check(case: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(case)]) == SOLVED
    out, _ = capsys.readouterr()
    assert ("can be run" in out) == (comm.rank == 0)
    assert ("all of side z = 0 of 'base'" in out) == (comm.rank == 0)
    assert [entry.name for entry in case.parent.iterdir()] == ["case.toml"]


def test_petsc_options_reach_the_solver(
    case: Path, shared_tmp_path: Path, comm: MPI.Intracomm
) -> None:
    options = PETSc.Options()
    given = {"perfplast_ksp_type": "cg", "perfplast_pc_type": "jacobi", "test_flag": None}
    arguments = [part for key, value in given.items() for part in (f"-{key}", value) if part]
    results = shared_tmp_path / "results"
    try:
        command = ["run", str(case), "-o", str(results), "--", "-perfplast_ksp_rtol", "1e-11"]
        assert main([*command, *arguments]) == SOLVED
        assert options.hasName("test_flag")
        (step, _) = json.loads((results / "summary.json").read_text(encoding="utf-8"))["steps"]
        assert step["linear_iterations"] > 3 * step["active_set_iterations"]  # no Cholesky
    finally:
        for key in (*given, "perfplast_ksp_rtol"):
            options.delValue(key)


def test_a_fault_of_the_program(
    case: Path,
    comm: MPI.Intracomm,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if comm.size > 1:
        pytest.skip("ends all ranks")

    def fail(*_: object) -> None:
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr(commands, "read_case", fail)
    assert main(["check", str(case)]) == FAULT
    assert "ZeroDivisionError: a fault" in capsys.readouterr().err


def test_as_a_program(case: Path, comm: MPI.Intracomm) -> None:
    if comm.size > 1:
        pytest.skip("a program that uses MPI cannot start another")
    program = [sys.executable, "-m", "perfplast_fenicsx"]
    done = subprocess.run([*program, "check", str(case)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (SOLVED, "")
    done = subprocess.run([*program, "check", "no.toml"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (BAD_INPUT, "")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_help_is_there_at_once(option: str, comm: MPI.Intracomm) -> None:
    """The command imports no slow module; a measured time would depend on the machine."""
    if comm.size > 1:
        pytest.skip("a program that uses MPI cannot start another")
    program = (
        "import sys; from perfplast_fenicsx.__main__ import main; main(sys.argv[1:]);"
        "print({'mpi4py.MPI', 'petsc4py.PETSc', 'dolfinx', 'numpy', 'scipy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program, option], capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stdout.startswith(("perfplast ", "usage: perfplast "))
    assert done.stdout.endswith("set()\n")


@pytest.mark.mpi2
@pytest.mark.parametrize("command", [["check"], ["info"], ["run", "-o", "r"]])
def test_what_is_not_toml_is_refused_before_commands_begin(
    command: list[str],
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(commands, "execute", None)
    case = write(comm, shared_tmp_path, "[mesh")
    assert main([*command, str(case)]) == BAD_INPUT
    assert "case.toml is not valid TOML" in one_line(comm, capsys)
    assert main([*command, str(shared_tmp_path / "no.toml")]) == BAD_INPUT
    assert "no.toml' cannot be read" in one_line(comm, capsys)


def assert_not_imported(program: str, modules: set[str]) -> None:
    """Run a program in a process of its own, and check that it imports none of the modules."""
    program = f"import sys; {program}; print({modules} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "set()\n")


def test_what_is_not_toml_is_refused_without_slow_imports(comm: MPI.Intracomm) -> None:
    if comm.size > 1:
        pytest.skip("a program that uses MPI cannot start another")
    program = "from perfplast_fenicsx.__main__ import main; main(['check', 'no.toml'])"
    assert_not_imported(program, {"petsc4py.PETSc", "dolfinx", "ufl", "scipy"})


def test_it_starts_without_what_few_commands_need(comm: MPI.Intracomm) -> None:
    """Libraries of meshers and pictures, which the program uses in separate processes."""
    if comm.size > 1:
        pytest.skip("a program that uses MPI cannot start another")
    assert_not_imported("import perfplast_fenicsx.cli.commands", {"gmsh", "matplotlib", "pyvista"})


@pytest.mark.mpi2
def test_live_line(
    case: Path, comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.StringIO()
    live = lambda comm, **_: Terminal(comm, stream, live=True)  # noqa: E731
    monkeypatch.setattr(commands, "Terminal", live)
    monkeypatch.setattr("perfplast_fenicsx.cli.terminal.LIVE_PERIOD", 0.0)
    assert main(["run", str(case), "-o", str(shared_tmp_path / "results")]) == SOLVED
    text = stream.getvalue()
    if comm.rank > 0:
        assert text == ""
        return
    assert re.match(r"\r\d+:\d\d  setting up the problem\r", text)
    for zeta, level in ((50, 1), (80, 2)):
        level_line = rf"level {level}/2(?:, \d+:\d\d left)?: zeta {zeta}, alpha (\S+), Newton 1, "
        pattern = rf"\r\d+:\d\d  {level_line}(.*?) *\r"
        found = re.search(pattern, text)
        assert found is not None
        assert float(found[1]) > 0
        assert re.match(r"\d+\.\d% plastic", found[2])
    for line in text.split("\n"):  # the last text after each blanked line remains
        *_, blank, last = line.split("\r") if "\r" in line else ("", line)
        assert blank.strip() == ""
        assert "increment" not in last


def test_run_log(case: Path, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results), "--quiet"]) == SOLVED
    lines = (results / "run.log").read_text(encoding="utf-8").splitlines()
    stamp = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} INFO    ")
    assert all(stamp.match(line) for line in lines)
    text = "\n".join(stamp.sub("", line) for line in lines)
    assert text.startswith(f"perfplast {perfplast_fenicsx.__version__}, DOLFINx ")
    assert f"\nranks: {comm.size} on " in text
    assert "\ncase.options: NewtonOptions(" in text
    assert "\ncase.loading: LoadControl(values=[50.0, 80.0])\n" in text
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    for number, step in enumerate(summary["steps"], start=1):
        steps = re.findall(rf"^level {number}, step \d+: zeta ", text, re.MULTILINE)
        assert len(steps) == step["newton_iterations"]
        assert f"\nlevel {number}: solved (" in text
    assert text.splitlines()[-1].startswith("ended after ")


def test_warnings_and_faults_are_in_the_log(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    log = logging.getLogger("perfplast_fenicsx.test")
    before = log.getEffectiveLevel()
    with pytest.raises(ZeroDivisionError), RunLog(folder):
        log.debug("too small")
        log.warning("watch out")
        raise ZeroDivisionError("a fault")
    log.warning("not in the file any more")
    assert log.getEffectiveLevel() == before
    comm.barrier()
    text = folder.file("run.log").read_text(encoding="utf-8")
    assert text.count(" WARNING watch out\n") == 1
    assert text.count(" ERROR   ended by ZeroDivisionError\n") == 1
    assert "\nZeroDivisionError: a fault\n" in text
    assert "too small" not in text
    assert "any more" not in text
    with RunLog(folder, "debug", first=3) as journal:
        log.debug("seen now")
        journal.level(report(7.5, reason="criterion met"))
    comm.barrier()
    text = folder.file("run.log").read_text(encoding="utf-8")
    assert "watch out" in text
    assert " DEBUG   seen now\n" in text
    assert " INFO    level 3: solved (criterion met): zeta 7.5, alpha " in text


@pytest.mark.parametrize("more", [["--quiet"], ["--quiet", "--log-level", "info"], []])
def test_what_is_shown(
    more: list[str],
    case: Path,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["run", str(case), "-o", str(shared_tmp_path / "results"), *more]) == SOLVED
    out, err = capsys.readouterr()
    assert (out == "") == ("--quiet" in more or comm.rank > 0)
    steps = re.findall(r"^perfplast: INFO: level 1, step \d+: zeta 50, ", err, re.MULTILINE)
    assert bool(steps) == ("info" in more and comm.rank == 0)
    assert (err == "") == ("info" not in more or comm.rank > 0)


def test_info(comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info"]) == SOLVED
    out, err = capsys.readouterr()
    assert err == ""
    facts = dict(re.split(r"  +", line, maxsplit=1) for line in out.splitlines())
    if comm.rank > 0:
        assert facts == {}
        return
    assert facts["perfplast"] == perfplast_fenicsx.__version__
    assert facts["PETSc"] == ".".join(map(str, PETSc.Sys.getVersion()))
    assert facts["ranks"].split()[0] == str(comm.size)
    assert "mumps" in facts["PETSc packages"]
    assert "blas" in facts["BLAS"].lower()
    assert "core" in facts["threads"]


def test_nobody_watches_a_file(tmp_path: Path) -> None:
    with (tmp_path / "log").open("w") as file:
        assert not shows(file)
