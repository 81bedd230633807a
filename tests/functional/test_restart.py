"""Test checkpoints, restarts, interrupts: an interrupted run continues as without interruption."""

import csv
import json
import os
import shutil
import signal
from collections.abc import Callable, Collection
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Elastic, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import recorder
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.results import checkpoints
from perfplast_fenicsx.io.results.checkpoints import BEFORE, NEWEST, SCHEMA
from perfplast_fenicsx.limit_analysis import InteriorStep
from perfplast_fenicsx.problem.judged.state import Level
from tests.models import PUNCH_LIMIT, case_text, punch_case, write_case

STRONG = VonMises(2e5, 0.3, PUNCH_LIMIT)
CASE = punch_case(STRONG, STRONG, "0.0004 * x**2", more="[output]\npictures = false\n")

RUBS = 'secondary = "base_top"\n'

LOADINGS = {
    "newton": "values = [200.0, 350.0, 380.0]",
    "augmented-lagrangian": "values = [200.0, 350.0, 450.0]",
    "work-newton": 'control = "work"\nvalues = [3e-4, 6e-4, 1.2e-3]',
    "bordered-newton": 'control = "work"\nvalues = [3e-4, 6e-4, 1.2e-3]',
}
CONSTANT = '[[load]]\non = "top"\npressure = "100 + x"\nconstant = true'
OTHERS = list(LOADINGS)[1:]
LIMIT = 'control = "work"\nuntil = "limit"\nlimit_tolerance = 1e-3'


def solved_by(method: str, loading: str, more: str = "") -> str:
    return f'{CASE}{more}\n[solve]\nmethod = "{method}"\n[loading]\n{loading}\n'


def path_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "path.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def same_path(one: Path, other: Path, at_rest: Collection[str] = ()) -> None:
    """Check that levels are the same, with ζ and α to 1e-10, and fields agree.

    In steps at rest, rounding determines which pairs touch without forces, the residual stress, the
    number of Newton steps, and the position of bodies without pressure. The deformation of cells
    must agree.
    """
    rows, others = path_of(one), path_of(other)
    assert [row["step"] for row in rows] == [str(i + 1) for i in range(len(rows))]
    assert len(rows) == len(others)
    for row, expected in zip(rows, others, strict=True):
        assert row["converged"] == expected["converged"]
        keys = ["zeta", "alpha"]
        if row["step"] not in at_rest:
            keys.append("max_displacement")
            # With several ranks MUMPS adds messages in the order of arrival; rounding may change
            # the steps.
            assert abs(int(row["newton_iterations"]) - int(expected["newton_iterations"])) <= 1
            assert row["active_contacts"] == expected["active_contacts"]
        for key in keys:
            assert float(row[key]) == pytest.approx(float(expected[key]), rel=1e-10, abs=1e-14)
    steps = [json.loads((f / "summary.json").read_text())["steps"] for f in (one, other)]
    assert len(steps[0]) == len(steps[1]) == len(rows)
    fields, expected_fields = fields_of(one), fields_of(other)
    assert [level["time"] for level in fields] == pytest.approx(
        [level["time"] for level in expected_fields], rel=1e-10
    )
    solved = [row["step"] for row in rows if row["converged"] == "True"]
    for step, level, expected_level in zip(solved, fields, expected_fields, strict=True):
        assert level.keys() == expected_level.keys()
        assert level["level"] == expected_level["level"]
        assert level["prescribed"] == expected_level["prescribed"]
        for name in ("displacement", "stress", "Connectivity", "Points"):
            scale = expected_fields if step in at_rest else [expected_level]
            size = max(np.abs(one[name]).max() for one in scale)
            found, wanted = level[name], expected_level[name]
            if name == "displacement" and step in at_rest:
                found, wanted = in_cells(level), in_cells(expected_level)
            np.testing.assert_allclose(found, wanted, atol=1e-8 * size)


def in_cells(level: dict[str, np.ndarray]) -> np.ndarray:
    """Return displacements of cell nodes relative to the first node of each cell."""
    u = level["displacement"][level["Connectivity"].reshape(len(level["stress"]), -1)]
    return u - u[:, :1]


def fields_of(folder: Path) -> list[dict[str, np.ndarray]]:
    """Return the arrays of each level, which ``fields.vtkhdf.series`` locates as for ParaView."""
    levels = []
    for entry in json.loads((folder / "fields.vtkhdf.series").read_text())["files"]:
        level = {"time": np.float64(entry["time"])}
        with h5py.File(folder / entry["name"], "r") as file:
            grid = file["VTKHDF"]
            for group in (grid["PointData"], grid["CellData"], grid["FieldData"]):
                level |= {name: np.asarray(values) for name, values in group.items()}
            level |= {name: np.asarray(grid[name]) for name in ("Points", "Connectivity")}
        levels.append(level)
    return levels


@pytest.fixture
def run_until(
    monkeypatch: pytest.MonkeyPatch, comm: MPI.Intracomm
) -> Callable[[Path, Path, int], None]:
    """Run a case into a folder; the last rank gets a SIGTERM after a number of solved levels."""

    def run(case: Path, output: Path, levels: int) -> None:
        plain = recorder.Recorder.level

        def level(self: recorder.Recorder, level: Level, *more: object) -> None:
            if len(self.results.reports) == levels - 1 and comm.rank == comm.size - 1:
                signal.raise_signal(signal.SIGTERM)
            plain(self, level, *more)  # type: ignore[arg-type]

        with monkeypatch.context() as patch:
            patch.setattr(recorder.Recorder, "level", level)
            assert main(["run", str(case), "-o", str(output)]) == 128 + signal.SIGTERM

    return run


@pytest.mark.mpi3("newton")
@pytest.mark.parametrize("method", ["newton", *OTHERS])
def test_a_run_goes_on(
    method: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    caplog: pytest.LogCaptureFixture,
) -> None:
    if comm.size > 1 and method != "newton":
        pytest.skip("nothing else is parallel in it")
    more = "" if method in OTHERS else CONSTANT  # ζ = 0 is then a separate level
    case = write_case(
        comm, shared_tmp_path / "case.toml", solved_by(method, LOADINGS[method], more)
    )
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    run_until(case, parts, 2)
    assert f"perfplast run {case} --restart {parts}" in caplog.text
    assert len(path_of(parts)) == 2
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    same_path(parts, whole)
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED  # no level remains
    same_path(parts, whole)


@pytest.mark.long(but=["newton"])
@pytest.mark.parametrize("method", ["newton", "work-newton"])
def test_a_run_with_coulombs_friction_goes_on(
    method: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
) -> None:
    """Bounds of the first round follow from the state, with as many rounds and steps."""
    text = solved_by(method, LOADINGS[method]).replace(RUBS, f"{RUBS}coulomb = 0.2\n")
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    run_until(case, parts, 2)
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    same_path(parts, whole)
    rows, others = path_of(parts), path_of(whole)
    assert [row["rounds"] for row in rows] == [row["rounds"] for row in others]
    assert all(int(row["rounds"]) > 1 and int(row["slipping"]) > 0 for row in rows)


@pytest.mark.mpi2("")
@pytest.mark.long(but=[""])
@pytest.mark.parametrize("more", ["", CONSTANT])
def test_a_search_for_the_limit_load_goes_on(
    more: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
) -> None:
    case = write_case(comm, shared_tmp_path / "case.toml", solved_by("work-newton", LIMIT, more))
    whole = shared_tmp_path / "whole"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    levels = len(path_of(whole))
    assert levels >= 3
    expected = json.loads((whole / "summary.json").read_text())["limit"]
    for ended in (1, 2) if more else (2, levels):
        parts = shared_tmp_path / f"parts{ended}"
        run_until(case, parts, ended)
        assert len(path_of(parts)) == ended
        comm.barrier()
        assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
        same_path(parts, whole)
        limit = json.loads((parts / "summary.json").read_text())["limit"]
        assert limit["reason"] == expected["reason"]
        assert limit["linear_solves"] == expected["linear_solves"]
        for key in ("lower", "estimate", "upper", "alpha"):
            assert limit[key] == pytest.approx(expected[key], rel=1e-8)
        comm.barrier()


@pytest.mark.long
def test_a_cycle_goes_on(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    run_until: Callable[[Path, Path, int], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The run ends during unloading, with contact that opens and closes, and a constant load."""
    stages = [("press", 460.0, 2), ("release", 0.0, 2), ("again", 400.0, 1)]
    text = "".join(
        f'[[stage]]\nname = "{name}"\nfactors = {{ top = {top} }}\nsteps = {steps}\n'
        for name, top, steps in stages
    )
    named = CONSTANT.replace("100 + x", "1 + 0.1*x") + '\nname = "weight"\n'
    case = write_case(comm, shared_tmp_path / "case.toml", f"{CASE}{named}\n{text}")
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    run_until(case, parts, 4)
    comm.barrier()
    capfd.readouterr()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    if comm.rank == 0:
        said = capfd.readouterr().out
        assert all(f"Stage '{name}':" in said for name, *_ in stages)
        assert "Forces at zeta = 3, top = 400, in balance" in said
    same_path(parts, whole)
    rows = path_of(parts)
    names = ["", "press", "press", "release", "release", "again"]
    assert [row["stage"] for row in rows] == names
    assert [float(row["factor_top"]) for row in rows] == pytest.approx([0, 230, 460, 230, 0, 400])
    works = [float(row["work_top"]) for row in rows]
    assert works == pytest.approx([float(row["work_top"]) for row in path_of(whole)], rel=1e-10)
    last, expected = fields_of(parts)[-1], fields_of(whole)[-1]
    for name in ("accumulated_plastic_strain", "plastic_strain"):
        size = np.abs(expected[name]).max()
        assert size > 1e-6
        np.testing.assert_allclose(last[name], expected[name], atol=1e-10 * size)


@pytest.mark.long
def test_a_search_without_a_path_begins_anew(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = f"{CASE}\n[loading]\n" + LIMIT
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    whole, parts = shared_tmp_path / "whole", shared_tmp_path / "parts"
    assert main(["run", str(case), "-o", str(whole)]) == SOLVED
    plain = recorder.Recorder.interior

    def interior(self: recorder.Recorder, step: InteriorStep) -> None:
        if step.number == 3 and comm.rank == comm.size - 1:
            signal.raise_signal(signal.SIGTERM)
        plain(self, step)

    with monkeypatch.context() as patch:
        patch.setattr(recorder.Recorder, "interior", interior)
        assert main(["run", str(case), "-o", str(parts)]) == 128 + signal.SIGTERM
    assert "start again with: perfplast run" in (parts / "run.log").read_text(encoding="utf-8")
    known = json.loads((parts / "summary.json").read_text())["limit"]
    assert not known["levelled_off"]
    assert "the search was stopped after 3 steps" in known["reason"]
    comm.barrier()
    assert main(["run", str(case), "--restart", str(parts)]) == SOLVED
    limits = [json.loads((a / "summary.json").read_text())["limit"] for a in (whole, parts)]
    assert limits[1].keys() == limits[0].keys()
    assert limits[1]["lower"] == pytest.approx(limits[0]["lower"], rel=2e-3)  # tolerance
    assert limits[1]["iterations"] == pytest.approx(limits[0]["iterations"], abs=1)


# --- what is refused, and what is damaged ----------------------------------------------------


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a case, and the results of a run that ended after two of three levels."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("ended"))
    text = solved_by("newton", LOADINGS["newton"])
    case, results = write_case(comm, folder / "case.toml", text), folder / "results"
    with pytest.MonkeyPatch.context() as patch:
        plain = recorder.Recorder.level

        def level(self: recorder.Recorder, level: Level, *more: object) -> None:
            if len(self.results.reports) == 1:
                signal.raise_signal(signal.SIGINT)
            plain(self, level, *more)  # type: ignore[arg-type]

        patch.setattr(recorder.Recorder, "level", level)
        assert main(["run", str(case), "-o", str(results)]) == 128 + signal.SIGINT
    comm.barrier()
    return case, results


@pytest.fixture
def copied(
    ended: tuple[Path, Path], shared_tmp_path: Path, comm: MPI.Intracomm
) -> tuple[Path, Path]:
    """Return a copy that a test may change."""
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        shutil.copy(ended[0], case)
        shutil.copytree(ended[1], results)
    comm.barrier()
    return case, results


def refused(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], case: Path, folder: Path
) -> str:
    """Return the one line of a refusal, which leaves all files unchanged."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    comm.barrier()
    capsys.readouterr()
    assert main(["run", str(case), "--restart", str(folder)]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert comm.rank == 0 or err == ""
    err = comm.bcast(err)
    assert err.startswith("perfplast: ")
    assert err.count("\n") == 1
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    comm.barrier()
    return err


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        (
            f"yield_stress = {PUNCH_LIMIT}",
            "yield_stress = 400.0",
            "yield_stress = 400.0, but was",
        ),
        ("n = 2", "n = 4", "mesh.n = 4, but was 2"),
        ("[200.0, 350.0, 380.0]", "[200.0, 350.0]", "loading.values has 2 entries, but had 3"),
        (
            "[output]",
            "[element]\ndegree = 2\n[output]",
            "element.degree = 2, but the key was missing",
        ),
        ('on = "bottom"', 'on = "bottom"\ncomponents = "z"', 'support[3].components = "z"'),
        ('gap = "0.0004 * x**2"\n', "", "contact.gap is missing, but was"),
    ],
)
def test_another_case_is_refused(
    copied: tuple[Path, Path],
    old: str,
    new: str,
    part: str,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    case, folder = copied
    text = case.read_text()
    assert old in text
    comm.barrier()
    write_case(comm, case, text.replace(old, new))
    message = refused(comm, capsys, case, folder).replace("'", '"')
    assert part in message
    assert str(folder) in message


def test_a_case_that_only_looks_different(copied: tuple[Path, Path], comm: MPI.Intracomm) -> None:
    case, folder = copied
    text = case.read_text()
    comm.barrier()
    write_case(comm, case, "# a comment\n" + text.replace("[200.0, 350.0", "[2e2, 350"))
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED


TUBE = case_text(
    {"file": "tube.msh"},
    {"tube": VonMises(70e3, 0.3, 250.0)},
    [Support("x0", "x"), Support("y0", "y")],
    pushed="inner",
    more="""\
[element]
degree = 2
[loading]
values = [50.0, 60.0]
[output]
pictures = false
""",
)


def test_another_mesh_is_refused(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], shared_tmp_path: Path
) -> None:
    case, mesh = write_case(comm, shared_tmp_path / "case.toml", TUBE), shared_tmp_path / "tube.msh"
    folder = shared_tmp_path / "results"
    if comm.rank == 0:
        write_thick_tube(mesh, size=0.3, order=2)
    comm.barrier()
    assert main(["run", str(case), "-o", str(folder)]) == SOLVED
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    comm.barrier()
    if comm.rank == 0:
        write_thick_tube(mesh, outer=2.001, size=0.3, order=2)
    comm.barrier()
    message = refused(comm, capsys, case, folder)
    assert "of the mesh differ from" in message
    assert str(folder) in message


def test_a_checkpoint_of_another_version_is_refused(
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = solved_by("newton", "values = [200.0]")
    case, folder = (
        write_case(comm, shared_tmp_path / "case.toml", text),
        shared_tmp_path / "results",
    )
    monkeypatch.setattr(checkpoints, "SCHEMA", SCHEMA - 1)
    assert main(["run", str(case), "-o", str(folder)]) == SOLVED
    monkeypatch.undo()
    message = refused(comm, capsys, case, folder)
    assert f"has format {SCHEMA - 1}, but" in message
    assert f"reads format {SCHEMA};" in message
    assert "start again with -o" in message


def test_nothing_to_go_on_from(
    ended: tuple[Path, Path],
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    assert "has no checkpoint.h5" in refused(comm, capsys, ended[0], shared_tmp_path)
    assert "--restart" in refused_arguments(comm, capsys, str(ended[0]), "--force")
    assert "-o/--output" in refused_arguments(comm, capsys, str(ended[0]), "-o", "there")


def refused_arguments(
    comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str], *arguments: str
) -> str:
    assert main(["run", *arguments, "--restart", "here"]) == BAD_INPUT
    return comm.bcast(capsys.readouterr().err)


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size * 2 // 3)


def empty(path: Path) -> None:
    os.truncate(path, 0)


def remove(path: Path) -> None:
    path.unlink()


def flip_bit_of(name: str) -> Callable[[Path], None]:
    def flip(path: Path) -> None:
        with h5py.File(path, "r") as file:
            place = file[name].id.get_offset() + 41
        with path.open("r+b") as file:
            file.seek(place)
            byte = file.read(1)[0]
            file.seek(place)
            file.write(bytes([byte ^ 4]))

    return flip


DAMAGES = {
    "truncated": truncate,
    "empty": empty,
    "missing": remove,
    "displacement": flip_bit_of("displacement"),
    "header": flip_bit_of("header"),
}


@pytest.mark.mpi2("truncated")
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_checkpoint(
    damage: str,
    copied: tuple[Path, Path],
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    case, folder = copied
    if comm.rank == 0:
        DAMAGES[damage](folder / NEWEST)
    comm.barrier()
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    err = comm.bcast(capsys.readouterr().err)
    assert str(folder / NEWEST) in err
    assert "missing" in err if damage == "missing" else "is damaged" in err
    assert f"continuing from '{folder / BEFORE}', level 1" in err
    assert [float(row["zeta"]) for row in path_of(folder)] == [200.0, 350.0, 380.0]
    assert [level["time"] for level in fields_of(folder)] == [200.0, 350.0, 380.0]


def test_both_checkpoints_damaged(
    copied: tuple[Path, Path], comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    case, folder = copied
    if comm.rank == 0:
        truncate(folder / NEWEST)
        flip_bit_of("active")(folder / BEFORE)
    comm.barrier()
    message = refused(comm, capsys, case, folder)
    assert str(folder / NEWEST) in message
    assert str(folder / BEFORE) in message


class Crash(BaseException):
    """The end of the program; no handler catches it."""


@pytest.mark.mpi2("1")
@pytest.mark.long(but=["1", "10"])
@pytest.mark.parametrize("renames", [1, 3, 4, 6, 7, 9, 10, 11, 13])
def test_a_crash_while_writing(
    renames: int,
    ended: tuple[Path, Path],
    copied: tuple[Path, Path],
    comm: MPI.Intracomm,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The program ends when a file is about to get its final name, once for each kind of file."""
    if comm.size > 1:
        pytest.skip("the other ranks would wait")
    case, folder = copied
    plain, done = Path.replace, []

    def crash(path: Path, target: Path) -> Path:
        if len(done) == renames - 1:
            raise Crash
        done.append(path)
        return plain(path, target)

    monkeypatch.setattr(Path, "replace", crash)
    with pytest.raises(Crash):
        main(["run", str(case), "--restart", str(folder)])
    monkeypatch.undo()
    assert [level["time"] for level in fields_of(folder)][:2] == [200.0, 350.0]
    assert main(["run", str(case), "--restart", str(folder)]) == SOLVED
    assert [float(row["zeta"]) for row in path_of(folder)] == [200.0, 350.0, 380.0]
    assert [level["time"] for level in fields_of(folder)] == [200.0, 350.0, 380.0]


CHANGING = case_text(
    {"builder": "two_blocks", "n": 1},
    {"lower": VonMises(2e5, 0.3, 200.0), "upper": Elastic(2e5, 0.3)},
    [Support("left")],
    more='[[tie]]\nprimary = "upper_bottom"\nsecondary = "lower_top"\n'
    "[output]\npictures = false\n[loading]\nvalues = [1.0]\n",
).replace("yield_stress = 200.0", 'yield_stress = { file = "strength.csv", column = "k" }')


def test_a_file_of_strengths_that_has_changed(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strengths, results = shared_tmp_path / "strength.csv", shared_tmp_path / "r"
    corners = [f"{x},{y},{z}" for x in (-9, 9) for y in (-9, 9) for z in (-9, 9)]
    text = "x,y,z,k\n" + "\n".join(f"{corner},200" for corner in corners)
    if comm.rank == 0:
        strengths.write_text(text, encoding="utf-8")
    case = write_case(comm, shared_tmp_path / "case.toml", CHANGING)
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    assert main(["run", str(case), "--restart", str(results)]) == SOLVED
    if comm.rank == 0:
        strengths.write_text(text.replace("200", "201", 1), encoding="utf-8")
    comm.barrier()
    capsys.readouterr()
    assert main(["run", str(case), "--restart", str(results)]) == BAD_INPUT
    said = comm.bcast(capsys.readouterr().err)
    assert "the content of 'strength.csv' differs" in said
