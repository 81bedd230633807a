"""Test the reader of complete and incomplete result folders, and their pictures."""

import shutil
from collections import ChainMap
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.io.results.result_folder import ResultFolder, _row
from perfplast_fenicsx.io.results.result_writer import ResultWriter
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.result_reader import ResultReader, _report
from perfplast_fenicsx.problem.declared.loads import Traction
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.newton import Newton
from tests.functional.test_command_line import CASE, one_line, write
from tests.io.results.test_result_folder import report
from tests.models import STEEL

needs_xvfb = pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb to draw with")


Place = tuple[tuple[float, ...], ...]
"""Points in ascending order, independent of ranks, from memory or a file."""


def place(points: np.ndarray) -> Place:
    return tuple(sorted(tuple(point) for point in np.round(points, 9).tolist()))


def values_of(
    tagged_mesh: TaggedMesh, fields: dict[str, fem.Function]
) -> tuple[dict[tuple[str, Place], np.ndarray], dict[tuple[str, Place], float], set[Place]]:
    """Return u and p at points, yield ratios below triangles, and loaded facets, by body."""
    mesh, x = tagged_mesh.mesh, tagged_mesh.mesh.geometry.x
    vertices, gdim = mesh.topology.dim + 1, mesh.geometry.dim
    u, p, ratio = (fields[name] for name in ("displacement", "contact_pressure", "yield_ratio"))
    moved = np.zeros((len(u.x.array) // gdim, 3))
    moved[:, :gdim] = u.x.array.reshape(-1, gdim)
    at_points, at_cells = {}, {}
    for body in tagged_mesh.volumes:
        for cell in tagged_mesh.cells(body):
            nodes = geometry_dofmap(mesh)[cell, :vertices]
            dofs = [f.function_space.dofmap.list[cell, :vertices] for f in (u, p)]
            for node, of_u, of_p in zip(nodes, *dofs, strict=True):
                at_points[body, place(x[[node]])] = np.append(moved[of_u], p.x.array[of_p])
            for triangle in combinations(nodes, 3):
                at_cells[body, place(x[list(triangle)])] = float(ratio.x.array[cell])
    loaded = tagged_mesh.facets("top" if "top" in tagged_mesh.surfaces else "loaded")
    facets = entity_nodes(mesh, vertices - 2, loaded)[:, : vertices - 1]
    everything = mesh.comm.allgather((at_points, at_cells, {place(x[facet]) for facet in facets}))
    points, cells, loads = zip(*everything, strict=True)
    return dict(ChainMap(*points)), dict(ChainMap(*cells)), set().union(*loads)


def check_skin(surface: Surface, tagged_mesh: TaggedMesh, fields: dict[str, fem.Function]) -> None:
    """Check that the skin has the values of the fields, and is closed and outward."""
    at_points, at_cells, loaded = values_of(tagged_mesh, fields)
    u, p = (surface.at_points[name] for name in ("displacement", "contact_pressure"))
    for triangle, body, ratio in zip(
        surface.triangles, surface.body, surface.at_cells["yield_ratio"], strict=True
    ):
        name = surface.names[body]
        assert np.isclose(ratio, at_cells[name, place(surface.points[triangle])], rtol=1e-9)
        for node in triangle:
            expected = at_points[name, place(surface.points[[node]])]
            assert np.allclose(np.append(u[node], p[node]), expected, rtol=1e-9, atol=1e-12)
    marked = surface.facets[surface.marks["load 0"]]
    assert {place(surface.points[facet]) for facet in marked} == loaded
    assert len(marked) == len(loaded)
    of_facets = surface.body if not surface.plane else np.zeros(len(surface.edges), dtype=np.int64)
    for body in np.unique(of_facets):
        own = of_facets == body
        assert np.allclose(surface.normals[own].sum(axis=0), 0, atol=1e-12)
        middles = surface.points[surface.facets[own]].mean(axis=1)
        assert np.einsum("ij,ij->", surface.normals[own], middles) > 0


@pytest.mark.mpi2("two_blocks-1")
@pytest.mark.parametrize(
    ("where", "degree"), [("two_blocks", 1), ("two_blocks", 2), ("curved", 2), ("plane", 2)]
)
def test_the_skin_is_that_of_the_run(
    comm: MPI.Intracomm, shared_tmp_path: Path, where: str, degree: int
) -> None:
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    if where == "two_blocks":
        tagged_mesh = build(comm, where, n=2)
        contacts, load = [Contact("upper_bottom", "lower_top")], Traction("top", (0.0, 0.0, -60.0))
        supports = [Support("left")]
    else:
        pytest.importorskip("gmsh")
        tagged_mesh, contacts, load, supports = tube(comm, shared_tmp_path, where == "curved")
    scene = Scene(where, [load], contacts)
    problem = Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, STEEL),
        supports,
        [load],
        contacts,
        (),
        degree,
    )
    writer = ResultWriter(folder, problem, scene, "newton", prescribed=Prescribed.LOAD_FACTOR)
    recovery, newton = OutputFields(problem), Newton(problem)
    for zeta in (0.5, 1.0):
        level = newton.solve(zeta)
        assert level.report.converged
        writer.write(level)
        reader = ResultReader(folder.path)
        if comm.rank == 0:  # times differ between ranks
            written = [replace(report, reactions={}) for report in writer.results.reports]
            assert reader.reports == written
        assert reader.scene.marks == scene.marks
        assert reader.limit is None
        last = reader.levels[-1]
        assert last.number == len(writer.results.reports)
        found = reader.surface(last)
        assert (reader.gdim == 2) == (where == "plane") == found.plane
        assert found.names == sorted(
            tagged_mesh.volumes, key=lambda name: tagged_mesh.volumes[name]
        )
        check_skin(found, tagged_mesh, recovery.update(level))
        assert found.at_points["displacement"].any()
        assert found.at_points["contact_pressure"].any() == bool(contacts)
        comm.barrier()  # before the next level is written


def tube(
    comm: MPI.Intracomm, folder: Path, curved: bool
) -> tuple[TaggedMesh, list[Contact], Traction, list[Support]]:
    """Return a quarter of a cylinder with second-order geometry, or of a plane ring."""
    import gmsh

    path = folder / "tube.msh"
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        if curved:
            occ.addCylinder(0, 0, 0, 0, 0, 1, 1, angle=np.pi / 2)
        else:
            occ.cut([(2, occ.addDisk(0, 0, 0, 2, 2))], [(2, occ.addDisk(0, 0, 0, 1, 1))])
        occ.synchronize()
        dim = 3 if curved else 2
        gmsh.model.addPhysicalGroup(dim, [tag for _, tag in gmsh.model.getEntities(dim)], name="it")
        boundary = gmsh.model.getEntities(dim - 1)
        first, second = boundary[0][1], boundary[1][1]
        gmsh.model.addPhysicalGroup(dim - 1, [first], name="held")
        gmsh.model.addPhysicalGroup(dim - 1, [second], name="loaded")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
        gmsh.model.mesh.generate(dim)
        if curved:
            gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
        gmsh.finalize()
    comm.barrier()
    load = Traction("loaded", (50.0, 20.0, 0.0)[: 3 if curved else 2])
    return read_gmsh(comm, path), [], load, [Support("held")]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two levels, which no test changes."""
    comm = MPI.COMM_WORLD
    base = comm.bcast(tmp_path_factory.mktemp("finished"))
    case, folder = write(comm, base, CASE), base / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    return folder


@pytest.fixture
def results(comm: MPI.Intracomm, shared_tmp_path: Path, finished: Path) -> Path:
    """Return a folder with two levels for one test only."""
    folder = shared_tmp_path / "results"
    if comm.rank == 0:
        shutil.copytree(finished, folder)
    comm.barrier()
    return folder


def test_reading_while_a_level_is_written(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    tagged_mesh = build(comm, "two_blocks", n=1)
    load = Traction("top", (0.0, 0.0, -1.0))
    problem = Problem(
        tagged_mesh, dict.fromkeys(tagged_mesh.volumes, STEEL), [Support("left")], [load]
    )
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    newton = Newton(problem)
    writer = ResultWriter(folder, problem, Scene(""), "newton", prescribed=newton.prescribes)

    def go_on(zeta: float) -> None:
        writer.write(newton.solve(zeta))

    go_on(1.0)
    reader = ResultReader(folder.path)
    with h5py.File(folder.file(reader.levels[0].file), locking=False) as data:
        displacement = data["VTKHDF/PointData/displacement"]
        before = displacement[:]
        comm.barrier()
        go_on(2.0)
        assert np.array_equal(displacement[:], before)
    comm.barrier()
    assert [level.report.zeta for level in reader.levels] == [1.0]
    first, second = (reader.surface(level) for level in ResultReader(folder.path).levels)
    u = "displacement"
    assert np.allclose(2 * first.at_points[u], second.at_points[u], rtol=1e-9, atol=1e-15)


@pytest.mark.long
def test_levels_of_prescribed_work(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """Levels have numbers for any control; the mechanism is identified by its file."""
    control = 'control = "work"\nuntil = "limit"\nlimit_tolerance = 1e-2\nlimit_method = "path"'
    text = CASE.replace("values = [50.0, 80.0]", control) + "[element]\ndegree = 2\n"
    case, folder = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    reader = ResultReader(folder)
    assert [level.number for level in reader.levels] == list(range(1, len(reader.reports) + 1))
    assert [level.report for level in reader.levels] == reader.reports
    for level in reader.levels:
        with h5py.File(folder / level.file, locking=False) as file:
            facts = {name: values[0] for name, values in file["VTKHDF/FieldData"].items()}
        assert facts["prescribed"] == b"alpha"
        assert facts["alpha"] == pytest.approx(level.report.alpha, rel=1e-14)
        assert facts["zeta"] == pytest.approx(level.report.zeta, rel=1e-14)
    last = reader.surface(reader.levels[-1])
    found = reader.mechanism(last)
    assert found is not None
    moving, largest = found
    assert 0 <= moving.at_cells["dissipation"].max() <= largest
    velocity = moving.at_points["displacement"]
    assert velocity.shape == moving.points.shape
    assert velocity[:, 2].min() < 0  # the load presses down
    assert np.array_equal(moving.at_points["contact_pressure"], last.at_points["contact_pressure"])


def test_a_mechanism_without_a_level(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """The mechanism has a separate stress, and the stress of the split mesh."""
    text = CASE.replace("values = [50.0, 80.0]", 'control = "bounds"\nlimit_tolerance = 1e-2')
    case, folder = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    reader = ResultReader(folder)
    assert reader.reports == reader.levels == []
    assert reader.limit is not None
    assert reader.limit.body["upper"] == pytest.approx(100.0, rel=0.02)
    found = reader.mechanism(None)
    assert found is not None
    moving, largest = found
    assert 0 <= moving.at_cells["dissipation"].max() <= largest
    assert 0.99 < moving.at_cells["yield_ratio"].max() <= 1 + 1e-6
    assert moving.at_points["contact_pressure"].max() > 90
    assert moving.at_points["displacement"][:, 2].min() < 0  # the load presses down
    comm.barrier()
    assert main(["plot", str(folder)]) == SOLVED
    assert (folder / "mechanism.png").exists()
    assert not (folder / "path.png").exists()


@pytest.mark.parametrize(
    ("command", "spoil", "part"),
    [
        ("plot", shutil.rmtree, "does not exist"),
        ("animate", lambda path: (path / "scene.json").unlink(), "contains no scene.json"),
        ("plot", lambda path: (path / "scene.json").write_text("{}"), "'title' is missing"),
        ("plot", lambda path: (path / "path.csv").write_text("a,b\n1,2\n"), "cannot be read"),
        ("animate", lambda path: (path / "fields/mesh.vtkhdf").write_text("a"), "cannot be read"),
        ("plot", lambda path: (path / "fields/level_0001.vtkhdf").unlink(), "cannot be read"),
        ("plot", lambda path: (path / "fields.vtkhdf.series").write_text("[]"), "cannot be read"),
        ("plot", lambda path: (path / "fields.xdmf").touch(), "come from an earlier version"),
        (
            "animate",
            lambda path: (path / "model.json").touch(),
            "contains model.json, so its results",
        ),
        ("plot", lambda path: (path / "path.csv").write_text(""), "no level yet"),
        ("animate", lambda path: (path / "path.csv").write_text(""), "stored no fields"),
    ],
)
def test_bad_folders(
    command: str,
    spoil: object,
    part: str,
    results: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if comm.rank == 0:
        spoil(results)  # type: ignore[operator]
    comm.barrier()
    assert main([command, str(results)]) == BAD_INPUT
    assert part in one_line(comm, capsys)


@pytest.mark.parametrize(
    ("more", "part"),
    [
        (["-o", "/dev/null/a.gif"], "cannot be written"),
        (["-o", "a.avi"], "a.avi' is not supported"),
    ],
)
def test_bad_files_for_an_animation(
    more: list[str],
    part: str,
    results: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["animate", str(results), *more]) == BAD_INPUT
    assert part in one_line(comm, capsys)


def test_without_fields(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = CASE.replace("pictures = false", "pictures = false\nfields = false")
    case = write(comm, shared_tmp_path, text)
    folder = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    assert main(["plot", str(folder)]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    assert out.splitlines()[0] == str(folder / "path.png")
    assert "no fields" in out.splitlines()[1]
    assert sorted(path.name for path in folder.glob("*.png")) == ["path.png"]
    assert main(["animate", str(folder)]) == BAD_INPUT
    assert "fields = true" in one_line(comm, capsys)


@pytest.mark.long
@needs_xvfb
@pytest.mark.usefixtures("undrawn")
def test_plot_and_animate(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = pytest.importorskip("PIL.Image")
    text = CASE.replace('law = "elastic"', 'law = "von-mises"\nyield_stress = 60.0')
    text = text.replace("[50.0, 80.0]", "[50.0, 80.0, 90.0]")
    case, folder = write(comm, shared_tmp_path, text), shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--quiet"]) == SOLVED
    pictures = shared_tmp_path / "new" / "pictures"
    assert main(["plot", str(folder), "-o", str(pictures)]) == SOLVED
    assert main(["animate", str(folder)]) == SOLVED
    out = comm.bcast(capsys.readouterr().out)
    names = ["path.png", "fields.png", "mechanism.png"]
    assert out.splitlines() == [*(str(pictures / a) for a in names), str(folder / "loading.gif")]
    with image.open(folder / "loading.gif") as loading:
        assert loading.n_frames == 4  # the unloaded bodies first
        frames = []
        for number in range(4):
            loading.seek(number)
            frames.append(np.asarray(loading.convert("RGB")).astype(int))
    changes = [np.abs(a - b).max(axis=2) > 40 for a, b in pairwise(frames)]
    assert all(0.001 < change.mean() < 0.4 for change in changes)
    for name in names:
        with image.open(pictures / name) as picture:
            assert min(picture.size) > 500
            assert np.unique(np.asarray(picture.convert("L"))).size > 50


def test_columns_that_came_later_may_be_absent() -> None:
    """A folder from an earlier version is read with defaults; no other column may be missing."""
    row = {name: str(value) for name, value in _row(1, report(2.5), "xyz").items()}
    assert _report(row).contact_programs > 0
    for name in ("contact_programs", "snes_vi_programs", "snes_vi_iterations"):
        del row[name]
    assert _report(row).contact_programs == 0
    del row["alpha"]
    with pytest.raises(KeyError, match="alpha"):
        _report(row)
