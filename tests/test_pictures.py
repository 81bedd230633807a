"""The skin that is gathered for pictures, and the pictures themselves."""

import shutil
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import create_unit_square, meshtags
from test_output import report

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.builders import build
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.loads import Pressure, Traction
from perfplast_fenicsx.plotting import deformation_scale, draw_fields, draw_path
from perfplast_fenicsx.surface import Surface, gather_surface

PNG = b"\x89PNG\r\n\x1a\n"


def fields_of(assembly: Assembly, scale: float = 0.01) -> dict[str, fem.Function]:
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


def skin(assembly: Assembly, marks: dict[str, list[str]]) -> Surface | None:
    fields = fields_of(assembly)
    nodal = {name: fields[name] for name in ("displacement", "contact_pressure")}
    return gather_surface(assembly, nodal, {"yield_ratio": fields["yield_ratio"]}, marks)


def test_the_skin_is_whole_and_outward(comm: MPI.Intracomm) -> None:
    surface = skin(build(comm, "two_blocks", n=2), {"top": ["top"], "both": ["top", "left"]})
    assert (surface is None) == (comm.rank > 0)
    if surface is None:
        return
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a) / 2
    for index, name in enumerate(surface.names):
        own = surface.body == index
        height = {"lower": 0.0, "upper": 1.0}[name]
        assert own.sum() == 2 * 4 * 14
        assert np.isclose(np.linalg.norm(areas[own], axis=1).sum(), 14.0)
        volume = np.einsum("ij,ij->", areas[own], a[own]) / 3
        assert np.isclose(volume, 3.0)  # positive: the triangles are outward
        assert surface.points[surface.triangles[own]][..., 2].min() == height
    assert np.allclose(areas[surface.marks["top"]].sum(axis=0), [0, 0, 1.5])
    assert surface.marks["both"].sum() == 2 * 4 * (1.5 + 2)
    expected = 0.01 * surface.points * [1, 2, 3]
    assert np.allclose(surface.at_points["displacement"], expected, atol=1e-15)
    assert np.allclose(surface.at_points["contact_pressure"], surface.points[:, 1], atol=1e-15)
    middle = surface.points[surface.triangles].mean(axis=1)[:, 0]
    assert np.abs(surface.at_cells["yield_ratio"] - np.minimum(middle, 1)).max() < 0.5


def square(comm: MPI.Intracomm) -> Assembly:
    """A plane body."""
    mesh = create_unit_square(comm, 3, 3)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    tags = meshtags(mesh, 2, cells, np.full_like(cells, 7))
    mesh.topology.create_entities(1)
    none = np.zeros(0, dtype=np.int32)
    return Assembly(mesh, tags, meshtags(mesh, 1, none, none), {"plate": 7}, {"side": 1})


def test_the_skin_of_a_plane_mesh(comm: MPI.Intracomm) -> None:
    surface = skin(square(comm), {"side": ["side"]})
    if surface is not None:
        assert surface.triangles.shape == (18, 3)
        assert not surface.marks["side"].any()
        assert surface.at_points["displacement"].shape == surface.points.shape
        assert np.all(surface.body == 0)


@pytest.mark.parametrize(
    ("largest", "scale"),
    [(0.1, 1.0), (0.099, 1.0), (0.05, 2.0), (3e-5, 2000.0), (40.0, 0.002), (0, 1)],
)
def test_deformation_scale(largest: float, scale: float) -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0, 0]])
    moved = {"displacement": np.array([[0.0, 0, 0], [0, largest, 0], [0, 0, 0]])}
    none = np.zeros(1, dtype=np.int64)
    surface = Surface(points, np.array([[0, 1, 2]]), none, ["a"], moved, {}, {})
    assert deformation_scale(surface) == pytest.approx(scale, rel=1e-12)


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb to draw with")
@pytest.mark.parametrize("plane", [False, True])
def test_fields_png(comm: MPI.Intracomm, shared_tmp_path: Path, plane: bool) -> None:
    assembly = square(comm) if plane else build(comm, "two_blocks", n=1)
    contacts = [] if plane else [Contact("upper_bottom", "lower_top")]
    loads = [] if plane else [Traction("top", (0.0, 0.0, -1.0)), Pressure("left", -1.0)]
    path = shared_tmp_path / "fields.png"
    fields = fields_of(assembly)
    assert draw_fields(assembly, fields, report(1.0), "Two „blocks“", loads, contacts, path)
    assert path.read_bytes().startswith(PNG)


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
