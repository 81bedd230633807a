"""Test bodies of revolution as half sections: exact solutions, certificates, forces, refusals."""

import math
from itertools import product
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.ring import write_ring
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    InitialStress,
    Newton,
    OutputFields,
    Plane,
    PorePressure,
    Pressure,
    Problem,
    Support,
    Temperature,
    Traction,
    VonMises,
    WorkNewton,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.limit_analysis.body.limit_bounds import bounds_of_mesh
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from tests.checks import assert_refused, assert_solved, largest
from tests.contact.blocks_apart import blocks_apart
from tests.models import Read
from tests.solvers.levels import TIGHT

SOFT = VonMises(young=1e5, poisson=0.3, yield_stress=300.0, expansion=1e-5)
HARD = VonMises(young=3e5, poisson=0.25, yield_stress=400.0, expansion=2e-5)
FEW, MORE = (5, 3), (7, 3)


def discs(degree: int, upper: tuple[int, int] = FEW, **about: Any) -> Problem:
    """Return two stacked solid discs, supported only at the lowest plane."""
    return Problem(
        blocks_apart(MPI.COMM_WORLD, FEW, upper).turned(),
        {"lower": SOFT, "upper": HARD},
        [Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", **about)],
        degree=degree,
    )


@pytest.mark.parametrize(
    ("degree", "upper", "hosts"),
    [(1, FEW, None), (2, FEW, None), *product((1, 2), (MORE,), ("primary", "secondary"))],
)
def test_constant_pressure_is_transmitted_to_the_axis(
    degree: int, upper: tuple[int, int], hosts: Any, comm: MPI.Intracomm
) -> None:
    problem = discs(degree, upper, hosts=hosts)
    level = Newton(problem, TIGHT).solve(100.0)
    assert_solved(level)
    x = problem.V.tabulate_dof_coordinates()
    u = level.state.u.x.array.reshape(-1, 2)
    lower = problem.bodies.of_node == problem.bodies.of_node.min()
    soft, hard = 100 / SOFT.young, 100 / HARD.young
    down = soft * np.minimum(x[:, 1], 1) + hard * np.maximum(x[:, 1] - 1, 0)
    assert largest(comm, u[:, 1] + down) < 1e-11 * soft
    inside = np.abs(x[:, 1] - 1) > 1e-6
    stretch = np.where(x[:, 1] < 1, soft * SOFT.poisson, hard * HARD.poisson) * x[:, 0]
    assert largest(comm, (u[:, 0] - stretch)[inside]) < 1e-11 * soft
    assert lower.any() or comm.size > 1
    assert np.abs(u[x[:, 0] < 1e-12, 0]).max(initial=0.0) < 1e-18
    reactions = level.report.reactions
    force = 100 * math.pi
    assert reactions["loads"] == pytest.approx([0.0, -force], abs=1e-9)
    assert reactions["support bottom"] == pytest.approx([0.0, force], abs=1e-9)
    assert reactions["contact lower_top upper_bottom"] == pytest.approx([0.0, -force], abs=1e-9)
    assert level.report.balance < 1e-14
    output = OutputFields(problem)
    pressure = output.update(level)["contact_pressure"].x.array
    if upper == FEW:  # at each node; for mortar only the mean if the other side is not flat
        assert set(np.round(np.unique(np.abs(pressure)), 6)) <= {0.0, 100.0}
    stress = output.fields["stress"].x.array.reshape(-1, 3, 3)
    assert stress == pytest.approx(np.broadcast_to(np.diag([0, -100.0, 0]), stress.shape), abs=1e-8)


@pytest.mark.mpi2("0-1")
@pytest.mark.parametrize(("seed", "degree"), list(product(range(3), (1, 2))))
def test_duality_gap_with_all_terms_at_once(seed: int, degree: int) -> None:
    """The terms are dead and live loads, moving supports, e₀, gaps of both signs, and yielding."""
    random = np.random.default_rng(seed)
    counts, apart = ((FEW, FEW), (FEW, MORE), (MORE, FEW))[seed], [0.0, 0.3, -0.2][seed]
    span = (apart, 1 + apart) if apart > 0 else (0.0, 1 + apart)
    if seed == 0:
        span = (0.0, 1.0)
    mesh = blocks_apart(MPI.COMM_WORLD, *counts, span=span).turned()
    push = random.uniform(10, 30)
    problem = Problem(
        mesh,
        {"lower": SOFT, "upper": HARD},
        [Support("bottom", "y", value=random.uniform(-1e-4, 1e-4))],
        [
            Pressure("top", f"{3 * push}*(1 - 0.9*x)"),
            BodyForce("lower", ("3*x", -5.0), constant=True),
            PorePressure("lower", "10*(1 - y)"),
        ],
        [Contact("upper_bottom", "lower_top", "1e-4*(x - 0.6)", interference=True)],
        degree=degree,
        initial=[
            Temperature("upper", "40*y - 30*x"),
            InitialStress("lower", [5.0, "-20 - 10*x", 8.0, 3.0]),
        ],
    )
    yielding = 0.8 * SOFT.yield_stress / push
    levels = [Newton(problem, TIGHT).solve(zeta) for zeta in (1.0, yielding)]
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-11
        assert level.report.balance < 1e-10
        assert level.report.max_penetration < 1e-12
    assert levels[1].report.plastic_fraction > 0 or degree == 1


@pytest.mark.serial
def test_thick_tube_between_smooth_planes_and_its_limit(read: Read) -> None:
    """Plane strain along the axis: Lamé's stresses, and p = 2/√3 σ_y ln(b/a)."""
    tube = read(write_ring, inner=1.0, outer=2.0, height=0.4, size=0.2).turned()
    supports = [Support("bottom", "y"), Support("top", "y")]
    problem = Problem(tube, {"ring": SOFT}, supports, [Pressure("inner", 1.0)], degree=2)
    p, E, nu = 10.0, SOFT.young, SOFT.poisson
    level = Newton(problem, TIGHT).solve(p)
    radius = problem.V.tabulate_dof_coordinates()[:, 0]
    u = level.state.u.x.array.reshape(-1, 2)[:, 0]

    def exact(r: np.ndarray) -> np.ndarray:
        return p / 3 * (1 + nu) / E * ((1 - 2 * nu) * r + 4 / r)

    assert largest(problem.comm, u / exact(radius) - 1) < 2e-3
    work = 2 * math.pi * 0.4 * exact(np.ones(1))[0]
    assert level.report.alpha == pytest.approx(work, rel=2e-3)
    limit = limit_load(problem, 1e-4)
    known = 2 / math.sqrt(3) * SOFT.yield_stress * math.log(2)
    assert limit.estimate == pytest.approx(known, rel=2e-3)


def test_thick_sphere(read: Read) -> None:
    """Half a shell as a quarter section has the values of a 3D octant, and Hill's load."""
    shell = read(write_thick_tube, outer=2.0, size=0.2, order=2).turned()
    problem = Problem(
        shell, {"tube": SOFT}, [Support("y0", "y")], [Pressure("inner", 1.0)], degree=2
    )
    Y, E, nu, c = SOFT.yield_stress, SOFT.young, SOFT.poisson, 1.5
    p = 2 * Y * math.log(c) + 2 / 3 * Y * (1 - (c / 2) ** 3)
    u = Y * (1 - nu) * c**3 / E - (1 - 2 * nu) * p / E
    level = WorkNewton(problem, TIGHT).solve(2 * math.pi * u)
    assert_solved(level)
    assert level.state.zeta == pytest.approx(p, rel=2e-3)
    assert level.report.reactions["loads"][1] == pytest.approx(level.state.zeta * math.pi, rel=1e-4)
    limit = limit_load(problem, 1e-4)
    assert limit.estimate == pytest.approx(2 * Y * math.log(2), rel=2e-3)


def test_press_fit_of_tubes(read: Read) -> None:
    """Radii 1, 1.5, 2.5, overlap ζ, E 2e5, ν 0.3, plane strain: Lamé gives 46.514332 for 1.5e-3."""
    tubes = read(write_ring, outer=2.5, height=0.3, interface=1.5, size=0.3).turned()
    steel = VonMises(2e5, 0.3, 1e3)
    problem = Problem(
        tubes,
        {"inner_ring": steel, "outer_ring": steel},
        [Support("bottom", "y"), Support("top", "y")],
        contacts=[Contact("inner_ring_seam", "outer_ring_seam", -1.0, True, constant=False)],
        degree=2,
    )
    forces = []
    for overlap in (0.5e-3, 1.5e-3):
        level = Newton(problem, TIGHT).solve(overlap)
        assert abs(level.report.duality_gap) < 1e-11
        force, axial = level.report.reactions["contact inner_ring_seam outer_ring_seam"]
        exact = 46.514332 / 1.5e-3 * overlap * 2 * math.pi * 1.5 * 0.3
        assert force == pytest.approx(-exact, rel=2e-3)
        assert level.report.driving_force == pytest.approx(-force, rel=1e-9)
        assert abs(axial) < 1e-9
        forces.append(force)
    assert forces[1] == pytest.approx(3 * forces[0], rel=1e-9)


def test_resultants_are_those_of_the_full_turn(read: Read) -> None:
    """Weight, and hydrostatic pressure around a ring, whose resultant is Archimedes' force."""
    ring = read(write_ring, inner=0.5, outer=1.5, height=0.8, size=0.4).turned()
    volume = math.pi * (1.5**2 - 0.5**2) * 0.8
    held = [Support("bottom", "y")]

    def forces(*loads: Any, degree: int = 2) -> dict[str, list[float]]:
        level = Newton(Problem(ring, {"ring": SOFT}, held, loads, degree=degree), TIGHT).solve(1.0)
        assert level.report.balance < 1e-12
        return dict(level.report.reactions)

    weight = forces(BodyForce("ring", (0.0, -7.0)))
    assert weight["loads"] == pytest.approx([0.0, -7 * volume], rel=1e-12, abs=1e-12)
    assert weight["support bottom"] == pytest.approx([0.0, 7 * volume], rel=1e-10, abs=1e-10)
    water = [Pressure(on, "9.81*(5 - y)") for on in ("inner", "outer", "bottom", "top")]
    for degree in (1, 2):
        lift = forces(*water, degree=degree)["loads"]
        assert lift[1] == pytest.approx(9.81 * volume, rel=1e-12)
        mean = 9.81 * (5 - 0.4) * 0.8
        assert lift[0] == pytest.approx(2 * math.pi * mean * (0.5 - 1.5), rel=1e-12)
    spin = forces(BodyForce("ring", ("100*x", 0.0)))["loads"]
    assert spin[0] == pytest.approx(2 * math.pi * 100 * (1.5**3 - 0.5**3) / 3 * 0.8, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
def test_tangent_by_finite_differences(degree: int) -> None:
    problem = discs(degree)
    fields, random = QuadratureFields(problem), np.random.default_rng(MPI.COMM_WORLD.rank)
    tangent = Stiffness(fields)
    x = problem.V.tabulate_dof_coordinates()
    base = 8e-3 * np.column_stack([x[:, 0] * np.cos(x[:, 1]), np.sin(2 * x[:, 0]) - x[:, 1]])
    direction = problem.create_vector()
    direction.array[:] = random.standard_normal(len(direction.array))
    direction.array[problem.fixed[: len(direction.array) // 2].ravel()] = 0.0

    def force(step: float) -> np.ndarray:
        fields.u.x.array[:] = base.ravel()
        fields.u.x.petsc_vec.axpy(step, direction)
        fields.u.x.scatter_forward()
        fields.update()
        return fields.assemble_force().array.copy()

    step = 1e-8
    difference = (force(step) - force(-step)) / (2 * step)
    force(0.0)
    assert fields.plastic_fraction() > 0.5
    product_ = problem.create_vector()
    tangent.assemble(0.0).mult(direction, product_)
    free = ~problem.fixed[: len(direction.array) // 2].ravel()
    wrong = largest(problem.comm, (product_.array - difference)[free])
    assert wrong < 1e-5 * largest(problem.comm, difference)


def test_limit_load_of_a_circular_footing_by_both_methods(read: Read) -> None:
    """The load lies between those of two Tresca materials: 5.69/2 and 5.69/√3 times σ_y."""
    ground = read(write_strip_footing, size=0.5).turned()
    problem = Problem(
        ground,
        {"ground": SOFT},
        [Support("side", "x"), Support("bottom")],
        [Pressure("footing", SOFT.yield_stress)],
        degree=2,
    )
    direct = limit_load(problem, 1e-3)
    assert 2.845 <= direct.lower <= direct.upper <= 3.285  # type: ignore[operator]
    path = limit_load(problem, 1e-3, WorkNewton(problem))
    assert path.levelled_off
    assert path.upper is not None
    assert path.lower <= direct.upper * (1 + 1e-9)  # type: ignore[operator]
    assert path.upper >= direct.lower * (1 - 1e-9)
    assert path.estimate == pytest.approx(direct.estimate, rel=1e-3)
    of_body = bounds_of_mesh(problem, direct)
    assert not of_body.strict
    assert "only quadratic velocities on straight cells" in of_body.in_words()
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.strict
    assert bounds.lower.value <= 3.285  # type: ignore[operator]
    assert bounds.upper.value >= 2.845  # type: ignore[operator]


def test_only_the_axis_can_be_moved_along() -> None:
    blocks = blocks_apart(MPI.COMM_WORLD, FEW, FEW).turned()

    def problem(*supports: Support, **about: Any) -> Problem:
        loads = [Traction("top", (1.0, -1.0))]
        return Problem(blocks, {"lower": SOFT, "upper": SOFT}, supports, loads, **about)

    free = ["the body 'upper' (translation along the axis) can move as a rigid body"]
    assert_refused(lambda: problem(Support("bottom", "y")), free)
    assert_refused(
        lambda: problem(Support("x0", "x", 0.1), Support("bottom", "y")), ["axis r = 0", "along x"]
    )
    pair = [Contact("lower_top", "upper_bottom")]
    ground = [Plane("bottom", (0.0, 0.0), (0.0, 1.0))]
    level = Newton(problem(contacts=pair, obstacles=ground), TIGHT).solve(10.0)
    assert_solved(level)
    assert level.report.reactions["obstacle bottom"] == pytest.approx([0.0, 10 * math.pi])
