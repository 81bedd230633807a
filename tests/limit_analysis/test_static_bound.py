"""Test lower bounds for the body: known values, exact loads, and independent checks of stresses."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import (
    CellType,
    DiagonalType,
    GhostMode,
    compute_midpoints,
    create_rectangle,
    locate_entities_boundary,
    meshtags,
)

from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    InputError,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    machine_memory,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis import (
    Scope,
    StaticBound,
    Verdict,
    interior_point,
    limit_bounds,
    strict_lower_bound,
    strict_upper_bound,
)
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import facet_type, pair_facets
from perfplast_fenicsx.problem import LoadCase
from tests.checks import assert_refused
from tests.limit_analysis.stress_checker import Checked, check_stress, opposite
from tests.limit_analysis.test_interior_point import (
    BLOCK,
    COMM,
    RIGID,
    SOIL,
    K,
    blocks,
    footing,
    made,
)
from tests.models import STEEL, punch_problem

ROUNDING = 1e-8
Where = Callable[[np.ndarray], np.ndarray]


def rectangle(
    counts: tuple[int, int],
    size: tuple[float, float],
    volumes: Mapping[str, Where],
    surfaces: Mapping[str, Where],
    shake: float = 0.0,
    comm: MPI.Intracomm = COMM,
    diagonal: DiagonalType = DiagonalType.crossed,
) -> TaggedMesh:
    """Return a rectangle of triangles with a corner at the origin, and displaced inner vertices."""
    mesh = create_rectangle(
        comm,
        [(0.0, 0.0), size],
        counts,
        CellType.triangle,
        diagonal=diagonal,
        ghost_mode=GhostMode.none,
    )
    index_map = mesh.topology.index_map(2)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    middles, values = compute_midpoints(mesh, 2, cells).T, np.zeros(len(cells), dtype=np.int32)
    for i, where in enumerate(volumes.values()):
        values[where(middles)] = i
    found = [locate_entities_boundary(mesh, 1, where) for where in surfaces.values()]
    facets = np.concatenate(found)
    tags = np.repeat(np.arange(len(found), dtype=np.int32), [len(some) for some in found])
    order = np.argsort(facets)
    tagged = TaggedMesh(
        mesh,
        meshtags(mesh, 2, cells, values),
        meshtags(mesh, 1, facets[order], tags[order]),
        {name: i for i, name in enumerate(volumes)},
        {name: i for i, name in enumerate(surfaces)},
    )
    x = mesh.geometry.x
    inside = ((x[:, :2] > 1e-9) & (x[:, :2] < np.array(size) - 1e-9)).all(axis=1)
    moved = inside & (np.abs(x[:, 1] - 1.0) > 1e-9)  # where volumes meet
    cell = min(size[0] / counts[0], size[1] / counts[1])
    angle = 1e4 * x[:, 0] + 3e3 * x[:, 1]  # equal on every rank
    x[moved, :2] += shake * cell * np.column_stack([np.sin(angle), np.cos(angle)])[moved]
    return tagged


def platens(n: int, shake: float = 0.0, comm: MPI.Intracomm = COMM, degree: int = 2) -> Problem:
    """Return a quarter of a block 4×2 between rough strong platens, n cells along its height."""
    mesh = rectangle(
        (2 * n, 3 * n // 2),
        (2.0, 1.5),
        {"block": lambda x: x[1] < 1, "platen": lambda x: x[1] > 1},
        {
            "x0": lambda x: x[0] < 1e-9,
            "y0": lambda x: x[1] < 1e-9,
            "top": lambda x: x[1] > 1.5 - 1e-9,
        },
        shake,
        comm,
    )
    supports = [Support("x0", "x"), Support("y0", "y")]
    return Problem(
        mesh, {"block": SOIL, "platen": RIGID}, supports, [Pressure("top", 1.0)], degree=2
    )


def proven(problem: Problem, found: StaticBound, force: tuple[float, ...] | None = None) -> Checked:
    """Check conditions that hold for any bound for the body, from its stress only."""
    assert found.verdict is Verdict.FOUND
    assert found.bound.strict
    assert found.bound.kind == "lower"
    assert found.certificate is not None
    assert not found.certificate.is_doubted
    assert len(found.steps) <= 16
    assert found.factorisations <= len(found.steps) + 1  # units and step 1 share one
    value = found.bound.value
    assert value is not None
    total = problem.comm.allreduce(float(found.dissipation.sum()))
    assert total == pytest.approx(value, rel=1e-4)
    assert (found.dissipation >= 0).all()
    per_volume = None if force is None else tuple(value * f for f in force)
    checked = check_stress(problem, found.stress, per_volume)
    scale = problem.comm.allreduce(float(np.abs(found.stress).max(initial=0)), MPI.MAX)
    assert checked.divergence < ROUNDING * scale
    assert checked.jump < ROUNDING * scale
    return checked


def below(deviators: Floats, radius: float) -> bool:
    """Return whether the stress is admissible everywhere."""
    return bool((deviators <= radius * (1 + 1e-12)).all())


def is_frictionless(checked: Checked, chosen: np.ndarray) -> bool:
    """Return whether only compressive normal tractions act on given facets."""
    along = np.einsum("fvi,fi->fv", checked.tractions, checked.normals)[chosen]
    shear = checked.tractions[chosen] - along[:, :, None] * checked.normals[chosen][:, None]
    scale = np.abs(along).max()
    return bool((np.abs(shear) < ROUNDING * scale).all() and (along < ROUNDING * scale).all())


@pytest.mark.long(but=["4-2.3952"])
@pytest.mark.parametrize(("n", "expected"), [(4, 2.3952), (16, 2.41855)])
def test_rough_platens(n: int, expected: float) -> None:
    problem = platens(n)
    found = strict_lower_bound(problem, 1e-5)
    checked = proven(problem, found)
    value = (found.bound.value or 0) / K
    assert value == pytest.approx(expected, abs=1e-4)
    assert value < 2.42768
    assert below(checked.deviators[_of(problem, "block")], SOIL.yield_radius)
    top = checked.normals[:, 1] > 0.9
    pressed = checked.tractions[top]
    assert np.allclose(pressed, [0, -value * K], atol=ROUNDING * K * 10)
    side = checked.normals[:, 0] > 0.9
    assert np.allclose(checked.tractions[side], 0, atol=ROUNDING * K * 10)
    assert found.bound.shown in repr(found)


def _of(problem: Problem, name: str) -> np.ndarray:
    """Return the owned cells of a volume."""
    cells = problem.tagged_mesh.cells(name)
    topology = problem.tagged_mesh.mesh.topology
    return np.asarray(cells[cells < topology.index_map(topology.dim).size_local])


@pytest.mark.parametrize("shake", [0.1, 0.2, 0.3])
def test_bounds_of_irregular_meshes_enclose_the_limit(shake: float) -> None:
    problem = platens(6, shake)
    found = strict_lower_bound(problem)
    proven(problem, found)
    limit = interior_point(problem)
    upper = strict_upper_bound(problem, limit.mechanism)
    assert upper.value is not None
    assert found.bound.value is not None
    assert found.bound.value < 2.42768 * K < upper.value
    assert upper.value < 1.05 * found.bound.value


def test_a_pressed_strip_ends_in_three_cells(shared_tmp_path: Path) -> None:
    """At the end each of the three cells has one stress, which limits the load on any mesh."""
    problem = footing(shared_tmp_path)
    found = strict_lower_bound(problem)
    assert below(proven(problem, found).deviators, SOIL.yield_radius)
    assert found.bound.value is not None
    assert 3.24 < found.bound.value / K < 2 * math.sqrt(3)


def test_a_punch_in_contact(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path, punch=True)
    found = strict_lower_bound(problem)
    checked = proven(problem, found)
    assert found.bound.value is not None
    assert 4.9 < found.bound.value / K < 2 + math.pi
    on = np.isclose(checked.x[..., 1], 0).all(axis=1) & (checked.normals[:, 1] > 0)
    on &= (checked.x[..., 0] < 1 + 1e-9).all(axis=1)
    assert is_frictionless(checked, on)
    assert np.allclose(checked.tractions[on], -opposite(checked, on), atol=ROUNDING * 10 * K)
    assert (checked.pressures(on) >= -ROUNDING * K).all()


def test_a_block_on_a_rigid_plane() -> None:
    mesh = rectangle(
        (4, 4),
        (1.0, 1.0),
        {"block": lambda x: x[1] < 2},
        {
            "x0": lambda x: x[0] < 1e-9,
            "y0": lambda x: x[1] < 1e-9,
            "top": lambda x: x[1] > 1 - 1e-9,
        },
        shake=0.2,
    )
    problem = Problem(
        mesh,
        {"block": SOIL},
        [Support("x0", "x")],
        [Pressure("top", 1.0)],
        obstacles=[Plane("y0", point=(0.0, -1.0), normal=(0.0, 2.0))],
    )
    found = strict_lower_bound(problem, 1e-5)
    checked = proven(problem, found)
    below_it = checked.normals[:, 1] < -0.9
    assert is_frictionless(checked, below_it)
    assert found.bound.value == pytest.approx(2 * K, rel=1e-4)
    assert np.allclose(checked.pressures(below_it), found.bound.value, rtol=1e-6)


def test_a_column_under_its_weight() -> None:
    """The lowest cells carry the whole weight, and at most 2k: the factor is 2k/h."""
    height, n = 2.0, 4
    mesh = rectangle(
        (n, 2 * n),
        (1.0, height),
        {"block": lambda x: x[1] < 3},
        {"x0": lambda x: x[0] < 1e-9, "y0": lambda x: x[1] < 1e-9},
    )
    supports = [Support("x0", "x"), Support("y0", "y")]
    problem = Problem(mesh, {"block": SOIL}, supports, [BodyForce("block", (0.0, -1.0))])
    found = strict_lower_bound(problem)
    assert below(proven(problem, found, (0.0, -1.0)).deviators, SOIL.yield_radius)
    assert found.bound.value is not None
    assert K < found.bound.value < 2.2 * K


def test_blocks_in_space() -> None:
    problem = blocks(BLOCK, BLOCK)
    found = strict_lower_bound(problem)
    checked = proven(problem, found)
    assert below(checked.deviators, BLOCK.yield_radius)
    assert found.bound.value == pytest.approx(300, rel=1e-4)
    seam = np.isclose(checked.x[..., 2], 0.7).all(axis=1) & (checked.normals[:, 2] > 0.9)
    assert is_frictionless(checked, seam)
    assert np.allclose(checked.tractions[seam], -opposite(checked, seam), atol=ROUNDING * 300)


@pytest.mark.long
def test_cantilevers_in_contact() -> None:
    """The contact is partly open; bounds on the same mesh enclose the limit load."""
    problem = Problem(
        two_blocks(COMM, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )
    found = strict_lower_bound(problem)
    checked = proven(problem, found)
    assert below(checked.deviators, STEEL.yield_radius)
    assert found.bound.value is not None
    assert 71 < found.bound.value < 87
    seam = np.isclose(checked.x[..., 2], 1.0).all(axis=1) & (checked.normals[:, 2] > 0.9)
    assert is_frictionless(checked, seam)
    assert np.allclose(checked.tractions[seam], -opposite(checked, seam), atol=1e-5)


@pytest.mark.mpi3("<lambda>0")
@pytest.mark.parametrize(
    "make", [lambda comm: platens(4, 0.2, comm), lambda comm: punch_problem(2, comm=comm)]
)
def test_every_number_of_ranks_finds_the_same(make: Callable[[MPI.Intracomm], Problem]) -> None:
    alone, together = strict_lower_bound(make(MPI.COMM_SELF)), strict_lower_bound(make(COMM))
    assert alone.bound.value == pytest.approx(together.bound.value, rel=1e-8)


def test_the_degree_of_displacements_does_not_matter() -> None:
    values = [strict_lower_bound(platens(2, degree=degree)).bound.value for degree in (1, 2)]
    assert values[0] == pytest.approx(values[1], rel=1e-8)


def test_nothing_can_yield() -> None:
    found = strict_lower_bound(blocks(RIGID, RIGID))
    assert found.verdict is Verdict.UNBOUNDED
    assert found.bound.value is None
    assert found.bound.of is Scope.MESH
    assert "yield stress" in found.reason


def test_loads_that_no_stress_carries() -> None:
    found = strict_lower_bound(blocks(BLOCK, BLOCK, pressure=-1.0))
    assert found.verdict is Verdict.NO_RESISTANCE


def test_shear_that_ends_in_a_corner_of_one_cell() -> None:
    """There the free side permits no shear traction."""
    mesh = quarters(COMM)
    problem = Problem(
        mesh,
        {"block": SOIL},
        [Support("bottom")],
        [Traction("top", (1.0, 0.0))],
    )
    found = strict_lower_bound(problem)
    assert found.verdict is Verdict.NO_RESISTANCE
    assert "corner" in found.reason
    assert found.bound.strict
    assert found.bound.value == 0.0
    assert not found.stress.any()


def quarters(comm: MPI.Intracomm) -> TaggedMesh:
    """Return a unit square with two triangles in each quarter."""
    return rectangle(
        (2, 2),
        (1.0, 1.0),
        {"block": lambda x: x[1] < 2},
        {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 1 - 1e-9},
        comm=comm,
        diagonal=DiagonalType.left,
    )


@pytest.mark.parametrize("most", [2, 4])
def test_an_iteration_that_ends_early_has_a_bound(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr("perfplast_fenicsx.limit_analysis.conic.interior_steps.MOST_STEPS", most)
    problem = footing(shared_tmp_path)
    found = strict_lower_bound(problem)
    assert found.verdict is Verdict.STALLED
    assert f"in {most} steps" in found.reason
    assert found.bound.strict
    assert found.certificate is not None
    assert not found.certificate.is_doubted
    assert found.bound.value is not None
    assert 0.5 < found.bound.value / K < 3.24548


def test_what_replaced_loads_are_is_not_known() -> None:
    problem = platens(2)
    live = problem.loads.live
    problem.loads = LoadCase(dead=problem.create_vector(), live=live)
    found = strict_lower_bound(problem)
    assert found.bound.value is None
    assert "were replaced" in found.bound.why_not[0]


def test_loads_that_vary_are_not_known() -> None:
    given = platens(2).given
    found = strict_lower_bound(
        Problem(
            platens(2).tagged_mesh, given.materials, given.supports, [Pressure("top", "1 + x**2")]
        )
    )
    assert found.bound.value is None
    assert found.bound.why_not == (
        "the load on 'top' is a formula that is not linear on each facet",
    )


def test_curved_cells_are_taken_as_straight(shared_tmp_path: Path) -> None:
    mesh = made(shared_tmp_path, write_thick_tube, size=0.2, order=2, interface=1.15)
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, SOIL),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=2,
    )
    found = strict_lower_bound(problem)
    assert found.certificate is not None
    assert not found.certificate.is_doubted
    assert found.bound.of is Scope.MESH
    assert found.bound.why_not == ("cells are curved",)
    assert found.bound.value is not None
    assert 0.9 < found.bound.value / (2 * K * math.log(OUTER)) < 1


@pytest.mark.parametrize("other", [False, True])
def test_facets_that_do_not_match(other: bool) -> None:
    """A square in 3D, divided along different diagonals below and above."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    below = np.array([[0, 1, 2], [0, 2, 3]])
    above = np.array([[1, 2, 3], [0, 1, 3]]) if other else below[:, ::-1]
    sides = []
    for corners, height, up in ((below, 0.0, 1.0), (above, 0.25, -1.0)):
        rows = np.zeros(2 if COMM.rank == 0 else 0, dtype=facet_type(3))
        if len(rows):
            rows["corners"] = square[corners] + [0, 0, height]
            rows["x"] = rows["corners"].mean(axis=1)
            rows["normal"] = [0, 0, up]
            rows["facet"] = rows["number"] = [4, 7]
            rows["free"] = True
        sides.append(rows)
    pairs = pair_facets(COMM, *sides)
    if other:
        assert pairs is None
        return
    assert pairs is not None
    if COMM.rank == 0:
        order = np.argsort(pairs.host)
        assert (pairs.host[order] == [4, 7]).all()
        assert (pairs.guest[order] == 9 * np.array([[4], [7]]) + [6, 3, 0]).all()
        assert (np.sort(pairs.turned) == [4, 7]).all()


def test_blocks_a_thousand_times_as_wide_as_high() -> None:
    """Rounding makes the elimination of very flat cells inexact; the bound is strict."""
    heights = (2.7e-3, 3.0e-2)
    metal = VonMises(young=1e3, poisson=0.3, yield_stress=math.sqrt(3.0))
    problem = Problem(
        stacked_blocks(COMM, 1, heights),
        {"lower": metal, "upper": metal},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0), Pressure("top", 0.04, constant=True)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    exact = math.sqrt(3.0) - 0.04
    lower = limit_bounds(problem, 1e-3).lower
    assert lower.strict
    assert lower.value is not None
    assert 0.99 * exact <= lower.value <= exact


def test_a_bound_that_does_not_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = punch_problem(2)
    monkeypatch.setattr(machine_memory, "physical_memory", lambda: 2**10)
    assert_refused(lambda: strict_lower_bound(problem), ["unknowns needs", "coarser mesh"])


@pytest.mark.parametrize("rtol", [0.0, 1.0, math.nan])
def test_a_tolerance_must_be_one(rtol: float) -> None:
    with pytest.raises(InputError, match="not between 0 and 1"):
        strict_lower_bound(punch_problem(2), rtol)


class Wind(Traction):
    """A load whose kind bounds do not support."""


def test_loads_of_unknown_kinds_are_no_tractions() -> None:
    mesh = stacked_blocks(COMM, 1)
    material = VonMises(young=1e3, poisson=0.3, yield_stress=1.0)
    supports = [Support("bottom"), Support("upper_bottom")]
    problem = Problem(
        mesh, {"lower": material, "upper": material}, supports, [Wind("top", (0, 0, -1))], degree=2
    )
    found = strict_lower_bound(problem)
    assert found.bound.value is None
    assert found.bound.why_not == ("a load is of a kind that strict bounds do not support",)
    with pytest.raises(InputError, match="is a Wind, but strict bounds accept"):
        limit_bounds(problem)
