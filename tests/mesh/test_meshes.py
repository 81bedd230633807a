"""Test assemblies: structured builders, gmsh files, and bodies split from one gmsh mesh."""

import runpy
from collections.abc import Callable, Iterable
from pathlib import Path

from mpi4py import MPI

import dolfinx
import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx.mesh import meshtags

from meshes.bolted_assembly import LENGTH, SHANK, THICKNESS, WIDTH, write_bolted_assembly
from meshes.pin_in_lug import write_pin_in_lug
from meshes.wedge import write_wedge
from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap, interpolation_points
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.gmsh_reader import gmsh_session
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.split_bodies import on_plane, write_split
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh
from perfplast_fenicsx.problem.assembled.spread_forces import area_of

# Area vectors ∫ n ds of the named surfaces, and volumes, for the builders with their arguments.
BUILT = [
    (
        ("two_blocks", {"n": 2}),
        {"lower": 3.0, "upper": 3.0},
        {
            "left": (-2, 0, 0),
            "top": (0, 0, 1.5),
            "upper_bottom": (0, 0, -3),
            "lower_top": (0, 0, 3),
        },
        (288, 126),
    ),
    (
        ("punch", {"n": 4}),
        {"base": 1.0, "punch": 0.125},
        {
            "x0": (-1.25, 0, 0),
            "y0": (0, -1.25, 0),
            "bottom": (0, 0, -1),
            "top": (0, 0, 0.25),
            "punch_bottom": (0, 0, -0.25),
            "base_top": (0, 0, 0.25),
        },
        (6 * (64 + 8), 125 + 27),
    ),
    (
        ("l_plate", {"n": 1}),
        {"plate": 75.0},
        {
            "x0": (-5, 0, 0),
            "y0": (0, -5, 0),
            "z0": (0, 0, -75),
            "z1": (0, 0, 75),
            "top": (0, 10, 0),
        },
        (75 * 6, 2 * (121 - 25)),
    ),
    (
        ("stacked_blocks", {"n": 3, "heights": (0.7, 1.1)}),
        {"lower": 0.7, "upper": 1.1},
        {
            "x0": (-1.8, 0, 0),
            "y0": (0, -1.8, 0),
            "bottom": (0, 0, -1),
            "top": (0, 0, 1),
            "upper_bottom": (0, 0, -1),
            "lower_top": (0, 0, 1),
        },
        (2 * 27 * 6, 2 * 64),
    ),
]


def volume(tagged_mesh: TaggedMesh, name: str) -> float:
    """Return the volume of a body, or the area of a plane body."""
    mesh = tagged_mesh.mesh
    dx = ufl.Measure("dx", mesh, subdomain_data=[(1, tagged_mesh.cells(name))])
    form = dolfinx.fem.form(dolfinx.fem.Constant(mesh, np.float64(1)) * dx(1))
    return mesh.comm.allreduce(dolfinx.fem.assemble_scalar(form))


def area_vector(tagged_mesh: TaggedMesh, name: str) -> npt.NDArray[np.float64]:
    """Return ∫ n ds over a surface, shape (gdim,)."""
    mesh = tagged_mesh.mesh
    tags = meshtags(mesh, mesh.topology.dim - 1, tagged_mesh.facets(name), 1)
    ds = ufl.Measure("ds", mesh, subdomain_data=tags)
    direction = dolfinx.fem.Constant(mesh, np.zeros(mesh.geometry.dim))
    form = dolfinx.fem.form(ufl.dot(ufl.FacetNormal(mesh), direction) * ds(1))

    def component(axis: npt.NDArray[np.float64]) -> float:
        direction.value[:] = axis
        return mesh.comm.allreduce(dolfinx.fem.assemble_scalar(form))

    return np.array([component(axis) for axis in np.eye(mesh.geometry.dim)])


def surface_nodes(tagged_mesh: TaggedMesh, name: str) -> dict[int, tuple[float, ...]]:
    """Return coordinates of surface nodes by input number, gathered on every rank."""
    mesh = tagged_mesh.mesh
    nodes = np.unique(entity_nodes(mesh, mesh.topology.dim - 1, tagged_mesh.facets(name)))
    numbers = mesh.geometry.input_global_indices[nodes]
    gathered = mesh.comm.allgather((numbers, mesh.geometry.x[nodes]))
    return {int(i): tuple(x) for part in gathered for i, x in zip(*part, strict=True)}


def in_order(points: Iterable[tuple[float, ...]]) -> npt.NDArray[np.float64]:
    """Return points in an order that does not depend on rounding, shape (num_points, 3)."""
    return np.array(sorted(points, key=lambda x: tuple(np.round(x, 9) + 0.0)))


def check_interface(tagged_mesh: TaggedMesh, one: str, other: str) -> None:
    """Check that two surfaces have the same points, with different nodes."""
    first, second = surface_nodes(tagged_mesh, one), surface_nodes(tagged_mesh, other)
    assert first.keys().isdisjoint(second)
    np.testing.assert_allclose(in_order(first.values()), in_order(second.values()), atol=1e-14)
    np.testing.assert_allclose(
        area_vector(tagged_mesh, one), -area_vector(tagged_mesh, other), atol=1e-12
    )


def message(call: Callable[[], object]) -> str:
    """Return the message of a call's InputError, after a check that it is equal on all ranks."""
    with pytest.raises(InputError) as caught:
        call()
    assert len(set(MPI.COMM_WORLD.allgather(str(caught.value)))) == 1
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(("built", "volumes", "areas", "sizes"), BUILT)
def test_builders(
    comm: MPI.Intracomm,
    built: tuple[str, dict],
    volumes: dict[str, float],
    areas: dict[str, tuple[float, ...]],
    sizes: tuple[int, int],
) -> None:
    name, arguments = built
    tagged_mesh = build(comm, name, **arguments)
    tagged_mesh.check_tagged()
    assert tagged_mesh.volumes.keys() == volumes.keys()
    assert tagged_mesh.surfaces.keys() == areas.keys()
    for body, value in volumes.items():
        assert volume(tagged_mesh, body) == pytest.approx(value, rel=1e-13)
    for surface, vector in areas.items():
        np.testing.assert_allclose(area_vector(tagged_mesh, surface), vector, atol=1e-12)
    cells = tagged_mesh.mesh.topology.index_map(3).size_global
    assert (cells, tagged_mesh.mesh.geometry.index_map().size_global) == sizes
    assert tagged_mesh.mesh.topology.index_map(0).size_global == sizes[1]


@pytest.mark.parametrize(
    ("name", "one", "other"),
    [
        ("two_blocks", "upper_bottom", "lower_top"),
        ("punch", "punch_bottom", "base_top"),
        ("stacked_blocks", "upper_bottom", "lower_top"),
    ],
)
def test_builder_interfaces(comm: MPI.Intracomm, name: str, one: str, other: str) -> None:
    arguments = {"heights": (0.7, 1.1)} if name == "stacked_blocks" else {}
    check_interface(build(comm, name, n=6, **arguments), one, other)


def cubes_by_hand(cubes: list[tuple[int, ...]]) -> list[tuple]:
    """Return the tetrahedra of unit cubes as sorted tuples of vertices, written independently."""
    corner = {
        1: (0, 0, 0),
        2: (1, 0, 0),
        3: (1, 1, 0),
        4: (0, 1, 0),
        5: (0, 0, 1),
        6: (1, 0, 1),
        7: (1, 1, 1),
        8: (0, 1, 1),
    }
    cuts = [(1, 2, 4, 6), (1, 4, 5, 6), (4, 5, 6, 8), (2, 3, 4, 6), (3, 6, 7, 4), (4, 6, 7, 8)]

    def vertex(cube: tuple[int, ...], number: int) -> tuple[int, ...]:
        return tuple(a + b for a, b in zip(cube, corner[number], strict=True))

    return sorted(
        tuple(sorted(vertex(cube, number) for number in cut)) for cube in cubes for cut in cuts
    )


@pytest.mark.parametrize("n", [1, 2])
def test_exact_tetrahedra(comm: MPI.Intracomm, n: int) -> None:
    tagged_mesh = build(comm, "two_blocks", n=n)
    local = n * tagged_mesh.mesh.geometry.x[geometry_dofmap(tagged_mesh.mesh)]
    np.testing.assert_allclose(local, np.rint(local), atol=1e-14 * n)
    cells = [tuple(sorted(map(tuple, cell.tolist()))) for cell in np.rint(local).astype(int)]
    found = sorted(cell for part in comm.allgather(cells) for cell in part)
    assert found == cubes_by_hand(list(np.ndindex(3 * n, n, 2 * n)))


def test_odd_two_blocks_load_whole_cubes(comm: MPI.Intracomm) -> None:
    tagged_mesh = build(comm, "two_blocks", n=1)
    np.testing.assert_allclose(area_vector(tagged_mesh, "top"), (0, 0, 1), atol=1e-13)


@pytest.mark.parametrize(
    ("name", "arguments", "expected"),
    [
        ("two_block", {"n": 2}, "'two_block'; did you mean"),
        ("sphere", {}, "known: two_blocks, punch, l_plate, stacked_blocks"),
        ("punch", {}, "builder 'punch' needs the argument 'n'"),
        (
            "stacked_blocks",
            {"n": 2, "height": 1.0},
            "has no argument 'height'; did you",
        ),
        ("punch", {"n": 3}, "builder 'punch' has n = 3; n must be even"),
        ("l_plate", {"n": 0}, "builder 'l_plate' has n = 0;"),
        ("two_blocks", {"n": 2.5}, "n = 2.5"),
        ("two_blocks", {"n": True}, "n = True"),
        ("two_blocks", {"n": "8"}, "n = '8'"),
        ("stacked_blocks", {"n": 2, "heights": (1.0, 0.0)}, "heights = (1.0, 0.0); give two"),
        ("stacked_blocks", {"n": 2, "heights": (1.0, float("nan"))}, "give two numbers"),
        ("stacked_blocks", {"n": 2, "heights": 2.0}, "heights = 2.0; give two numbers"),
        ("stacked_blocks", {"n": 2, "heights": ["a", "b"]}, "give two numbers"),
    ],
)
def test_bad_builder_input(comm: MPI.Intracomm, name: str, arguments: dict, expected: str) -> None:
    assert expected in message(lambda: build(comm, name, **arguments))


def test_unknown_names(comm: MPI.Intracomm) -> None:
    tagged_mesh = build(comm, "two_blocks", n=1)
    no_surface = message(lambda: tagged_mesh.facets("topp"))
    assert no_surface.startswith("'topp' is not a surface")
    assert no_surface.endswith(" left, lower_top, top, upper_bottom.")
    no_volume = message(lambda: tagged_mesh.cells("middle"))
    assert no_volume.startswith("'middle' is not a volume")
    assert no_volume.endswith(" lower, upper.")


def test_untagged_cells(comm: MPI.Intracomm) -> None:
    whole = build(comm, "stacked_blocks", n=1)
    lower = TaggedMesh(whole.mesh, whole.cell_tags, whole.facet_tags, {"lower": 1}, whole.surfaces)
    refused = message(lower.check_tagged)
    assert refused.startswith("6 cells ")
    assert "without a volume: 2)" in refused


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("order", [1, 2])
def test_wedge(comm: MPI.Intracomm, shared_tmp_path: Path, order: int) -> None:
    path = shared_tmp_path / "wedge.msh"
    if comm.rank == 0:
        write_wedge(path, size=0.5, order=order)
    tagged_mesh = read_gmsh(comm, path)
    assert volume(tagged_mesh, "lower") == pytest.approx(2.0)
    assert volume(tagged_mesh, "upper") == pytest.approx(2.0)
    areas = {
        "x0": (-2, 0, 0),
        "x1": (2, 0, 0),
        "y0": (0, -4, 0),
        "y1": (0, 4, 0),
        "bottom": (0, 0, -2),
        "top": (0, 0, 2),
        "lower_seam": (-0.5, 0, 2),
        "upper_seam": (0.5, 0, -2),
    }
    assert tagged_mesh.surfaces.keys() == areas.keys()
    for name, vector in areas.items():
        np.testing.assert_allclose(area_vector(tagged_mesh, name), vector, atol=1e-12)
    check_interface(tagged_mesh, "lower_seam", "upper_seam")
    assert geometry_dofmap(tagged_mesh.mesh).shape[1] == {1: 4, 2: 10}[order]


def test_pin_in_lug_keeps_its_curve(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = shared_tmp_path / "pin.msh"
    if comm.rank == 0:
        write_pin_in_lug(path, size=0.6, order=2)
    tagged_mesh = read_gmsh(comm, path)
    assert volume(tagged_mesh, "pin") == pytest.approx(np.pi / 2, rel=2e-3)
    assert volume(tagged_mesh, "lug") == pytest.approx(8 + np.pi - np.pi / 2, rel=2e-3)
    np.testing.assert_allclose(area_vector(tagged_mesh, "pin_bore"), (2, 0, 0), atol=1e-12)
    np.testing.assert_allclose(area_vector(tagged_mesh, "end"), (0, -2, 0), atol=1e-12)
    check_interface(tagged_mesh, "lug_bore", "pin_bore")


@pytest.mark.long(but=["False-None", "True-None"])
@pytest.mark.parametrize(("glued", "apart"), [(False, None), (True, None), (False, 1.2)])
def test_bolted_assembly(
    comm: MPI.Intracomm, shared_tmp_path: Path, glued: bool, apart: float | None
) -> None:
    path = shared_tmp_path / "bolted.msh"
    if comm.rank == 0:
        write_bolted_assembly(path, size=40.0, glued=glued, apart=apart)
    assembly = read_gmsh(comm, path)
    assert len(assembly.volumes) == 10
    whole, holes = LENGTH * WIDTH * THICKNESS, 6 * np.pi * SHANK**2 * THICKNESS
    assert volume(assembly, "plate") == pytest.approx(whole - holes, rel=holes / whole / 10)
    for name in ("ends", "grip"):
        assert comm.allreduce(len(assembly.facets(name))) > 0
        np.testing.assert_allclose(area_vector(assembly, name), 0, atol=1e-9)
    assert path.with_suffix(".step").stat().st_size > 0
    joints = [name for name in assembly.surfaces if "joint" in name]
    assert len(joints) == (16 if glued else 32)
    if not glued and not apart:
        for number in range(1, 17):
            one, other = (name for name in joints if name.endswith(f"_joint_{number}"))
            check_interface(assembly, one, other)


def test_generators_are_scripts(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = shared_tmp_path / "script.msh"
    if comm.rank == 0:
        monkeypatch.setattr("sys.argv", ["wedge.py", "-o", str(path), "--size", "1"])
        script = Path(__file__).parents[2] / "meshes" / "wedge.py"
        runpy.run_path(str(script), run_name="__main__")
    assert read_gmsh(comm, path).volumes.keys() == {"lower", "upper"}


def write_plane(path: Path, names: dict[str, str]) -> None:
    """Write two triangulated rectangles (0,1)×(0,1) and (0,1)×(1,3) with given physical names."""
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        pieces = [(2, occ.addRectangle(0, 0, 0, 1, 1)), (2, occ.addRectangle(0, 1, 0, 1, 2))]
        occ.fragment(pieces[:1], pieces[1:])
        occ.synchronize()
        low, high = sorted((occ.getMass(*piece), piece[1]) for piece in gmsh.model.getEntities(2))
        (seam,) = (
            tag
            for _, tag in gmsh.model.getEntities(1)
            if len(gmsh.model.getAdjacencies(1, tag)[0]) == 2
        )
        entities = {"low": (2, low[1]), "high": (2, high[1]), "seam": (1, seam)}
        for key, name in names.items():
            dim, tag = entities[key.rstrip("2")]
            gmsh.model.addPhysicalGroup(dim, [tag], name=name)
        gmsh.model.mesh.generate(2)
        if path.suffix == ".split":
            write_split(path.with_suffix(".msh"))
        else:
            gmsh.option.setNumber("Mesh.SaveAll", 1)
            gmsh.write(str(path))


def test_plane_split(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    if comm.rank == 0:
        names = {"low": "low", "high": "high", "seam": "seam"}
        write_plane(shared_tmp_path / "plane.split", names)
    tagged_mesh = read_gmsh(comm, shared_tmp_path / "plane.msh", gdim=2)
    assert (volume(tagged_mesh, "low"), volume(tagged_mesh, "high")) == pytest.approx((1, 2))
    np.testing.assert_allclose(area_vector(tagged_mesh, "low_seam"), (0, 1), atol=1e-13)
    check_interface(tagged_mesh, "low_seam", "high_seam")


@pytest.mark.mpi2("names0-no physical surface")
@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ({}, "no physical surface"),
        ({"low": "a"}, "cells belong to no named volume"),
        ({"low": "a", "high": "b", "high2": "c"}, "physical groups 'b' and 'c'"),
    ],
)
def test_bad_names_in_file(
    comm: MPI.Intracomm, shared_tmp_path: Path, names: dict[str, str], expected: str
) -> None:
    path = shared_tmp_path / "plane.msh"
    if comm.rank == 0:
        write_plane(path, names)
    assert expected in message(lambda: read_gmsh(comm, path, gdim=2))


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_groups_overlap_and_have_numbers(
    comm: MPI.Intracomm, shared_tmp_path: Path, version: float
) -> None:
    """Lines are in two groups or in unnamed groups; a sentence names omitted groups."""
    path = shared_tmp_path / "groups.msh"
    if comm.rank == 0:
        with gmsh_session() as gmsh:
            plate = gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(2, [plate], 7)
            lines = {"low": on_plane(1, 1, 0), "high": on_plane(1, 1, 1), "end": on_plane(1, 0, 0)}
            gmsh.model.addPhysicalGroup(1, lines["low"], 12)
            gmsh.model.addPhysicalGroup(1, [*lines["low"], *lines["end"]], 13, name="held")
            gmsh.model.addPhysicalGroup(1, lines["high"], 14, name="top")
            gmsh.model.addPhysicalGroup(0, [1], 3, name="corner")
            gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.model.mesh.generate(2)
            gmsh.write(str(path))
    read = read_gmsh(comm, path)
    assert set(read.volumes) == {"7"}
    assert set(read.surfaces) == {"12", "held", "top"}
    lengths = {name: area_of(read, name) for name in read.surfaces}
    assert lengths == pytest.approx({"12": 2.0, "held": 3.0, "top": 2.0})
    assert [remark.partition(" of ")[0] for remark in read.remarks] == [
        "the physical point 'corner'"
    ]


def test_wrong_dimension(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = shared_tmp_path / "plane.msh"
    if comm.rank == 0:
        write_plane(path, {"low": "a", "high": "b"})
    assert "triangles, but tetrahedra are needed" in message(lambda: read_gmsh(comm, path, gdim=3))


def test_quadrilaterals_are_refused(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = shared_tmp_path / "quads.msh"
    if comm.rank == 0:
        with gmsh_session() as gmsh:
            gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(2, [1], name="plate")
            gmsh.model.mesh.setRecombine(2, 1)
            gmsh.model.mesh.generate(2)
            gmsh.write(str(path))
    assert "all must be triangles of one degree" in message(lambda: read_gmsh(comm, path, gdim=2))


def test_surface_off_the_cells(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = shared_tmp_path / "loose.msh"
    if comm.rank == 0:
        with gmsh_session() as gmsh:
            gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
            loose = gmsh.model.occ.addRectangle(0, 0, 2, 1, 1)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(3, [1], name="box")
            gmsh.model.addPhysicalGroup(2, [loose], name="plate")
            gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
            gmsh.model.mesh.generate(3)
            gmsh.write(str(path))
    assert "are not facets of cells" in message(lambda: read_gmsh(comm, path))


@pytest.mark.mpi3("None-does not exist")
@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "does not exist"),
        ("", "is not a gmsh .msh file"),
        ("<xdmf/>\n", "is not a gmsh .msh file"),
        ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "has no elements"),
        ("$MeshFormat\n9.1 0 8\n$EndMeshFormat\n", "gmsh cannot read"),
        ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2 1 2\n3 1", "gmsh cannot read"),
    ],
)
def test_bad_file(
    comm: MPI.Intracomm, shared_tmp_path: Path, content: str | None, expected: str
) -> None:
    path = shared_tmp_path / "bad.msh"
    if comm.rank == 0 and content is not None:
        path.write_text(content)
    text = message(lambda: read_gmsh(comm, path))
    assert expected in text
    assert str(path) in text
    if comm.rank == 0:
        write_plane(path, {"low": "a", "high": "b"})
    comm.barrier()
    assert read_gmsh(comm, path).volumes  # a valid file that is read next is accepted


def test_folder_instead_of_file(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    assert "Is a directory" in message(lambda: read_gmsh(comm, shared_tmp_path))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ({}, "gmsh model has no physical volume"),
        ({"low": "a"}, "is in no physical volume"),
        ({"low": "a", "high": "b", "high2": "c"}, "is in 2 physical volumes"),
    ],
)
def test_bad_model_to_split(tmp_path: Path, names: dict[str, str], expected: str) -> None:
    assert expected in message(lambda: write_plane(tmp_path / "plane.split", names))


def test_session_leaves_gmsh_as_it_was() -> None:
    gmsh = pytest.importorskip("gmsh")
    with gmsh_session():
        gmsh.model.setCurrent(gmsh.model.getCurrent())
        outer = gmsh.model.getCurrent()
        with gmsh_session():
            gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
            gmsh.model.occ.synchronize()
        assert gmsh.model.getCurrent() == outer
        assert not gmsh.model.getEntities()
    assert not gmsh.isInitialized()


def test_interpolation_points(comm: MPI.Intracomm) -> None:
    mesh = build(comm, "stacked_blocks", n=1).mesh
    space = dolfinx.fem.functionspace(mesh, ("DG", 0))
    np.testing.assert_allclose(interpolation_points(space.element), [[0.25, 0.25, 0.25]])
