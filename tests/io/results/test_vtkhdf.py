"""Test that VTK and h5py read stored fields on any number of ranks, with midside nodes."""

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest
import ufl
from dolfinx import fem

from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Elastic, Pressure, Problem, Support, TaggedMesh, read_gmsh
from perfplast_fenicsx.environment import environment_apart
from perfplast_fenicsx.io.results import field_series
from perfplast_fenicsx.io.results.field_series import FieldSeries
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from tests.io.results.test_result_folder import report

SPANS = {5: 3, 22: 3, 10: 4, 24: 4}
"""Number of vertices of cells, by VTK's type."""

MIDSIDES = {22: [(0, 1), (1, 2), (2, 0)], 24: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]}
"""Ends of the edges whose middles contain the nodes after the vertices, from VTK's manual."""

needs_pyvista = pytest.mark.skipif(
    importlib.util.find_spec("pyvista") is None, reason="no pyvista to read with"
)

READ = """
import sys
import numpy
import pyvista

grid = pyvista.HDFReader(sys.argv[1]).read()
sizes = grid.compute_cell_sizes()
arrays = {"points": grid.points, "kinds": grid.celltypes, "offsets": grid.offset}
arrays |= {"corners": grid.cell_connectivity, "size": sizes["Area"] + sizes["Volume"]}
for data in (grid.point_data, grid.cell_data, grid.field_data):
    arrays |= {name: numpy.asarray(data[name]) for name in data.keys()}
numpy.savez(sys.argv[2], **arrays)
"""


def read_by_pyvista(comm: MPI.Intracomm, path: Path) -> dict[str, np.ndarray]:
    """Return a grid as PyVista reads it, in a separate process (VTK brings its own MPI).

    Collective.
    """
    arrays: dict[str, np.ndarray] = {}
    failure = ""
    if comm.rank == 0:
        target = path.with_suffix(".npz")
        command = [sys.executable, "-c", READ, str(path), str(target)]
        done = subprocess.run(
            command, env=environment_apart(), cwd="/", capture_output=True, text=True
        )
        failure = "" if done.returncode == 0 else done.stderr
        if not failure:
            with np.load(target) as file:
                arrays = dict(file)
    arrays, failure = comm.bcast((arrays, failure))
    assert not failure, failure
    return arrays


def bodies(comm: MPI.Intracomm, folder: Path, dim: int, order: int) -> TaggedMesh:
    """Return two bodies, one in the other, with straight or curved edges.

    Collective on all ranks.
    """
    path = folder / f"bodies_{dim}_{order}.msh"
    if MPI.COMM_WORLD.rank == 0 and not path.exists():
        if dim == 2:
            write_thick_tube(path, interface=1.1, size=0.25, order=order)
        else:
            write_thick_sphere(path, interface=1.5, size=0.45, order=order)
    MPI.COMM_WORLD.barrier()
    return read_gmsh(comm, path)


def loaded(tagged_mesh: TaggedMesh, degree: int) -> Problem:
    supports = [Support(f"{axis}0", axis) for axis in "xyz"[: tagged_mesh.mesh.geometry.dim]]
    materials = dict.fromkeys(tagged_mesh.volumes, Elastic(1.0, 0.3))
    return Problem(tagged_mesh, materials, supports, [Pressure("inner", 1.0)], degree=degree)


def displacement(x: np.ndarray) -> np.ndarray:
    """Return a quadratic displacement with three components at points (3, n)."""
    return np.array([x[0] * x[1], x[0] ** 2 - x[1], x[1] ** 2 + x[2] * x[0]])


def some_fields(problem: Problem) -> dict[str, fem.Function]:
    """Return one field of each kind."""
    mesh = problem.tagged_mesh.mesh
    spaces = {
        "displacement": problem.V,
        "stress": fem.functionspace(mesh, ("DG", 0, (3, 3))),
        "yield_ratio": fem.functionspace(mesh, ("DG", 0)),
        "contact_pressure": fem.functionspace(mesh, ("P", 1)),
    }
    fields = {name: fem.Function(space) for name, space in spaces.items()}
    fields["displacement"].interpolate(lambda x: displacement(x)[: mesh.geometry.dim])
    fields["stress"].interpolate(lambda x: np.outer(np.arange(9.0), x[0] + 10 * x[1]))
    fields["yield_ratio"].interpolate(lambda x: x[0] - x[1])
    fields["contact_pressure"].interpolate(lambda x: 2 * x[0] + x[1] - 3 * x[2])
    return fields


def write(problem: Problem, path: Path) -> ResultFolder:
    """Write a series with one level."""
    folder = ResultFolder(problem.comm, path)
    folder.create()
    FieldSeries(folder, problem, Prescribed.WORK).write(
        1, some_fields(problem), report(0.25, alpha=0.5)
    )
    return folder


@pytest.mark.long(but=["1-1-2", "2-2-3"])
@needs_pyvista
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("degree", [1, 2])
def test_vtk_reads_what_was_written(
    dim: int, order: int, degree: int, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    problem = loaded(bodies(comm, shared_tmp_path, dim, order), degree)
    folder = write(problem, shared_tmp_path / "results")
    tagged_mesh = problem.tagged_mesh
    grid = read_by_pyvista(comm, folder.file("fields/level_0001.vtkhdf"))

    kind = {(2, 1): 5, (2, 2): 22, (3, 1): 10, (3, 2): 24}[dim, max(order, degree)]
    assert set(grid["kinds"]) == {kind}
    cells = grid["corners"].reshape(len(grid["kinds"]), -1)
    index_map = tagged_mesh.mesh.topology.index_map(dim)
    assert len(cells) == index_map.size_global
    if degree >= order:
        assert len(grid["points"]) == problem.V.dofmap.index_map.size_global
    assert not np.any(grid["points"][:, dim:])

    # positions of the points, bodies of the cells, and sizes of the bodies
    dx = ufl.Measure("dx", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.cell_tags)
    one = fem.Constant(tagged_mesh.mesh, 1.0)
    names = [str(name) for name in grid["body_names"]]
    assert dict(zip(names, grid["body_tags"], strict=True)) == tagged_mesh.volumes
    for name in names:
        mine = grid["body"] == tagged_mesh.volumes[name]
        radii = np.linalg.norm(grid["points"][cells[mine]], axis=2)
        inner, outer = {
            "inner_tube": (1, 1.1),
            "outer_tube": (1.1, 1.3),
            "inner_shell": (1, 1.5),
            "outer_shell": (1.5, 2),
        }[name]
        assert radii.max() == pytest.approx(outer, rel=1e-6)
        vertices = np.linalg.norm(grid["points"][cells[mine][:, : dim + 1]], axis=2)
        assert vertices.min() == pytest.approx(inner, rel=1e-6)
        size = comm.allreduce(fem.assemble_scalar(fem.form(one * dx(tagged_mesh.volumes[name]))))
        # VTK cuts quadratic cells into linear cells, which is exact for straight edges
        accuracy = 1e-9 if order == 1 else {2: 5e-3, 3: 5e-2}[dim]
        assert grid["size"][mine].sum() == pytest.approx(size, rel=accuracy)
    assert grid["size"].min() > 0

    # midside nodes: in the middle of straight edges, with separate displacements
    middle = np.array(MIDSIDES.get(kind, np.zeros((0, 2))), dtype=int)
    ends = cells[:, middle]
    mids = cells[:, SPANS[kind] :]
    chords = grid["points"][ends].mean(axis=2)
    bulge = np.linalg.norm(grid["points"][mids] - chords, axis=2).max(initial=0)
    assert bulge < 1e-9 if order == 1 else bulge > 1e-3
    u = grid["displacement"]
    expected = displacement(grid["points"].T.astype(float)).T
    expected[:, dim:] = 0
    at_vertices = np.unique(cells[:, : dim + 1])
    assert np.allclose(u[at_vertices], expected[at_vertices], atol=1e-12)
    of_chords = np.abs(u[mids] - u[ends].mean(axis=2)).max(initial=0)
    if degree == 2:
        assert np.allclose(u, expected, atol=1e-12)
        assert of_chords > 1e-3
    else:
        assert of_chords < 1e-12
    pressure = grid["contact_pressure"]
    linear = grid["points"] @ [2, 1, -3]
    assert np.allclose(pressure[at_vertices], linear[at_vertices], atol=1e-12)
    assert np.allclose(pressure[mids], pressure[ends].mean(axis=2), atol=1e-12)

    # fields that are constant in cells, and data of the level
    stress = grid["stress"]
    assert stress.shape == (len(cells), 9)
    assert np.allclose(stress, np.outer(stress[:, 1], np.arange(9.0)))
    if order == 1:
        x = grid["points"][cells[:, : dim + 1]].mean(axis=1)
        assert np.allclose(stress[:, 1], x[:, 0] + 10 * x[:, 1])
        assert np.allclose(grid["yield_ratio"], x[:, 0] - x[:, 1])
    assert (grid["level"], grid["zeta"], grid["alpha"]) == (1, 0.25, 0.5)
    assert grid["prescribed"].tolist() == ["alpha"]


def content(path: Path) -> dict[str, np.ndarray]:
    """Return all arrays of a file, including linked ones."""
    found = {}
    with h5py.File(path, "r") as file:

        def visit(group: h5py.Group) -> None:
            for item in group.values():
                if isinstance(item, h5py.Group):
                    visit(item)
                else:
                    found[item.name] = np.asarray(item)

        visit(file)
    return found


@pytest.mark.mpi3("2-1-2")
@pytest.mark.parametrize(("dim", "order", "degree"), [(2, 1, 2), (3, 2, 1), (3, 1, 1)])
def test_any_number_of_ranks_writes_the_same(
    dim: int, order: int, degree: int, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    together = loaded(bodies(comm, shared_tmp_path, dim, order), degree)
    folder = write(together, shared_tmp_path / "together")
    tagged_mesh = bodies(MPI.COMM_SELF, shared_tmp_path, dim, order)
    if comm.rank == 0:
        expected = write(loaded(tagged_mesh, degree), shared_tmp_path / "alone")
        for name in ("fields/mesh.vtkhdf", "fields/level_0001.vtkhdf"):
            ours, theirs = content(folder.file(name)), content(expected.file(name))
            assert ours.keys() == theirs.keys()
            facets = "/perfplast/surfaces/facets"
            for arrays in (ours, theirs) if facets in ours else ():
                tags = arrays.pop("/perfplast/surfaces/tags")
                rows = np.column_stack([np.sort(arrays[facets], axis=1), tags])
                arrays[facets] = np.unique(rows, axis=0)
                assert len(arrays[facets]) == len(rows) > 0
            for place, values in theirs.items():
                assert ours[place].dtype == values.dtype
                assert ours[place].shape == values.shape
                if values.dtype == float:
                    assert np.allclose(ours[place], values, rtol=1e-12, atol=1e-12), place
                else:
                    assert np.array_equal(ours[place], values), place
    comm.barrier()


@pytest.mark.mpi2
def test_named_facets_are_where_they_belong(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    problem = loaded(bodies(comm, shared_tmp_path, 3, 2), 2)
    found = content(write(problem, shared_tmp_path / "results").file("fields/mesh.vtkhdf"))
    facets, tags = found["/perfplast/surfaces/facets"], found["/perfplast/surfaces/tags"]
    surfaces = problem.tagged_mesh.surfaces
    for name, radius in {"inner": 1.0, "outer": 2.0}.items():
        x = found["/VTKHDF/Points"][facets[tags == surfaces[name]]]
        assert len(x) > 0
        assert np.allclose(np.linalg.norm(x, axis=2), radius, rtol=1e-6)
    x = found["/VTKHDF/Points"][facets[tags == surfaces["y0"]]]
    assert np.allclose(x[..., 1], 0, atol=1e-12)


@pytest.mark.mpi2
def test_a_list_of_levels(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    problem = loaded(bodies(comm, shared_tmp_path, 2, 1), 1)
    folder = ResultFolder(comm, shared_tmp_path / "results")
    folder.create()
    fields = some_fields(problem)

    def listed() -> list[tuple[str, float]]:
        comm.barrier()
        table = json.loads(folder.file("fields.vtkhdf.series").read_text())
        assert table["file-series-version"] == "1.0"
        comm.barrier()
        return [(entry["name"], entry["time"]) for entry in table["files"]]

    def on_file() -> list[str]:
        comm.barrier()
        names = sorted(path.name for path in folder.file("fields").iterdir())
        comm.barrier()
        return names

    names = [f"level_000{number}.vtkhdf" for number in (1, 2, 3)]
    reports = [report(zeta, alpha=zeta**2) for zeta in (1.0, 2.0, 3.0)]
    series = FieldSeries(folder, problem, Prescribed.LOAD_FACTOR)
    assert listed() == []
    for number, level in enumerate(reports, start=1):
        series.write(number, fields, level)
    assert listed() == [(f"fields/{a}", time) for a, time in zip(names, (1, 2, 3), strict=True)]
    assert on_file() == [*names, "mesh.vtkhdf"]

    # a restart continues an earlier run from its second level
    series = FieldSeries(folder, problem, Prescribed.LOAD_FACTOR, reports[:2])
    assert listed() == [(f"fields/{names[0]}", 1), (f"fields/{names[1]}", 2)]
    assert on_file() == [*names[:2], "mesh.vtkhdf"]
    series.write(3, fields, report(2.5, alpha=7.0))
    assert listed()[2:] == [(f"fields/{names[2]}", 2.5)]
    facts = content(folder.file(f"fields/{names[2]}"))
    assert facts["/VTKHDF/FieldData/level"] == 3
    assert facts["/VTKHDF/FieldData/alpha"] == pytest.approx(7.0)

    # levels without fields are omitted
    series.write(7, fields, report(3.5, alpha=9.0))
    assert listed()[3:] == [("fields/level_0007.vtkhdf", 3.5)]

    series.write_mechanism({"mechanism": fields["displacement"]}, 4.0, 5.0)
    mechanism = content(folder.file("mechanism.vtkhdf"))
    assert len(mechanism["/VTKHDF/PointData/mechanism"]) == len(mechanism["/VTKHDF/Points"])
    assert mechanism["/VTKHDF/FieldData/zeta"] == pytest.approx(4.0)


def test_files_are_small_beside_their_fields(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """A level does not repeat the mesh."""
    problem = loaded(bodies(comm, shared_tmp_path, 2, 1), 1)
    folder = write(problem, shared_tmp_path / "results")
    with h5py.File(folder.file("fields/level_0001.vtkhdf"), "r") as file:
        for name in ("Points", "Connectivity", "Offsets", "Types", "CellData/body"):
            link = file["VTKHDF"].get(name, getlink=True)
            assert isinstance(link, h5py.ExternalLink)
            assert link.filename == "mesh.vtkhdf"


@needs_pyvista
@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="no xvfb-run to draw with")
def test_the_line_for_pyvista(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """The line in the docstring draws results literally, in a folder that was moved."""
    (line,) = re.findall(r"^    (pyvista\..+)$", field_series.__doc__ or "", re.MULTILINE)
    write(loaded(bodies(comm, shared_tmp_path, 3, 1), 2), shared_tmp_path / "first")
    status = ""
    if comm.rank == 0:
        (shared_tmp_path / "elsewhere").mkdir()
        (shared_tmp_path / "first").rename(shared_tmp_path / "elsewhere" / "results")
        picture = shared_tmp_path / "picture.png"
        line = line.replace(".plot(", f'.plot(screenshot="{picture}", ')
        done = subprocess.run(
            ["xvfb-run", "-a", sys.executable, "-c", f"import pyvista\n{line}"],
            env=environment_apart() | {"PYVISTA_OFF_SCREEN": "true"},
            cwd=shared_tmp_path / "elsewhere",
            capture_output=True,
            text=True,
        )
        status = "" if done.returncode == 0 and picture.stat().st_size > 5000 else done.stderr
    assert comm.bcast(status) == ""
