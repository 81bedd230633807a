"""Test steady flow of water against exact discharges, heads and balances."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix.ufl
import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx.mesh import create_mesh, locate_entities_boundary, meshtags

from perfplast_fenicsx import (
    InputError,
    MohrCoulomb,
    PorePressure,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.limit_analysis.body.finer_meshes import number_of_cells
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.mesh import Box, Surface, refine, structured_mesh
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.declared.loads import FieldPores
from perfplast_fenicsx.seepage import Head, Seepage, SteadyFlow, steady_flow
from perfplast_fenicsx.solvers.linear.petsc_options import check_options

COMM = MPI.COMM_WORLD

Where = Callable[[npt.NDArray[Any]], npt.NDArray[np.bool_]]


def grid(
    x: Floats,
    y: Floats,
    surfaces: Mapping[str, Where],
    seam: float | None = None,
    bent: Callable[[Floats], Floats] = lambda points: points,
) -> TaggedMesh:
    """Return rectangles, each of two triangles with alternating diagonals.

    Args:
        x: Coordinates of the columns.
        y: Coordinates of the rows.
        surfaces: Where named parts of the boundary lie.
        seam: Height above which the body is "above", with vertices of its own; else one body.
        bent: Where the points go.
    """
    parts = [y] if seam is None else [y[y <= seam + 1e-12], y[y >= seam - 1e-12]]
    points, cells, bodies, begin = [], [], [], 0
    for body, rows in enumerate(parts):
        count = len(rows)
        points.append(np.stack(np.meshgrid(x, rows, indexing="ij"), axis=-1).reshape(-1, 2))
        i, j = (a.ravel() for a in np.indices((len(x) - 1, count - 1)))
        a, b = i * count + j, (i + 1) * count + j
        d, c = a + 1, b + 1
        even = ((i + j) % 2 == 0)[:, None]
        one = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
        other = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
        cells.append(begin + np.concatenate([one, other]))
        bodies += [body] * 2 * len(i)
        begin += len(points[-1])
    lead = COMM.rank == 0
    nodes, places = np.concatenate(cells), bent(np.concatenate(points))
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    mesh = create_mesh(
        COMM, nodes if lead else nodes[:0], x=places if lead else places[:0], e=ufl.Mesh(element)
    )
    topology = mesh.topology
    topology.create_connectivity(1, 2)
    order = topology.original_cell_index
    owned = topology.index_map(2).size_local
    tags = (1 + np.array(bodies)[order[:owned]]).astype(np.int32)
    found = [locate_entities_boundary(mesh, 1, where) for where in surfaces.values()]
    facets = np.concatenate(found)
    values = np.repeat(np.arange(1, 1 + len(found)), [len(some) for some in found])
    sort = np.argsort(facets)
    return TaggedMesh.from_tags(
        mesh,
        meshtags(mesh, 2, np.arange(owned, dtype=np.int32), tags),
        meshtags(mesh, 1, facets[sort], values[sort].astype(np.int32)),
        {"ground": 1} if seam is None else {"below": 1, "above": 2},
        {name: number for number, name in enumerate(surfaces, start=1)},
    )


def steps(begin: float, end: float, count: int) -> Floats:
    """Return evenly spaced numbers."""
    return np.asarray(np.linspace(begin, end, count), dtype=np.float64)


def water(
    unit_weight: float, conductivity: dict[str, Any], heads: list[Head], **given: Any
) -> Seepage:
    """Return the declaration of a flow."""
    return Seepage(conductivity, heads, unit_weight=unit_weight, **given)


def at(axis: int, value: float) -> Where:
    """Return where a coordinate has a given value."""
    return lambda x: np.isclose(x[axis], value)


def dam(length: float, high: float, low: float, columns: int, rows: int) -> SteadyFlow:
    """Return the flow through a rectangular dam on an impervious base."""
    sides = {"left": at(0, 0.0), "right": at(0, length)}
    mesh = grid(steps(0, length, columns + 1), steps(0, high, rows + 1), sides)
    heads = [Head("left", high), Head("right", low)]
    return steady_flow(mesh, water(9.81, {"ground": 2e-3}, heads))


@pytest.mark.mpi3
def test_discharge_of_a_rectangular_dam() -> None:
    """Dupuit's discharge is exact (Charny) for any height of the seepage face."""
    flow = dam(5.0, 10.0, 2.0, 20, 40)
    exact = 2e-3 * (10.0**2 - 2.0**2) / (2 * 5.0)
    assert flow.discharges["left"] == pytest.approx(exact, rel=2e-3)
    assert flow.imbalance < 1e-10
    assert flow.iterations < 20
    inner = (flow.saturation > 1e-3) & (flow.saturation < 1 - 1e-3)
    assert inner.mean() < 0.1  # the free surface is one cell thick


def test_height_of_the_seepage_face() -> None:
    """A dam 24 high and 16 wide with tailwater 4: 12.79 (Aitchison, Proc.

    R. Soc. A 330 (1972) 573).
    """
    flow = dam(16.0, 24.0, 4.0, 32, 48)
    right = np.isclose(flow.points[:, 0], 16.0)
    height, outflow = flow.points[right, 1], flow.outflow[right]
    wet = outflow > 1e-6 * outflow.max()
    top, step = height[wet].max(), 24.0 / 48
    above = flow.saturation[right][np.argmin(np.abs(height - top - step))]
    assert top + above * step == pytest.approx(12.79, rel=0.02)
    assert flow.discharges["left"] == pytest.approx(2e-3 * 17.5, rel=2e-3)


@pytest.mark.parametrize(("depth", "exact"), [(0.5, 0.5), (0.75, 0.3403)])
def test_sheet_pile_in_a_layer(depth: float, exact: float) -> None:
    """Pavlovsky's discharge below a sheet pile is q/kH = K'/2K; the mesh is half of the layer."""
    tip, far, count = 1.0 - depth, 5.0, 32
    even = steps(0, 1, count + 1)
    x = far * steps(0, 1, 2 * count + 1) ** 3
    y = np.unique(np.concatenate([tip - tip * even**2, tip + depth * even**2]))
    surfaces: dict[str, Where] = {
        "gap": lambda x: np.isclose(x[0], 0) & (x[1] <= tip + 1e-9),
        "surface": at(1, 1.0),
    }
    heads = [Head("gap", 1.5, presses=False), Head("surface", 1.0)]
    flow = steady_flow(grid(x, y, surfaces), water(9.81, {"ground": 1.0}, heads))
    assert flow.discharges["gap"] == pytest.approx(exact, rel=3e-3)
    assert flow.imbalance < 1e-10


def test_drain_under_a_dam() -> None:
    """Kozeny's flow to a horizontal drain, from a parabolic face with constant head: q = 0.3.

    z = −(φ + iψ)²/2q with k = 1: the face is φ = 1, the base ψ = 0, the drain φ = 0.
    """
    q, end = 0.3, 0.6
    tip = 1 / (1 + 2 * q * end)  # fraction of the base without a drain

    def bent(points: Floats) -> Floats:
        share, y = points.T
        face = (q * np.minimum(y, 1.0) ** 2 - 1 / q) / 2
        return np.column_stack([face + share * (end - face), y])

    surfaces: dict[str, Where] = {
        "face": lambda x: np.isclose(x[0], (q * np.minimum(x[1], 1.0) ** 2 - 1 / q) / 2),
        "drain": lambda x: np.isclose(x[1], 0.0) & (x[0] > -1e-9),
    }
    before, beyond = tip * (1 - steps(1, 0, 49) ** 1.5), tip + (1 - tip) * steps(0, 1, 17)[1:]
    rows = np.concatenate([steps(0, 1, 49) ** 1.5, [1.1, 1.2]])
    mesh = grid(np.concatenate([before, beyond]), rows, surfaces, bent=bent)
    heads = [Head("face", 1.0)]
    flow = steady_flow(mesh, water(9.81, {"ground": 1.0}, heads, outlet=["drain"]))
    assert flow.discharges["face"] == pytest.approx(q, rel=0.02)


@pytest.mark.mpi2
def test_water_at_rest() -> None:
    sides = {"left": at(0, 0.0), "right": at(0, 2.0)}
    mesh = grid(steps(0, 2, 6), steps(0, 3, 7), sides)
    heads = [Head("left", 2.0), Head("right", 2.0)]
    flow = steady_flow(mesh, water(10.0, {"ground": 1.0}, heads))
    at_rest = 10.0 * np.maximum(2.0 - flow.points[:, 1], 0.0)
    assert flow.pressures == pytest.approx(at_rest, abs=1e-4)
    assert flow.discharges["left"] == pytest.approx(0.0, abs=1e-5)
    assert flow.saturation[flow.points[:, 1] < 2.0] == pytest.approx(1.0)


@pytest.mark.parametrize(("drawdown", "depth"), [(3.5, 3.5), (3.0, 3.0), (0.5, 3.0)])
def test_drawdown_of_water_above_a_level_surface(drawdown: float, depth: float) -> None:
    """The pore pressure decreases as the pressure of the water above the ground, and no further."""
    mesh = grid(steps(0, 2, 4), steps(0, 3, 7), {"top": at(1, 3.0), "left": at(0, 0.0)})
    heads = [Head("top", 5.0, drawdown=drawdown)]
    flow = steady_flow(mesh, water(10.0, {"ground": 1.0}, heads))
    assert flow.pressures == pytest.approx(10.0 * (depth - flow.points[:, 1]), abs=1e-6)


def test_drawdown_beside_a_slope() -> None:
    """Above the lowered level, the head is the height of the slope; elsewhere it is the level."""

    def bent(x: Floats) -> Floats:
        return np.column_stack([x[:, 0], x[:, 1] * (1 + x[:, 0] / 2)])

    slope = {"slope": lambda x: np.isclose(x[1], 1 + x[0] / 2)}
    mesh = grid(steps(0, 2, 9), steps(0, 1, 5), slope, bent=bent)
    flow = steady_flow(mesh, water(10.0, {"ground": 1.0}, [Head("slope", 2.0, drawdown=1.5)]))
    x, y = flow.points.T
    assert flow.pressures == pytest.approx(10.0 * (np.maximum(1.5, 1 + x / 2) - y), abs=1e-6)
    assert flow.discharges["slope"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.mpi2
def test_layers_in_series() -> None:
    """Water flows down through two layers, which are separate bodies: q = H / (d₁/k₁ + d₂/k₂)."""
    ends = {"base": at(1, 0.0), "top": at(1, 3.0)}
    mesh = grid(steps(0, 1, 3), steps(0, 3, 7), ends, seam=1.0)
    heads = [Head("base", 2.0, presses=False), Head("top", 4.0)]
    flow = steady_flow(mesh, water(9.81, {"below": 0.5, "above": 4.0}, heads))
    assert flow.discharges["top"] == pytest.approx(2.0 / (1.0 / 0.5 + 2.0 / 4.0), rel=1e-10)
    seam = np.isclose(flow.points[:, 1], 1.0)
    assert seam.sum() == 3  # coinciding vertices of both bodies are one
    assert flow.heads[seam] == pytest.approx(2.0 + 0.8 * 2.0, rel=1e-10)


def test_anisotropic_ground_is_scaled_isotropic_ground() -> None:
    sides = {"left": at(0, 0.0), "right": at(0, 4.0)}
    wide = grid(steps(0, 4, 13), steps(0, 3, 13), sides)
    narrow = grid(steps(0, 2, 13), steps(0, 3, 13), sides | {"right": at(0, 2.0)})
    heads = [Head("left", 3.0), Head("right", 1.0)]
    given = steady_flow(wide, water(9.81, {"ground": [4.0, 1.0]}, heads))
    scaled = steady_flow(narrow, water(9.81, {"ground": 1.0}, heads))
    assert given.discharges["left"] == pytest.approx(2.0 * scaled.discharges["left"], rel=1e-9)


@pytest.mark.mpi2
def test_space_is_as_the_plane() -> None:
    names = {"left": (0, 0.0), "right": (0, 5.0)}
    boxes = [Box("ground", (0.0, 0.0, 0.0), (5.0, 1.0, 10.0), (6, 1, 12))]
    surfaces = [
        Surface(name, ("ground",), at(axis, value)) for name, (axis, value) in names.items()
    ]
    mesh = structured_mesh(COMM, boxes, surfaces)
    heads = [Head("left", 10.0), Head("right", 2.5)]
    flow = steady_flow(mesh, water(9.81, {"ground": 1.0}, heads, up="z"))
    assert flow.discharges["left"] == pytest.approx((10.0**2 - 2.5**2) / 10.0, rel=5e-3)
    assert flow.imbalance < 1e-10


@pytest.fixture
def options() -> Iterator[PETSc.Options]:
    """Return PETSc's options, and remove the test's options afterwards."""
    given = PETSc.Options()
    before = set(given.getAll())
    yield given
    for name in set(given.getAll()) - before:
        given.delValue(name)


@pytest.mark.mpi2
def test_options_of_the_user_are_heeded(options: PETSc.Options) -> None:
    full = dam(5.0, 10.0, 2.0, 10, 20)
    name = "perfplast_seepage_snes_rtol"
    options[name] = 1e-2
    check_options({name: options[name]})  # with options of solvers that are not yet deleted
    assert dam(5.0, 10.0, 2.0, 10, 20).iterations < full.iterations
    options["perfplast_seepage_snes_max_it"] = 2
    with pytest.raises(InputError, match=r"SNES-VI did not .* in 2 steps"):
        dam(5.0, 10.0, 2.0, 10, 20)
    for name, value, words in (
        ("snes_type", "newtonls", "flows of water need vinewtonrsls"),
        ("snes_mx_it", "3", "unknown"),
    ):
        with pytest.raises(InputError, match=words):
            check_options({f"perfplast_seepage_{name}": value})


@pytest.mark.parametrize("seed", range(12))
def test_random_ground(seed: int) -> None:
    """Two anisotropic layers of random conductivity lose no water, and gain none from air."""
    random = np.random.default_rng(seed)
    rows = int(random.integers(8, 24))
    y = steps(0, 10, rows)
    low, high = sorted(float(one) for one in random.choice(y[1:], 2, replace=False))
    width = float(random.uniform(2, 30))
    sides = {"left": at(0, 0.0), "right": at(0, width), "top": at(1, 10.0)}
    mesh = grid(steps(0, width, int(random.integers(8, 24))), y, sides, seam=float(y[rows // 2]))
    heads = [Head("left", high), Head("right", low)]
    each = [[float(k) for k in 10.0 ** random.uniform(-6, -2, 2)] for _ in range(2)]
    ground = water(9.81, {"below": each[0], "above": each[1]}, heads, outlet=["top"])
    flow = steady_flow(mesh, ground)
    assert flow.discharges["left"] > 0
    assert flow.imbalance < 1e-8
    largest = np.abs(flow.outflow).max()
    air = np.isclose(flow.points[:, 1], 10.0) & (flow.points[:, 0] > 0)
    assert (flow.outflow[air] > -1e-9 * largest).all()
    assert (flow.pressure_heads >= 0).all()
    wet = flow.pressure_heads > 1e-6
    assert flow.heads[wet].max() < high + 1e-6
    assert (flow.saturation[wet] == 1.0).all()


def small(**given: object) -> SteadyFlow:
    """Return the flow through a square of side 4, with some changed arguments."""
    names = ("left", "right", "base", "top")
    sides = {name: at(i // 2, 4.0 * (i % 2)) for i, name in enumerate(names)}
    mesh = grid(steps(0, 4, 5), steps(0, 4, 5), sides)
    usual = {"conductivity": {"ground": 1.0}, "head": [Head("left", 3.0), Head("right", 1.0)]}
    return steady_flow(mesh, Seepage(**{**usual, **given}, unit_weight=9.81))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"conductivity": {"clay": 1.0}}, "'clay', which is not a body"),
        ({"conductivity": {"ground": [1.0]}}, "each of the 2 directions"),
        ({"conductivity": {"ground": -1.0}}, "positive"),
        ({"conductivity": {}}, "conductivity is empty"),
        ({"head": []}, "seepage.head"),
        ({"head": [Head("left", 3.0), Head("dry", 1.0)]}, "'dry'"),
        ({"head": [Head("top", 3.0)]}, "lies below this surface"),
        ({"head": [Head("left", 2.5)]}, r"crosses a facet near \(0, 2.5\)"),
        ({"head": [Head("left", 3.0), Head("base", 1.0)]}, r"meet at \(0, 0\)"),
        (
            {"head": [Head("left", 3.0, drawdown=2.5)]},
            r"level 2.5 .* crosses a facet near \(0, 2.5\)",
        ),
        ({"up": "z"}, "not a coordinate in 2"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        small(**given)


def test_drawdowns_that_cannot_be() -> None:
    with pytest.raises(InputError, match=r"drawdown = 3\.0 is not below level = 3\.0"):
        Head("left", 3.0, drawdown=3.0)
    with pytest.raises(InputError, match="water that presses"):
        Head("left", 3.0, presses=False, drawdown=1.0)


def test_ground_without_a_level_is_refused() -> None:
    apart = grid(steps(0, 1, 3), steps(0, 3, 7), {"base": at(1, 0.0)}, seam=1.0)
    above = np.unique(geometry_dofmap(apart.mesh)[apart.cells("above")])
    apart.mesh.geometry.x[above, 1] += 0.5
    heads = [Head("base", 2.0, presses=False)]
    with pytest.raises(InputError, match="with a level and to no outlet"):
        steady_flow(apart, water(9.81, {"below": 1.0, "above": 1.0}, heads))


@pytest.mark.mpi2
def test_pressure_on_meshes_that_divide_the_cells() -> None:
    sides = {"left": at(0, 0.0), "right": at(0, 4.0)}
    mesh = grid(steps(0, 4, 7), steps(0, 3, 6), sides)
    flow = steady_flow(mesh, water(10.0, {"ground": 1.0}, [Head("left", 3.0), Head("right", 0.6)]))
    field = flow.pressure_in("ground")

    def whole(of: TaggedMesh) -> float:
        cells, points = corners(of.mesh)
        x = points[cells]
        area = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 2
        return float(COMM.allreduce(float(area @ field.at_corners(x).mean(axis=1))))

    before = whole(mesh)
    marked = np.arange(len(corners(mesh.mesh)[0])) % 3 == 0
    finer = refine(mesh, marked).tagged_mesh
    assert number_of_cells(finer) > 1.3 * number_of_cells(mesh)
    assert whole(finer) == pytest.approx(before, rel=1e-12)
    with pytest.raises(InputError, match="no value at"):
        field.at_corners(np.array([[[9.0, 0.0], [9.5, 0.0], [9.0, 0.5]]]))


@pytest.mark.mpi2
def test_bounds_with_water_at_rest_are_those_of_its_formula() -> None:
    """A block of sand and clay, wet up to 2.5, is pushed from above."""
    sides = {"left": at(0, 0.0), "right": at(0, 2.0), "base": at(1, 0.0), "top": at(1, 3.0)}
    mesh = grid(steps(0, 2, 5), steps(0, 3, 7), sides)
    heads = [Head("left", 2.5), Head("right", 2.5)]
    flow = steady_flow(mesh, water(9.81, {"ground": 1.0}, heads))
    ground = MohrCoulomb(1e4, 0.3, cohesion=20.0, friction_angle=20.0)

    def bounds(pores: PorePressure) -> list[float | None]:
        push = Pressure("top", 1.0)
        problem = Problem(mesh, {"ground": ground}, [Support("base")], [push, pores])
        found = limit_bounds(problem, rtol=1e-9)
        return [found.lower.value, found.upper.value]

    formula = bounds(PorePressure("ground", "9.81*maximum(2.5 - y, 0)"))
    assert bounds(FieldPores("ground", "the flow", field=flow.pressure_in("ground"))) == (
        pytest.approx(formula, rel=1e-6)
    )
    dry = bounds(PorePressure("ground", 0.0))
    assert formula[1] < 0.99 * dry[0]  # type: ignore[operator]
