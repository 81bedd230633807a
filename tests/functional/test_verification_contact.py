"""Test quadratic elements in contact, obstacles and measured gaps."""

import itertools
import math
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest

from meshes.contact_patch import write_contact_patch
from meshes.corner_seat import write_corner_seat
from meshes.hertz_line import write_hertz_line
from meshes.hertz_sphere import write_hertz_sphere
from meshes.thick_sphere import OUTER as SPHERE
from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import OUTER as TUBE
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BorderedNewton,
    Contact,
    Cylinder,
    Elastic,
    Newton,
    NewtonOptions,
    Plane,
    Pressure,
    Problem,
    Sphere,
    State,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    WorkNewton,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.solvers.active_set.contact_qp import closed_pairs
from tests.checks import assert_solved, largest
from tests.models import STEEL, Read

SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
FINE = 1e-11

# --- the four algorithms ----------------------------------------------------------------------


def bent_blocks(comm: MPI.Intracomm) -> Problem:
    """In 3D: two stacked cantilevers, which separate near their supports."""
    return Problem(
        two_blocks(comm, 2),
        dict.fromkeys(("lower", "upper"), STEEL),
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )


def pressed_cylinder(tagged_mesh: TaggedMesh) -> Problem:
    """In plane strain: a cylinder on a rigid plane; at first they touch at one node."""
    return Problem(
        tagged_mesh,
        {"upper": VonMises(2e5, 0.3, 400.0)},
        [Support("x0", "x")],
        [Pressure("top", 1.0)],
        obstacles=[Plane("upper_arc", (0.0, 0.0), (0.0, 1.0))],
        degree=2,
    )


def assert_algorithms_agree(problem: Problem, zeta: float) -> None:
    """All algorithms find the same stress and work; those with prescribed work start nearby."""
    options = NewtonOptions(tolerance=FINE)
    newton = Newton(problem, options)
    start = newton.solve(0.97 * zeta)
    level = newton.solve(zeta)
    assert_solved(level)
    assert 0 < level.report.active_contacts < problem.num_pairs
    assert level.report.plastic_cells > 0
    alpha = level.report.alpha
    others = [
        WorkNewton(problem, options).solve(alpha, start.state),
        BorderedNewton(problem, options).solve(alpha, start.state),
        AugmentedLagrangian(problem, AugmentedLagrangianOptions(tolerance=FINE)).solve(zeta),
    ]
    scale = largest(problem.comm, level.stress.x.array)
    for other in others:
        assert_solved(other)
        assert other.report.alpha == pytest.approx(alpha, rel=1e-9)
        assert other.report.zeta == pytest.approx(zeta, rel=1e-9)
        change = other.stress.x.array - level.stress.x.array
        assert largest(problem.comm, change) < 1e-8 * scale


def test_all_algorithms_find_the_same_state_of_bodies_in_space(comm: MPI.Intracomm) -> None:
    assert_algorithms_agree(bent_blocks(comm), 75.0)


def test_all_algorithms_find_the_same_state_in_plane_strain(read: Read) -> None:
    tagged_mesh = read(write_hertz_line, contact_size=0.02, order=2)
    assert_algorithms_agree(pressed_cylinder(tagged_mesh), 50.0)


def assert_the_same_on_one_rank(together: Problem, alone: Problem, zeta: float) -> None:
    """Compare results on all ranks with results on one rank."""
    levels = [Newton(problem).solve(zeta) for problem in (together, alone)]
    for level in levels:
        assert_solved(level)
    reports = [level.report for level in levels]
    for name in ("alpha", "max_displacement", "plastic_fraction"):
        all_ranks, one_rank = (getattr(report, name) for report in reports)
        assert all_ranks == pytest.approx(one_rank, rel=1e-9)
    assert reports[0].contact_pairs == reports[1].contact_pairs
    fields = [OutputFields(together), OutputFields(alone)]
    peaks = []
    for recovery, level, problem in zip(fields, levels, (together, alone), strict=True):
        pressure = recovery.update(level)["contact_pressure"]
        peaks.append(largest(problem.comm, pressure.x.array))
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-7)
    assert fields[0].resultants == pytest.approx(fields[1].resultants, rel=1e-9, abs=1e-9)


@pytest.mark.mpi3
def test_bodies_in_space_on_one_rank_and_on_all(comm: MPI.Intracomm) -> None:
    assert_the_same_on_one_rank(bent_blocks(comm), bent_blocks(MPI.COMM_SELF), 75.0)


@pytest.mark.mpi2
def test_plane_strain_on_one_rank_and_on_all(read: Read, comm: MPI.Intracomm) -> None:
    def cylinder(comm: MPI.Intracomm) -> Problem:
        return pressed_cylinder(read(write_hertz_line, comm, contact_size=0.03, order=2))

    assert_the_same_on_one_rank(cylinder(comm), cylinder(MPI.COMM_SELF), 50.0)


# --- active sets ------------------------------------------------------------------------------


@pytest.mark.long(but=["exact"])
@pytest.mark.parametrize("active_set", ["adaptive", "exact"])
def test_a_uniform_pressure_leaves_nothing_at_vertices_and_is_found_soon(
    read: Read, active_set: Any
) -> None:
    """Vertices of quadratic faces carry no uniform pressure: their forces are rounding errors."""
    upper = Elastic(7e4, 0.2)
    problem = Problem(
        read(write_contact_patch, dim=3, size=0.3),
        {"lower": STEEL, "upper": upper},
        [*SYMMETRY, Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("upper_seam", "lower_seam")],
        degree=2,
    )
    newton = Newton(problem, NewtonOptions(active_set=active_set))
    state: State | None = None
    for zeta in (100.0, 300.0, 449.0):
        level = newton.solve(zeta, state)
        state = level.state
        assert_solved(level)
        assert level.report.alpha == pytest.approx(zeta * (1 / STEEL.young + 1 / upper.young))
        assert level.report.active_set_iterations <= 15
        assert level.report.complementarity == pytest.approx(0, abs=1e-12)
    pressure = OutputFields(problem).update(level)["contact_pressure"].x.array
    assert largest(problem.comm, pressure) == pytest.approx(zeta, rel=1e-9)


@pytest.mark.long
def test_divided_sphere_near_its_collapse(read: Read) -> None:
    problem = Problem(
        read(write_thick_sphere, interface=1.4, size=0.4, order=2),
        dict.fromkeys(("inner_shell", "outer_shell"), STEEL),
        [*SYMMETRY, Support("z0", "z")],
        [Pressure("inner", 1.0)],
        [Contact("inner_shell_seam", "outer_shell_seam")],
        degree=2,
    )
    newton = Newton(problem)
    limit = 2 * STEEL.yield_stress * math.log(2.0)
    state: State | None = None
    for share in (0.5, 0.9, 0.99):
        level = newton.solve(share * limit, state)
        state = level.state
        assert_solved(level)
        assert level.report.newton_iterations <= 20
        assert max(step.active_set_iterations for step in level.iterations) <= 40


@pytest.mark.long
def test_a_ball_on_a_plane_needs_few_active_sets(read: Read) -> None:
    """One node touches at first, many finally: active sets shrink ring by ring, without cycles."""
    tagged_mesh = read(write_hertz_sphere, contact_size=0.015)
    problem = Problem(
        tagged_mesh,
        {"upper": Elastic(2e5, 0.3)},
        SYMMETRY,
        [Pressure("top", 100.0)],
        obstacles=[Plane("upper_cap", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))],
    )
    assert problem.num_pairs > 150
    for active_set in ("adaptive", "exact"):
        level = Newton(problem, NewtonOptions(active_set=active_set)).solve(1.0)
        assert_solved(level)
        assert level.report.active_contacts > 20
        assert level.report.active_set_iterations <= 25


# --- obstacles --------------------------------------------------------------------------------


def blocks(comm: MPI.Intracomm, **changes: Any) -> Problem:
    """Return the upper of two stacked blocks; the whole lower block is held."""
    arguments: dict[str, Any] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [*SYMMETRY, Support("bottom"), Support("lower_top", "z")],
        "loads": [Pressure("top", 1.0)],
    }
    return Problem(stacked_blocks(comm, 2), **(arguments | changes))


@pytest.mark.parametrize("degree", [1, 2])
def test_a_plane_is_a_flat_body_that_does_not_move(comm: MPI.Intracomm, degree: int) -> None:
    """A cantilever is bent against the plane; a part of the contact opens."""
    arguments: dict[str, Any] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [Support("left"), Support("lower_top", "z"), Support("lower_top", "y")],
        "loads": [Traction("top", (0.0, 0.0, -1.0))],
        "degree": degree,
    }
    tagged_mesh = two_blocks(comm, 2)
    contacts = [Contact("upper_bottom", "lower_top")]
    plane = Plane("upper_bottom", (0.0, 0.0, 1.0), (0.0, 0.0, 3.0))
    body = Problem(tagged_mesh, contacts=contacts, **arguments)
    rigid = Problem(tagged_mesh, obstacles=[plane], **arguments)
    held, on_plane = (Newton(problem).solve(150.0) for problem in (body, rigid))
    assert_solved(held)
    assert_solved(on_plane)
    assert 0 < on_plane.report.active_contacts < rigid.num_pairs
    assert on_plane.report.alpha == pytest.approx(held.report.alpha, rel=1e-10)
    difference = on_plane.state.u.x.array - held.state.u.x.array
    assert largest(comm, difference) < 1e-9 * held.report.max_displacement


@pytest.mark.long
def test_a_stiff_body_is_nearly_a_plane(comm: MPI.Intracomm) -> None:
    stiff = {"lower": Elastic(STEEL.young * 1e6, 0.0), "upper": STEEL}
    contact = blocks(
        comm,
        materials=stiff,
        supports=[*SYMMETRY, Support("bottom")],
        contacts=[Contact("upper_bottom", "lower_top")],
        degree=2,
    )
    plane = Plane("upper_bottom", (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    rigid = blocks(comm, obstacles=[plane], degree=2)
    on_body, on_plane = (Newton(problem).solve(100.0) for problem in (contact, rigid))
    assert on_body.report.alpha == pytest.approx(on_plane.report.alpha, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", [Newton, WorkNewton, AugmentedLagrangian])
def test_a_body_that_hovers_falls_on_the_obstacle_that_alone_holds_it(
    comm: MPI.Intracomm, method: Any, degree: int
) -> None:
    distance = 0.03
    plane = Plane("upper_bottom", (0.0, 0.0, 1.0 - distance), (0.0, 0.0, 1.0))
    problem = blocks(comm, obstacles=[plane], degree=degree)
    zeta = 100.0
    alpha = distance + zeta / STEEL.young
    level = method(problem).solve(alpha if method.prescribes is Prescribed.WORK else zeta)
    assert_solved(level)
    assert level.report.zeta == pytest.approx(zeta, rel=1e-7)
    assert level.report.alpha == pytest.approx(alpha, rel=1e-9)
    recovery = OutputFields(problem)
    recovery.update(level)
    assert recovery.resultants == pytest.approx(np.array([[0.0, 0.0, zeta]]), rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_body_pulled_off_its_obstacle_has_no_equilibrium(
    comm: MPI.Intracomm, degree: int
) -> None:
    plane = Plane("upper_bottom", (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    problem = blocks(comm, loads=[Pressure("top", -1.0)], obstacles=[plane], degree=degree)
    for method in (Newton, AugmentedLagrangian):
        report = method(problem).solve(1.0).report
        assert not report.converged
        assert "lose all contact" in report.reason or "no equilibrium" in report.reason


@pytest.mark.long(but=["1"])
@pytest.mark.parametrize("degree", [1, 2])
def test_tube_in_a_rigid_round_hole(read: Read, degree: int) -> None:
    """Lamé's solution with u(b) = 0 is exact."""
    material = Elastic(70e3, 0.3)
    nu, a, b = material.poisson, 1.0, TUBE
    A = -1 / (1 + (1 - 2 * nu) * b**2 / a**2)  # σ_r = A − B/r², B = −(1 − 2ν)Ab²
    inner = (1 + nu) / material.young * (1 - 2 * nu) * A * (a - b**2 / a)
    problem = Problem(
        read(write_thick_tube, size=0.05, order=degree),
        {"tube": material},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        obstacles=[Sphere("outer", (0.0, 0.0), TUBE, hollow=True)],
        degree=degree,
    )
    level = Newton(problem).solve(10.0)
    assert_solved(level)
    error = 1e-4 if degree == 2 else 2e-2
    assert level.report.alpha == pytest.approx(10 * math.pi / 2 * a * inner, rel=error)
    recovery = OutputFields(problem)
    recovery.update(level)
    force = -10 * (2 - 2 * nu) * -A * b  # force on a quarter of the hole, along each axis
    assert recovery.resultants == pytest.approx(np.array([[force, force]]), rel=error)


@pytest.mark.long
def test_shell_in_a_hollow_sphere(read: Read) -> None:
    """Lamé's solution with u(b) = 0; only symmetry and the obstacle hold it along the axes."""
    material = Elastic(70e3, 0.3)
    bulk, shear, a, b = material.bulk, material.shear, 1.0, SPHERE
    D = 1 / (4 * shear / a**3 + 3 * bulk / b**3)  # u = D (1/r² − r/b³), σ_r(a) = −1
    problem = Problem(
        read(write_thick_sphere, size=0.25, order=2),
        {"shell": material},
        [*SYMMETRY, Support("z0", "z")],
        [Pressure("inner", 1.0)],
        obstacles=[Sphere("outer", (0.0, 0.0, 0.0), SPHERE, hollow=True)],
        degree=2,
    )
    level = Newton(problem).solve(1.0)
    assert_solved(level)
    work = math.pi / 2 * a**2 * D * (1 / a**2 - a / b**3)
    assert level.report.alpha == pytest.approx(work, rel=2e-3)
    pressure = D / b**3 * (3 * bulk + 4 * shear)
    recovery = OutputFields(problem)
    recovery.update(level)
    force = -pressure * math.pi / 4 * b**2
    assert recovery.resultants == pytest.approx(np.full((1, 3), force), rel=2e-3)


@pytest.mark.long
def test_ball_in_a_hollow_sphere_that_is_larger(read: Read) -> None:
    """The ball touches at one point, and only this point holds it along z."""
    problem = Problem(
        read(write_hertz_sphere, contact_size=0.04, order=2),
        {"upper": Elastic(2e5, 0.3)},
        SYMMETRY,
        [Pressure("top", 1.0)],
        obstacles=[Sphere("upper_cap", (0.0, 0.0, 1.1), 1.1, hollow=True)],
        degree=2,
    )
    level = Newton(problem).solve(50.0)
    assert_solved(level)
    assert 0 < level.report.active_contacts < problem.num_pairs
    recovery = OutputFields(problem)
    recovery.update(level)
    assert recovery.resultants[0, 2] == pytest.approx(50 * math.pi / 4, rel=1e-3)


def test_block_on_a_rigid_cylinder(comm: MPI.Intracomm) -> None:
    """The axis may point either way and have any length."""
    for axis in ((0.0, 2.0, 0.0), (-3.0, 0.0, 0.0)):
        roll = Cylinder("upper_bottom", (0.0, 0.0, -3.0), axis, 4.0)
        problem = blocks(comm, obstacles=[roll], degree=2)
        level = Newton(problem).solve(100.0)
        assert_solved(level)
        assert 0 < level.report.active_contacts < problem.num_pairs
        recovery = OutputFields(problem)
        recovery.update(level)
        assert recovery.resultants[0, 2] == pytest.approx(100.0, rel=1e-9)
        across = int(np.flatnonzero(axis)[0])
        assert abs(recovery.resultants[0, across]) < 1e-12


@pytest.mark.long
def test_two_planes_hold_a_block_at_the_edge_they_share(read: Read) -> None:
    """Every node has two conditions; at nodes on the edge both are closed."""
    planes = [Plane("block_corner", (0.0, 0.0, 0.0), n) for n in ((1.0, 0, 0), (0, 1.0, 0))]
    problem = Problem(
        read(write_corner_seat, dim=3, size=0.5),
        {"block": STEEL, "seat": STEEL},
        [Support("z0", "z"), Support("seat_bottom"), Support("seat_left")],
        [Pressure("top", 1.0), Pressure("right", 0.5)],
        obstacles=planes,
        degree=2,
    )
    rows = problem.constraints
    touching = np.abs(rows.gap) < 1e-12
    x = problem.V.tabulate_dof_coordinates()[rows.host]
    on_edge = np.linalg.norm(x[:, :2], axis=1) < 1e-12
    assert touching[on_edge].all()
    edge, all_touching = problem.comm.allreduce(np.array([on_edge.sum(), touching.sum()]))
    assert 0 < edge < problem.num_pairs
    assert 2 * (all_touching - edge) == problem.num_pairs - edge  # the other nodes touch one plane
    level = Newton(problem).solve(100.0)
    assert_solved(level)
    exact = 100 * (1 + 0.25 - STEEL.poisson) / STEEL.young
    assert level.report.alpha == pytest.approx(exact, rel=1e-10)


# --- dense programs ---------------------------------------------------------------------------


def brute_force(S: npt.NDArray[np.float64], g: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return where z = 0, from all possible sets."""
    n = len(g)
    best, closed = np.inf, np.zeros(n, dtype=bool)
    for flags in itertools.product((False, True), repeat=n):
        held = np.array(flags)
        z = np.zeros(n)
        if not held.all():
            z[~held] = np.linalg.solve(S[np.ix_(~held, ~held)], g[~held])
        value = z @ S @ z / 2 - g @ z
        if (z >= 0).all() and value < best:
            best, closed = value, held
    return closed


@pytest.mark.parametrize("n", [1, 2, 3, 5, 7])
def test_closed_pairs_are_those_of_the_best_of_all_sets(n: int) -> None:
    generator = np.random.default_rng(n)
    for _ in range(20):
        R = generator.normal(size=(n, n + 2))
        scale = 10.0 ** generator.uniform(-3, 3, size=n)
        S = scale[:, None] * (R @ R.T) * scale
        g = scale * generator.normal(size=n)
        assert (closed_pairs(S, g) == brute_force(S, g)).all()


def test_closed_pairs_of_extreme_programs() -> None:
    S = np.array([[2.0, 1.0], [1.0, 2.0]])
    assert closed_pairs(S, np.array([-1.0, -2.0])).all()
    assert not closed_pairs(S, np.array([1.0, 1.0])).any()
    assert closed_pairs(S, np.array([4.0, 1.0])).tolist() == [False, True]
    assert closed_pairs(S, np.array([-1.0, 4.0])).tolist() == [True, False]
    # a motion without energy, like that of a body without support: rounding must not matter
    assert closed_pairs(np.ones((2, 2)), np.array([-1.0, 1.0])).tolist() == [True, False]


# --- corners ----------------------------------------------------------------------------------


@pytest.mark.parametrize("active_set", ["adaptive", "exact"])
def test_a_block_that_slides_along_a_corner_needs_few_solves(read: Read, active_set: str) -> None:
    """The solver selects pairs before it projects them, else sets cycle (limit 50.07)."""
    flat = (0.0, 0.0, 0.0)
    problem = Problem(
        read(write_corner_seat, dim=3, size=0.4),
        dict.fromkeys(("block", "seat"), VonMises(young=2e5, poisson=0.3, yield_stress=240.0)),
        [Support("seat_bottom"), Support("seat_left"), Support("z0", "z")],
        [Traction("top", (-3.0, -1.0, 0.0))],
        obstacles=[
            Plane("block_corner", flat, (1.0, 0.0, 0.0)),
            Plane("block_corner", flat, (0.0, 1.0, 0.0)),
        ],
        degree=2,
    )
    level = Newton(problem, NewtonOptions(active_set=active_set)).solve(45.0)  # type: ignore[arg-type]
    assert_solved(level)
    assert level.report.linear_solves < 60
    assert max(step.active_set_iterations for step in level.iterations) < 20
