"""Test the process that draws a result folder, and its faults."""

import shutil
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Sphere
from perfplast_fenicsx.environment import environment_apart
from perfplast_fenicsx.io.case.scene import Scene, write_scene
from perfplast_fenicsx.io.results.field_series import FieldSeries
from perfplast_fenicsx.io.results.result_folder import ResultFolder, Results
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.pictures import drawing_process
from perfplast_fenicsx.pictures.drawing_process import draw
from perfplast_fenicsx.problem.declared.loads import Pressure, Traction
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.problem import Problem
from tests.functional.test_command_line import CASE, one_line, write
from tests.io.results.test_result_folder import report
from tests.pictures.skins import fields_of, put_before, square
from tests.pictures.test_annotations import NEARBY

PNG = b"\x89PNG\r\n\x1a\n"

needs_xvfb = pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb to draw with")


def results(
    comm: MPI.Intracomm, path: Path, where: str, limit: bool = False, turned: bool = False
) -> ResultFolder:
    """Return a folder with two levels of artificial fields, in 2D or 3D."""
    plane = where == "plane"
    tagged_mesh = square(comm) if plane else build(comm, "two_blocks", n=1)
    contacts = [] if plane else [Contact("upper_bottom", "lower_top")]
    loads = [Traction("top", (0.0, 0.0, -1.0)), Pressure("left", -1.0)]
    if plane:
        loads = [Traction("side", (1.0, 1.0)), Pressure("bottom", 1.0)]
    far = Sphere(NEARBY[where][0].on, [1e3] * (2 if plane else 3), 1.0)  # not visible
    scene = Scene("$Two „blocks“", loads, contacts, [*NEARBY[where], far], axisymmetric=turned)
    materials = dict.fromkeys(tagged_mesh.volumes, Elastic(1.0, 0.3))
    supports = [Support("bottom" if plane else "left")]
    problem = Problem(tagged_mesh, materials, supports, loads)
    folder = ResultFolder(comm, path)
    folder.create()
    folder.on_root(lambda: write_scene(scene, tagged_mesh, folder.file("scene.json")))
    written = Results(folder, problem, scene.title, "1", "newton", Prescribed.LOAD_FACTOR)
    series = FieldSeries(folder, problem, Prescribed.LOAD_FACTOR)
    fields = fields_of(tagged_mesh)
    for number, zeta in enumerate((1.0, 2.0), start=1):
        level = report(zeta, plastic_cells=0)
        series.write(number, fields, level)
        written.add(level)
    if limit:
        work = fields["yield_ratio"].copy()
        flow = {"mechanism": fields["displacement"], "dissipation": work}
        series.write_mechanism(flow, 2.0, 1.0)
        written.summary.limit = {"lower": 2.0, "estimate": 2.1, "upper": None}
        written.write()
    return folder


@pytest.mark.mpi2("plane-False")
@pytest.mark.long(but=["space-True"])
@needs_xvfb
@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("where", NEARBY)
def test_draw(comm: MPI.Intracomm, shared_tmp_path: Path, where: str, limit: bool) -> None:
    folder = results(comm, shared_tmp_path / "results", where, limit)
    assert draw(folder)
    names = ["fields.png", *(["mechanism.png"] if limit else []), "path.png"]
    assert sorted(path.name for path in folder.path.glob("*.png")) == names
    assert all(folder.file(name).read_bytes().startswith(PNG) for name in names)


@needs_xvfb
@pytest.mark.serial
def test_loads_that_bodies_hide_are_seen(tmp_path: Path) -> None:
    """The loaded end is not visible from the front: arrows darken the bodies in front of them."""
    image = pytest.importorskip("matplotlib.image")
    folder = results(MPI.COMM_SELF, tmp_path / "results", "space")
    tagged_mesh, pictures = build(MPI.COMM_SELF, "two_blocks", n=1), []
    for loads in ([], [Traction("left", (0.0, 1.0, 0.0))]):
        write_scene(Scene("hidden", loads), tagged_mesh, folder.file("scene.json"))
        assert draw(folder)
        pictures.append(image.imread(folder.file("fields.png"))[..., :3].min(axis=2))
    bare, loaded = pictures
    darker = (bare < 0.99) & (loaded < bare - 0.05)
    assert darker.sum() > 200


@pytest.mark.long
@needs_xvfb
def test_half_a_section_is_drawn_with_its_axis(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    drawn = []
    for turned in (False, True):
        folder = results(comm, shared_tmp_path / str(turned), "plane", turned=turned)
        assert draw(folder)
        drawn.append(folder.file("fields.png").read_bytes())
    assert drawn[0] != drawn[1]


def test_the_drawing_process_starts_no_mpi(comm: MPI.Intracomm) -> None:
    if comm.rank > 0:
        return
    pytest.importorskip("pyvista")
    modules = ("__main__", "animation", "field_figure", "loading_curve", "renderer")
    imports = ", ".join(f"perfplast_fenicsx.pictures.{name}" for name in modules)
    program = f"import sys, {imports}; print(*sys.modules)"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment_apart(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = {name.split(".")[0] for name in done.stdout.split()}
    assert "perfplast_fenicsx" in found
    assert not found & {"mpi4py", "petsc4py", "dolfinx", "ufl", "basix"}


def test_a_run_without_fields_draws_its_curve_and_says_so(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    text = CASE.replace("pictures = false", "fields = false")
    case, folder = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    assert capsys.readouterr().err == ""
    assert [path.name for path in folder.glob("*.png")] == ["path.png"]
    assert not (folder / "fields").exists()
    assert "only path.png is drawn" in (folder / "run.log").read_text(encoding="utf-8")


def warnings(comm: MPI.Intracomm, caplog: pytest.LogCaptureFixture) -> str:
    """Return the one warning, which only rank 0 has logged."""
    messages = [record.getMessage() for record in caplog.records]
    assert len(messages) == (1 if comm.rank == 0 else 0)
    return str(comm.bcast(messages[0] if messages else ""))


def test_without_graphics_there_is_a_warning(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    pytest.importorskip("pyvista")
    folder = results(comm, shared_tmp_path / "results", "space")
    monkeypatch.setenv("PATH", str(shared_tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    # from version 9.4 on VTK tries other backends, unless one is selected
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkXOpenGLRenderWindow")
    assert not draw(folder)
    assert "install Xvfb" in warnings(comm, caplog)
    assert folder.file("path.png").exists()
    assert not folder.file("fields.png").exists()


def test_a_picture_that_fails_stops_nothing(
    comm: MPI.Intracomm, shared_tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "none")
    assert not draw(folder)
    assert "does not exist" in warnings(comm, caplog)


@pytest.mark.parametrize(
    ("package", "text", "part"),
    [
        ("pyvista", "import os; os.abort()", "not all pictures were drawn: "),
        ("pyvista", "import nothing_of_the_kind", "nothing_of_the_kind is not installed"),
        (
            "pyvista",
            "raise ModuleNotFoundError(name='pyvista')",
            "pyvista is not installed",
        ),
        ("pyvista", "raise RuntimeError('no canvas')", "RuntimeError: no canvas"),
        ("matplotlib", "raise ModuleNotFoundError(name='matplotlib')", "python3-matplotlib"),
    ],
)
def test_faults_are_one_sentence(
    package: str,
    text: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = results(comm, shared_tmp_path / "results", "plane")
    put_before(package, text, shared_tmp_path / "packages", monkeypatch)
    comm.barrier()
    assert main(["plot", str(folder.path)]) == BAD_INPUT
    out = comm.bcast(capsys.readouterr())
    assert out.err.count("\n") == 1
    assert part in out.err
    drawn = [] if package == "matplotlib" else ["path.png"]
    assert out.out.splitlines() == [str(folder.file(name)) for name in drawn]
    assert [path.name for path in folder.path.glob("*.png")] == drawn


def test_patience_ends(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = results(comm, shared_tmp_path / "results", "plane")
    put_before("pyvista", "import time; time.sleep(600)", shared_tmp_path / "p", monkeypatch)
    monkeypatch.setitem(drawing_process.PATIENCE, "animate", 0.5)
    assert main(["animate", str(folder.path)]) == BAD_INPUT
    assert "was ended after 0.5 s" in one_line(comm, capsys)
