"""The skin that is gathered for pictures, and the pictures themselves."""

import shutil
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import create_unit_square, locate_entities_boundary, meshtags

from perfplast_fenicsx.contact.contact import Contact
from perfplast_fenicsx.contact.obstacles import Cylinder, Obstacle, Plane, Sphere
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.output_fields import dissipation
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.pictures.annotations import load_arrows, sample_obstacles
from perfplast_fenicsx.pictures.boundary_surface import Surface, gather_surface
from perfplast_fenicsx.pictures.field_figure import deformation_scale
from perfplast_fenicsx.pictures.run_figures import draw_fields, draw_path
from perfplast_fenicsx.problem.loads import Pressure, Traction
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.supports import Support
from tests.io.results.test_result_folder import report
from tests.models import STEEL

PNG = b"\x89PNG\r\n\x1a\n"


def fields_of(assembly: TaggedMesh, scale: float = 0.01) -> dict[str, fem.Function]:
    """Made-up fields."""
    mesh = assembly.mesh
    gdim = mesh.geometry.dim
    u = fem.Function(fem.functionspace(mesh, ("P", 1, (gdim,))))
    u.interpolate(lambda x: scale * np.array([x[0], 2 * x[1], 3 * x[2]])[:gdim])
    ratio = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    ratio.interpolate(lambda x: np.minimum(x[0], 1.0))
    pressure = fem.Function(fem.functionspace(mesh, ("P", 1)))
    pressure.interpolate(lambda x: x[1])
    return {"displacement": u, "yield_ratio": ratio, "contact_pressure": pressure}


def skin(assembly: TaggedMesh, marks: dict[str, list[str]]) -> Surface | None:
    fields = fields_of(assembly)
    nodal = {name: fields[name] for name in ("displacement", "contact_pressure")}
    return gather_surface(assembly, nodal, {"yield_ratio": fields["yield_ratio"]}, marks)


def test_the_skin_is_whole_and_outward(comm: MPI.Intracomm) -> None:
    surface = skin(build(comm, "two_blocks", n=2), {"top": ["top"], "both": ["top", "left"]})
    assert (surface is None) == (comm.rank > 0)
    if surface is None:
        return
    assert not surface.plane
    assert surface.facets is surface.triangles
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a) / 2
    for index, name in enumerate(surface.names):
        own = surface.body == index
        height = {"lower": 0.0, "upper": 1.0}[name]
        assert own.sum() == 2 * 4 * 14
        assert np.isclose(np.linalg.norm(areas[own], axis=1).sum(), 14.0)
        volume = np.einsum("ij,ij->", areas[own], a[own]) / 3
        assert np.isclose(volume, 3.0)  # positive: the triangles are outward
        assert surface.points[surface.triangles[own]][..., 2].min() == pytest.approx(height)
    assert np.allclose(surface.normals, areas)
    assert np.allclose(surface.areas, np.linalg.norm(areas, axis=1))
    assert np.allclose(areas[surface.marks["top"]].sum(axis=0), [0, 0, 1.5])
    assert surface.marks["both"].sum() == 2 * 4 * (1.5 + 2)
    expected = 0.01 * surface.points * [1, 2, 3]
    assert np.allclose(surface.at_points["displacement"], expected, atol=1e-15)
    assert np.allclose(surface.at_points["contact_pressure"], surface.points[:, 1], atol=1e-15)
    middle = surface.points[surface.triangles].mean(axis=1)[:, 0]
    assert np.abs(surface.at_cells["yield_ratio"] - np.minimum(middle, 1)).max() < 0.5


def square(comm: MPI.Intracomm) -> TaggedMesh:
    """A plane body."""
    mesh = create_unit_square(comm, 3, 3)
    index_map = mesh.topology.index_map(2)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    tags = meshtags(mesh, 2, cells, np.full_like(cells, 7))
    mesh.topology.create_entities(1)
    bottom = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0))
    side = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], 1))
    facets = np.concatenate([bottom, side])
    values = np.repeat(np.array([1, 2], dtype=np.int32), [len(bottom), len(side)])
    order = np.argsort(facets)
    facet_tags = meshtags(mesh, 1, facets[order], values[order])
    return TaggedMesh(mesh, tags, facet_tags, {"plate": 7}, {"bottom": 1, "side": 2})


def test_the_skin_of_a_plane_mesh(comm: MPI.Intracomm) -> None:
    surface = skin(square(comm), {"side": ["side"], "both": ["bottom", "side"], "none": []})
    if surface is None:
        return
    assert surface.triangles.shape == (18, 3)
    assert np.isclose(surface.areas.sum(), 1.0)
    assert surface.at_points["displacement"].shape == surface.points.shape
    assert np.all(surface.body == 0)

    assert surface.plane
    assert surface.facets is surface.edges
    middle = surface.points[surface.edges].mean(axis=1)
    found = sorted((round(6 * x), round(6 * y)) for x, y, _ in middle)
    along = (1, 3, 5)
    expected = [(i, y) for i in along for y in (0, 6)] + [(x, i) for i in along for x in (0, 6)]
    assert found == sorted(expected)  # each once
    outward = np.where(np.isclose(middle, 1), 1, 0) - np.where(np.isclose(middle, 0), 1, 0)
    outward[:, 2] = 0
    assert np.allclose(surface.normals, outward / 3)
    right, bottom = np.isclose(middle[:, 0], 1), np.isclose(middle[:, 1], 0)
    assert np.array_equal(surface.marks["side"], right)
    assert np.array_equal(surface.marks["both"], right | bottom)
    assert not surface.marks["none"].any()


@pytest.mark.parametrize("plane", [False, True])
def test_arrows_end_on_their_surface_or_pull_at_it(comm: MPI.Intracomm, plane: bool) -> None:
    on, axis, end = ("side", 0, 1.0) if plane else ("top", 2, 2.0)
    out = np.eye(3)[axis]
    inward = (-2.0 * out)[: 2 if plane else 3]
    along = np.roll(out, 1)[: 2 if plane else 3]
    loads = [Traction(on, inward), Pressure(on, -3.0), Pressure(on, 1.0), Traction(on, along)]
    assembly = square(comm) if plane else build(comm, "two_blocks", n=2)
    for load, points_along in zip(loads, (-1, 1, -1, 0), strict=True):
        surface = skin(assembly, {"load 0": [on]})
        if surface is None:
            continue
        arrows = load_arrows(surface, surface.points, [load])
        assert 5 < len(arrows.starts) < 40
        length = 0.1 * surface.size
        assert np.allclose(np.linalg.norm(arrows.vectors, axis=1), length)
        assert np.allclose(arrows.vectors[:, axis], points_along * length)
        pushes = points_along < 0
        touching = arrows.starts + arrows.vectors * pushes
        assert np.allclose(touching[:, axis], end)
        assert len(np.unique(np.round(touching, 9), axis=0)) == len(touching)


def test_no_arrows_of_a_load_that_is_zero(comm: MPI.Intracomm) -> None:
    surface = skin(square(comm), {"load 0": ["side"], "load 1": []})
    if surface is not None:
        loads = [Traction("side", (0.0, 0.0)), Pressure("side", 1.0)]
        assert load_arrows(surface, surface.points, loads).starts.shape == (0, 3)


NEARBY: dict[str, list[Obstacle]] = {
    "plane": [Sphere("side", (0.5, 0.5), 0.75, hollow=True), Plane("side", (0.0, -0.02), (0, 2))],
    "space": [
        Cylinder("top", (0.0, 0.5, 3.0), (1, 0, 0), 1.0),
        Plane("top", (0, 0, 2.1), (0, 0, -1)),
    ],
}
"""Obstacles near the square, and near two blocks."""


@pytest.mark.parametrize("where", NEARBY)
def test_obstacles_are_sampled_around_the_bodies(comm: MPI.Intracomm, where: str) -> None:
    surface = skin(square(comm) if where == "plane" else build(comm, "two_blocks", n=1), {})
    if surface is None:
        return
    near = sample_obstacles(surface, surface.points, NEARBY[where])
    shape = near.distances[0].shape
    assert shape[2] == 1 or where == "space"
    far = near.corner + near.spacing * (np.array(shape) - 1)
    assert np.all(near.corner <= surface.points.min(axis=0))
    assert np.all(far >= surface.points.max(axis=0))
    for obstacle, distances in zip(NEARBY[where], near.distances, strict=True):
        assert distances.shape == shape
        assert distances.min() < 0 < distances.max()  # part of it is in the picture
        i, j, k = 3, 2, min(shape[2] - 1, 1)
        x = near.corner + near.spacing * [i, j, k]
        gdim = 2 if where == "plane" else 3
        assert np.isclose(distances[i, j, k], obstacle.towards(x[None, :gdim])[0][0])


@pytest.mark.parametrize("degree", [1, 2])
def test_dissipation(comm: MPI.Intracomm, degree: int) -> None:
    assembly = build(comm, "two_blocks", n=1)
    materials = {"lower": Elastic(200e3, 0.3), "upper": STEEL}
    supports, loads = [Support("left")], [Traction("top", (0.0, 0.0, -1.0))]
    problem = Problem(assembly, materials, supports, loads, degree=degree)
    v = fem.Function(problem.V)
    v.interpolate(lambda x: np.stack([3 * x[1], 0 * x[1], 0 * x[1]]))  # ‖dev ε‖ = 3/√2
    v.x.scatter_forward()
    work = dissipation(problem, v)
    assert work.function_space.element.space_dimension == 1
    for name, expected in (("lower", 0.0), ("upper", STEEL.yield_radius * 3 / np.sqrt(2))):
        cells = assembly.cells(name)
        assert np.allclose(work.x.array[cells], expected, rtol=1e-12, atol=0)
    v.x.array[:] = 0
    assert not dissipation(problem, v).x.array.any()


@pytest.mark.parametrize(
    ("largest", "scale"),
    [(0.1, 1.0), (0.099, 1.0), (0.05, 2.0), (3e-5, 2000.0), (40.0, 0.002), (0, 1)],
)
def test_deformation_scale(largest: float, scale: float) -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0, 0]])
    moved = {"displacement": np.array([[0.0, 0, 0], [0, largest, 0], [0, 0, 0]])}
    none = np.zeros(1, dtype=np.int64)
    no_edges = np.zeros((0, 2), dtype=np.int64)
    surface = Surface(points, np.array([[0, 1, 2]]), no_edges, none, ["a"], moved, {}, {})
    assert deformation_scale([surface]) == pytest.approx(scale, rel=1e-12)


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb to draw with")
@pytest.mark.parametrize("mechanism", [False, True])
@pytest.mark.parametrize("where", NEARBY)
def test_fields_png(
    comm: MPI.Intracomm, shared_tmp_path: Path, where: str, mechanism: bool
) -> None:
    plane = where == "plane"
    assembly = square(comm) if plane else build(comm, "two_blocks", n=1)
    contacts = [] if plane else [Contact("upper_bottom", "lower_top")]
    loads = [Traction("top", (0.0, 0.0, -1.0)), Pressure("left", -1.0)]
    if plane:
        loads = [Traction("side", (1.0, 1.0)), Pressure("bottom", 1.0)]
    far = Sphere(NEARBY[where][0].on, [1e3] * (2 if plane else 3), 1.0)  # nothing of it is seen
    path = shared_tmp_path / "fields.png"
    fields = fields_of(assembly)
    if mechanism:
        fields["dissipation"] = fields["yield_ratio"].copy()
    about = (report(1.0), "$Two „blocks“", loads, contacts, path)
    assert draw_fields(assembly, fields, *about, obstacles=[*NEARBY[where], far])
    assert path.read_bytes().startswith(PNG)


def test_a_picture_that_fails_stops_nothing(
    comm: MPI.Intracomm, shared_tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = shared_tmp_path / "no folder" / "fields.png"
    assembly = square(comm)
    assert not draw_fields(assembly, fields_of(assembly), report(1.0), "", [], [], path)
    assert len(caplog.records) == (1 if comm.rank == 0 else 0)


def test_obstacles_that_do_not_fit_are_refused(comm: MPI.Intracomm, tmp_path: Path) -> None:
    assembly, path = square(comm), tmp_path / "fields.png"
    obstacles: list[Obstacle] = [Plane("side", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))]
    with pytest.raises(InputError, match="does not fit a mesh in 2D"):
        about = (report(1.0), "", [], [], path)
        draw_fields(assembly, fields_of(assembly), *about, obstacles=obstacles)


def test_without_graphics_there_is_a_warning(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setenv("PATH", str(shared_tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("sys.executable", "/bin/false")
    assembly = build(comm, "l_plate", n=1)
    path = shared_tmp_path / "fields.png"
    assert not draw_fields(assembly, fields_of(assembly), report(1.0), "", [], [], path)
    assert not path.exists()
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == (1 if comm.rank == 0 else 0)
    assert all("install Xvfb" in warning for warning in warnings)


@pytest.mark.parametrize("zetas", [[], [1.0], [1.0, 2.0, 3.0]])
def test_path_png(tmp_path: Path, zetas: list[float]) -> None:
    reports = [report(zeta, plastic_cells=0) for zeta in zetas]
    draw_path([*reports, report(4.0, converged=False)], "A title", tmp_path / "path.png")
    assert (tmp_path / "path.png").read_bytes().startswith(PNG)
