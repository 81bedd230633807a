"""Test strict bounds for bodies whose strength varies in space."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import (
    DruckerPrager,
    InputError,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
)
from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import given_table
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import Side, profiles_of_cells
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import weakened
from perfplast_fenicsx.materials import Material, MohrCoulomb, Tresca
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.point_net import read_vtu_points
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check_lower, check_upper
from perfplast_fenicsx.proof.halves import differences
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.spatial_fields import (
    DepthTable,
    Formula,
    SpatialField,
    Strength,
    read_points,
    read_vtu,
    spatial_field,
)
from tests.limit_analysis.test_linear_tractions import SQUARE, cube
from tests.limit_analysis.test_static_bound import rectangle

PHI = 20.0
N = math.tan(math.radians(45 + PHI / 2)) ** 2
LINEAR = "10 + 6*x"
BENT = "10 + 6*abs(x - 0.5)"


def material(law: str, cohesion: Strength) -> Material:
    """Return a body's material for a law, by its name in case files."""
    if law == "von-mises":
        return VonMises(1e4, 0.3, math.sqrt(3) * cohesion)
    if law == "tresca":
        return Tresca(1e4, 0.3, cohesion)
    if law == "drucker-prager":
        return DruckerPrager(1e4, 0.3, cohesion, PHI, "plane-strain")
    return MohrCoulomb(1e4, 0.3, cohesion, PHI)


def square(
    law: str, cohesion: Strength, pressure: float | str = LINEAR, n: int = 2, shake: float = 0.1
) -> Problem:
    """Return the unit square on rollers, under a pressure proportional to its strength.

    A stress σ_yy(x) is in equilibrium, and a uniform strain rate causes flow everywhere.
    """
    halves = {"lower": lambda x: x[1] < 0.5, "upper": lambda x: x[1] > 0.5}
    mesh = rectangle((n, n), (1.0, 1.0), halves, SQUARE, shake)
    supports = [Support("left", "x"), Support("bottom", "y")]
    materials = dict.fromkeys(halves, material(law, cohesion))
    return Problem(mesh, materials, supports, [Pressure("top", pressure)], degree=2)


def proven(problem: Problem, path: Path, rtol: float = 1e-6, name: str = "bounds") -> BodyBounds:
    """Return strict bounds, which the checker also finds. Collective."""
    bounds = limit_bounds(problem, rtol)
    assert bounds.strict, (bounds.lower.why_not, bounds.upper.why_not)
    folder = ResultFolder(MPI.COMM_WORLD, path, force=True)
    file = folder.file(f"{name}.h5")
    write_proof(folder, file, *proofs(bounds, bounds))
    checked = check(file)
    assert set(checked) == {"lower", "upper"}
    for half in checked.values():
        assert not half.faults, half.faults
    return bounds


def values(bounds: BodyBounds) -> tuple[float, float]:
    """Return both bounds."""
    assert bounds.lower.value is not None and bounds.upper.value is not None
    return bounds.lower.value, bounds.upper.value


@pytest.mark.long(but=["von-mises", "mohr-coulomb"])
@pytest.mark.parametrize("law", ["von-mises", "tresca", "drucker-prager", "mohr-coulomb"])
def test_a_block_of_linear_strength(shared_tmp_path: Path, law: str) -> None:
    exact = 2.0 if law in ("von-mises", "tresca") else 2 * math.sqrt(N)
    bounds = proven(square(law, Formula(LINEAR)), shared_tmp_path)
    low, high = values(bounds)
    assert exact * (1 - 1e-5) <= low <= exact <= high <= exact * (1 + 1e-5)


@pytest.mark.long(but=["von-mises", "mohr-coulomb"])
@pytest.mark.parametrize("law", ["von-mises", "tresca", "drucker-prager", "mohr-coulomb"])
def test_a_block_in_space(shared_tmp_path: Path, law: str) -> None:
    """The cube on rollers carries a pressure along z in proportion to its uniaxial strength."""
    cohesion: Strength = Formula("10 + 6*x")
    exact = {"von-mises": math.sqrt(3), "tresca": 2.0}.get(law, 2 * math.sqrt(N))
    body = material(law, cohesion)
    if law == "drucker-prager":
        body = DruckerPrager(1e4, 0.3, cohesion, PHI, "compression")
    supports = [Support(f"{axis}0", axis) for axis in "xyz"]
    problem = Problem(cube(1), {"block": body}, supports, [Pressure("z1", LINEAR)], degree=2)
    bounds = proven(problem, shared_tmp_path, 1e-5)
    low, high = values(bounds)
    assert exact * (1 - 1e-4) <= low <= exact <= high <= exact * (1 + 1e-4)


@pytest.mark.long(but=["mohr-coulomb"])
@pytest.mark.mpi2
@pytest.mark.parametrize("law", ["tresca", "mohr-coulomb"])
def test_a_strength_with_a_kink_in_cells(shared_tmp_path: Path, law: str) -> None:
    """Both bounds remain strict: the lower bound uses less strength, the upper bound more."""
    found = {
        n: proven(square(law, Formula(BENT), 1.0, n, 0.0), shared_tmp_path, name=str(n))
        for n in (3, 4, 6)
    }
    told = {n: any("not linear in each cell" in it for it in found[n].taken) for n in found}
    assert told == {3: True, 4: False, 6: False}  # even numbers have a line of edges at the kink
    low, high = np.array([values(bounds) for bounds in found.values()]).T
    assert low.max() <= high.min()
    assert high[0] - low[0] > 2 * (high[1] - low[1])


def test_the_checker_judges_a_strength_that_varies(shared_tmp_path: Path) -> None:
    """The checker finds stresses that exceed a weaker cell, and halves with different bodies."""
    problem = square("tresca", Formula(LINEAR))
    proven(problem, shared_tmp_path)
    if MPI.COMM_WORLD.rank:
        return
    with h5py.File(shared_tmp_path / "bounds.h5") as file:
        halves = {
            kind: {name: np.asarray(data) for name, data in file[kind].items()}
            | {"bound": np.asarray(file[kind].attrs["bound"])}
            for kind in ("lower", "upper")
        }
    strength = halves["lower"]["cell_strength"]
    assert strength.min() == pytest.approx(10.0, rel=1e-12)
    assert strength.max() == pytest.approx(16.0, rel=1e-12)
    assert not check_lower(halves["lower"]).faults
    weaker = {**halves["lower"], "cell_strength": strength.copy()}
    weaker["cell_strength"][5, 1] *= 0.99
    assert check_lower(weaker).faults
    stronger = {**halves["upper"], "cell_strength": strength * 1.01}
    assert check_upper(stronger).faults
    lower, upper = (Body.of(halves[kind]) for kind in ("lower", "upper"))
    assert not differences(lower, upper)
    assert differences(lower, Body.of(weaker))
    assert not differences(Body.of(weaker), upper)
    for wrong in (0.0, -1.0, np.nan):
        broken = {**halves["lower"], "cell_strength": np.where(strength > 15, wrong, strength)}
        with pytest.raises(ProofError, match="cell_strength"):
            check_lower(broken)


@pytest.mark.mpi2
def test_writings_of_one_field_agree() -> None:
    """A formula and a table over depth give the same strength, to rounding, and the same bounds."""
    fields = Formula("16 - 6*y"), DepthTable([(1.0, 10.0), (0.0, 16.0)])
    problems = [square("tresca", field, 1.0) for field in fields]
    sides: tuple[Side, ...] = ("below", "above")
    for side in sides:
        one, other = (profiles_of_cells(problem, side) for problem in problems)
        assert one is not None and other is not None
        assert np.allclose(one, other, rtol=1e-12, atol=0.0)
    rtol = 1e-6
    one, other = (np.array(values(limit_bounds(problem, rtol))) for problem in problems)
    assert np.allclose(one, other, rtol=rtol, atol=0.0)


@pytest.mark.mpi2
@pytest.mark.parametrize(
    ("field", "words"),
    [
        (Formula("10 - 12*x"), r"strength of 'lower', 10 - 12\*x, is -2 at \(1, "),
        (DepthTable([(0.0, 1.0), (0.7, 1.0)]), r"covers 0 to 0.7.*material at \("),
        (Formula("10 + sqrt(y)"), "linear functions below and above"),
    ],
)
def test_fields_that_are_refused(field: SpatialField, words: str) -> None:
    with pytest.raises(InputError, match=words):
        limit_bounds(square("tresca", field, 1.0))


def test_tables_that_are_none() -> None:
    with pytest.raises(InputError, match="two values at the coordinate 1;"):
        DepthTable([(1.0, 10.0), (1.0, 16.0)])
    with pytest.raises(InputError, match="at least two pairs"):
        DepthTable([(1.0, 10.0)])
    with pytest.raises(InputError, match="not finite"):
        DepthTable([(1.0, 10.0), (2.0, math.nan)])
    with pytest.raises(InputError, match="has the name 't'"):
        Formula("10 + t")


def test_linear_functions_beside_a_table() -> None:
    """The functions enclose the table in each triangle, and equal it if no kink lies inside."""
    rng = np.random.default_rng(0)
    field = 2.0 * DepthTable([(0.0, 3.0), (0.4, 1.0), (0.5, 4.0), (1.0, 5.0)])
    corners = rng.random((200, 3, 2))
    low, high = field.between(corners, "here")
    shares = rng.dirichlet(np.ones(3), 50)
    exact = np.stack([field.at(share @ corners, "here") for share in shares], axis=1)
    assert (low @ shares.T <= exact + 1e-12).all()
    assert (high @ shares.T >= exact - 1e-12).all()
    y = corners[..., 1]
    bent = np.zeros(len(y), dtype=bool)
    for kink in (0.4, 0.5):
        bent |= (y.min(axis=1) < kink) & (y.max(axis=1) > kink)
    assert 0 < bent.sum() < len(bent)
    assert np.array_equal(low[~bent], high[~bent])
    assert (high[bent] > low[bent]).all()


def test_a_factor_of_safety_divides_a_field() -> None:
    """With half the strengths, the body carries half the load."""
    halved = weakened(square("tresca", Formula(LINEAR)), 2.0)
    low, high = values(limit_bounds(halved, 1e-6))
    assert 1 - 1e-5 <= low <= 1 <= high <= 1 + 1e-5


def write_points(path: Path, n: int, seed: int, value: Callable[[Floats], Floats]) -> Path:
    """Write values at corners, on sides and at random inner points of the unit square."""
    rng = np.random.default_rng(seed)
    sides = np.linspace(0.0, 1.0, 4)
    around = [(a, b) for a in sides for b in sides if {a, b} & {0.0, 1.0}]
    points = np.concatenate([np.array(around), rng.random((n, 2))])
    table = np.column_stack([points, value(points)]).tolist()
    rows = [",".join(map(repr, row)) for row in table]
    path.write_text("\n".join(["x,y,c", *rows]), encoding="utf-8")
    return path


def test_a_linear_field_of_a_file(tmp_path: Path) -> None:
    """The field equals the formula for any points."""
    path = write_points(tmp_path / "points.csv", 40, 1, lambda x: 10 + 6 * x[:, 0])
    given = [square("tresca", field, 1.0) for field in (Formula(LINEAR), read_points(path, "c"))]
    sides: tuple[Side, ...] = ("below", "above")
    for side in sides:
        one, other = (profiles_of_cells(problem, side) for problem in given)
        assert one is not None and other is not None
        assert np.allclose(one, other, rtol=1e-12, atol=0.0)


def test_linear_functions_beside_scattered_values(tmp_path: Path) -> None:
    """Two linear functions enclose the field in each triangle, and touch it from both sides."""
    rng = np.random.default_rng(3)
    path = tmp_path / "points.csv"
    write_points(path, 30, 2, lambda x: rng.lognormal(1.0, 0.5, len(x)))
    field = 3.0 * read_points(path, "c")
    corners = rng.random((100, 3, 2))
    low, high = field.between(corners, "here")
    shares = rng.dirichlet(np.ones(3), 400)
    exact = np.stack([field.at(share @ corners, "here") for share in shares], axis=1)
    off = 1e-9 * exact.max()
    assert (low @ shares.T <= exact + off).all()
    assert (high @ shares.T >= exact - off).all()
    touching = (exact - low @ shares.T).min(axis=1) / (high - low).max(axis=1)
    assert np.median(touching) < 0.05


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,d\n0,0,1", "has no column 'c'"),
        ("x,y,c\n0,0,1\n1,0,a\n", "row 3 has no number"),
        ("x,y,c\n0,0,1\n1,0,1\n2,0,1\n3,0,1\n", "span no area"),
        ("x,y,c\n0,0,1\n1,0,1\n0,1,1\n1,0,1\n", "point .* twice"),
        ("x,y,c\n0,0,1\n1,0,1\n0,1,nan\n", "not finite"),
    ],
)
def test_files_that_are_no_field(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_points(path, "c")


@pytest.mark.mpi2
def test_a_random_field_of_a_file(shared_tmp_path: Path) -> None:
    """Log-normal values with a given seed have strict bounds, and a proof on file."""
    rng = np.random.default_rng(7)
    path = shared_tmp_path / "points.csv"
    values_of = rng.lognormal(2.0, 0.3, 200)
    if MPI.COMM_WORLD.rank == 0:
        write_points(path, 40, 5, lambda x: values_of[: len(x)])
    MPI.COMM_WORLD.barrier()
    problem = square("tresca", read_points(path, "c"), 1.0, 4)
    low, high = values(proven(problem, shared_tmp_path))
    assert 2 * float(values_of.min()) <= low <= high


@pytest.mark.long
def test_a_formula_that_is_constant_is_a_number() -> None:
    bounds = [
        limit_bounds(square("mohr-coulomb", strength, 1.0), 1e-6)
        for strength in (10.0, Formula("10 + 0*y"))
    ]
    assert np.allclose(values(bounds[0]), values(bounds[1]), rtol=1e-10, atol=0.0)


def test_results_have_a_field_in_words() -> None:
    told = given_table(square("tresca", 2 * Formula(LINEAR), 1.0).given)
    assert told["materials"]["lower"]["cohesion"] == "2 times (10 + 6*x)"


def write_vtu(path: Path, problem: Problem, value: Callable[[Floats], Floats]) -> Path:
    """Write values at the vertices of a mesh, with its triangles, as text."""
    vertices, places = corners(problem.tagged_mesh.mesh)
    write_grid(path, places, vertices, value(places))
    return path


def write_grid(path: Path, points: Floats, cells: Longs, values: Floats) -> None:
    """Write a mesh with an array c at its points, as text."""

    def array(kind: str, numbers: Any, more: str = "") -> str:
        text = " ".join(map(repr, np.asarray(numbers).ravel().tolist()))
        return f'<DataArray type="{kind}" {more} format="ascii">{text}</DataArray>'

    n, size = len(cells), cells.shape[1]
    inside = [
        f"<Points>{array('Float64', np.pad(points, ((0, 0), (0, 3 - points.shape[1]))))}</Points>",
        "<Cells>",
        array("Int64", cells, 'Name="connectivity"'),
        array("Int64", size * np.arange(1, n + 1), 'Name="offsets"'),
        array("UInt8", np.full(n, {3: 5, 4: 10}[size]), 'Name="types"'),
        "</Cells><PointData>",
        array("Float64", values, 'Name="c"'),
        "</PointData>",
    ]
    piece = f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{n}">{"".join(inside)}</Piece>'
    grid = f"<UnstructuredGrid>{piece}</UnstructuredGrid>"
    path.write_text(f'<VTKFile type="UnstructuredGrid">{grid}</VTKFile>', encoding="utf-8")


def test_values_on_the_cells_of_the_mesh_are_exact(tmp_path: Path) -> None:
    """A field with the cells of the mesh is linear in each cell, and in its parts."""
    rng = np.random.default_rng(11)
    problem = square("tresca", 1.0, 1.0, 3)
    path = write_vtu(tmp_path / "c.vtu", problem, lambda x: rng.lognormal(2.0, 0.5, len(x)))
    field = read_vtu(path, "c")
    vertices, places = corners(problem.tagged_mesh.mesh)
    low, high = field.between(places[vertices], "here")
    assert np.allclose(low, field.net.values[vertices], rtol=1e-9, atol=0.0)
    assert np.allclose(low, high, rtol=1e-9, atol=0.0)
    middles = (places[vertices] + places[vertices][:, [1, 2, 0]]) / 2
    low, high = field.between(middles, "here")
    assert np.allclose(low, high, rtol=1e-9, atol=0.0)


@pytest.mark.serial
def test_a_linear_field_is_one_strength_however_it_is_given(tmp_path: Path) -> None:
    """Formula, table, points, a separate mesh and the body's mesh agree to 1e-12."""
    rng = np.random.default_rng(2)
    points = write_points(tmp_path / "points.csv", 40, 1, lambda x: 16 - 6 * x[:, 1])
    other = write_vtu(tmp_path / "c.vtu", square("tresca", 1.0, 1.0, 5), lambda x: 16 - 6 * x[:, 1])
    given: list[Strength] = [Formula("16 - 6*y"), DepthTable([(1.0, 10.0), (0.0, 16.0)])]
    given += [read_points(points, "c"), read_vtu(other, "c")]
    x = rng.random((100, 3, 2)) * 0.9 + 0.05
    first, *others = (field.between(x, "here") for field in given)
    for one in others:
        assert np.allclose(one, first, rtol=1e-12, atol=0.0)


def test_meshes_of_values_that_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.vtu"
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    write_grid(path, points, cells, np.ones(4))
    with pytest.raises(InputError, match=r"no array 'd'.* in the file: c"):
        read_vtu(path, "d")
    with pytest.raises(InputError, match=r"material at \(0\.5, 2\), outside"):
        read_vtu(path, "c").at(np.array([[0.5, 2.0]]), "here")
    with pytest.raises(InputError, match="points in 2 dimensions, but the body has 3"):
        read_vtu(path, "c").at(np.array([[0.5, 0.5, 0.5]]), "here")
    for wrong, words in [
        ([[0, 1, 2], [0, 1, 3]], r"cells that overlap at \("),
        ([[0, 1, 2], [0, 2, 2]], r"a degenerate cell .* at \("),
        ([[0, 1, 2], [0, 2, 7]], "whose points do not exist"),
    ]:
        write_grid(path, points, np.array(wrong), np.ones(4))
        with pytest.raises(InputError, match=words):
            read_vtu(path, "c")
    write_grid(
        path, np.vstack([points, points[[2]]]), np.array([[0, 1, 2], [0, 4, 3]]), np.arange(5.0)
    )
    with pytest.raises(InputError, match=r"two values at the point \(1, 1\)"):
        read_vtu(path, "c")
    path.write_text("<VTKFile/>", encoding="utf-8")
    with pytest.raises(InputError, match=r"cannot be read as a \.vtu file"):
        read_vtu(path, "c")
    with pytest.raises(InputError, match="cannot be read"):
        read_vtu(tmp_path / "none.vtu", "c")


@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
def test_files_that_vtk_writes(tmp_path: Path, mode: str) -> None:
    """The data are text, base64 or raw bytes, with and without compression."""
    vtk = pytest.importorskip("vtkmodules.vtkIOXML", reason="VTK is not installed")
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed")
    rng = np.random.default_rng(4)
    cells = np.arange(30000).reshape(-1, 3)  # more than one block of VTK
    grid = pyvista.UnstructuredGrid({5: cells}, rng.random((30000, 3)))
    grid.point_data["other"], grid.point_data["c"] = np.arange(30000), rng.random(30000)
    for compressed, coded in ((True, True), (True, False), (False, True), (False, False)):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(tmp_path / "c.vtu"))
        writer.SetInputData(grid)
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.SetEncodeAppendedData(coded)
        if not compressed:
            writer.SetCompressorTypeToNone()
        writer.Write()
        found = read_vtu_points(tmp_path / "c.vtu", "c")
        assert np.allclose(found.points, grid.points, rtol=0.0, atol=1e-9)
        assert np.allclose(found.values, grid.point_data["c"], rtol=0.0, atol=1e-9)
        assert np.array_equal(found.cells, cells)


@pytest.mark.parametrize("name", ["pipe.csv", "pipe.vtu"])
def test_a_pipe_is_no_field(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=f"'{name}' is not a regular file"):
        spatial_field({"file": name, "column": "c"}, tmp_path)
