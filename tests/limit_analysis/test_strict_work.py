"""Test that upper bounds are strict: work between points, contact between nodes, and messages."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    InputError,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis import (
    Scope,
    interior_point,
    limit_bounds,
    strict_upper_bound,
    without_entering,
)
from perfplast_fenicsx.limit_analysis.facets.entering import (
    entered_share,
    entering_between_nodes,
)
from perfplast_fenicsx.limit_analysis.velocity.cell_dissipation import (
    composite_vertex_rule,
    mechanism_rates,
    missing_growth,
)
from perfplast_fenicsx.limit_analysis.velocity.strict_work import (
    let_dilate,
)
from perfplast_fenicsx.materials import deviator
from perfplast_fenicsx.problem import Integral
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_interior_point import BLOCK, COMM, SOIL, K, footing, made
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import STEEL, l_plate_problem, touching_blocks


def blocks_in_space() -> Problem:
    """Return two stacked quadratic cantilevers."""
    return Problem(
        two_blocks(COMM, 3),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )


def work(problem: Problem, v: fem.Function, radius: float) -> float:
    """Return the plastic work of a velocity, by a rule of degree 20, over the work of the loads."""
    d = deviator(problem.kinematics.strain(v))
    dx = ufl.Measure("dx", problem.tagged_mesh.mesh, metadata={"quadrature_degree": 20})
    dissipation = Integral(problem.comm, radius * ufl.sqrt(ufl.dot(d, d)) * dx)()
    return dissipation / problem.loads.alpha(v.x.petsc_vec)


def compressed(where: str) -> Problem:
    """Return ground between smooth supports that is compressed along its last axis."""
    tagged_mesh = blocks_apart(COMM, [1, 1, 1], [1, 1, 1])
    contacts = [Contact("upper_bottom", "lower_top")]
    held = {"bottom": "z", "x0": "x", "upper_x0": "x", "y0": "y", "upper_y0": "y"}
    loaded = ["top"]
    if where != "space":
        names = {"side": lambda x: x[0] < 1e-9, "top": lambda x: x[1] > 1 - 1e-9}
        names |= {"bottom": lambda x: x[1] < 1e-9, "right": lambda x: x[0] > 1 - 1e-9}
        every = {"ground": lambda x: x[1] > -1}
        tagged_mesh = rectangle((2, 2), (1.0, 1.0), every, names, comm=COMM)
        contacts, held = [], {"side": "x", "bottom": "y"}
        if where == "between platens":
            held, loaded = {"bottom": "y", "top": "y"}, ["side", "right"]
    ground = MohrCoulomb(1e4, 0.3, 1.0, 30.0)
    return Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, ground),
        [Support(name, along) for name, along in held.items()],
        [Pressure(name, 1.0) for name in loaded],
        contacts,
        degree=2,
    )


@pytest.mark.parametrize("where", ["plane", "space", "between platens"])
def test_ground_that_dilates_too_little_by_rounding(where: str) -> None:
    """The smallest added motion gives enough dilation, and supports and contact still hold."""
    problem = compressed(where)
    steep = math.tan(math.radians(60.0)) ** 2 * (1 - 1e-11)  # lateral expansion per compression
    sheared = math.tan(math.radians(30.0)) * (1 - 1e-11)  # expansion between platens per shear

    def velocity(x: Floats) -> Floats:
        if where == "between platens":
            return np.array([sheared * x[0] + x[1], 0 * x[1]])
        aside = [steep / (len(x) - 1) * of for of in x[:-1]]
        return np.array([*aside, -x[-1]])

    gdim, v = problem.bodies.gdim, fem.Function(problem.V)
    v.interpolate(lambda x: velocity(x[:gdim]))
    before, rates = v.x.array.copy(), mechanism_rates(problem, v)

    def missing() -> float:
        lacks = missing_growth(problem, mechanism_rates(problem, v)).max(initial=0.0)
        return COMM.allreduce(float(lacks), MPI.MAX)

    assert missing() > 1e-12
    changed = let_dilate(problem, v, rates)
    rounding = 1e-14  # of rates of size 1, and a hundredth of the growth that was missing
    assert missing() < rounding
    assert np.allclose(changed.trace, mechanism_rates(problem, v).trace, rtol=0, atol=rounding)
    most = COMM.allreduce(float(np.abs(v.x.array - before).max()), MPI.MAX)
    assert 1e-12 < most < 1e-9
    assert np.abs(v.x.array.reshape(problem.fixed.shape)[problem.fixed]).max(initial=0.0) < 1e-15
    assert entered_share(problem, v) < 1e-12


def on_a_rough_face(rough: float) -> Problem:
    """Return two blocks on an inclined face whose points have errors of the given size."""
    slope, tagged_mesh = 0.2, blocks_apart(COMM, [3, 3], [3, 3], slope=0.2, moved_by=0.0)
    x = tagged_mesh.mesh.geometry.x
    seam = np.abs(x[:, 1] - slope * (x[:, 0] - 0.5) - 1.0) < 1e-9
    x[seam, 1] += rough * np.sin(7e3 * x[seam, 0])
    weak, strong = (VonMises(2e5, 0.3, strength) for strength in (100.0, 900.0))
    return Problem(
        tagged_mesh,
        {"lower": weak, "upper": strong},
        [Support("x0", "x"), Support("upper_x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )


@pytest.mark.parametrize("rough", [3e-12, 1e-10])
def test_bodies_slide_on_a_face_whose_points_have_rounding_errors(rough: float) -> None:
    """Slip along the face penetrates some facets, and the checker corrects the mechanism."""
    even, uneven = (limit_bounds(on_a_rough_face(size)).upper for size in (0.0, rough))
    assert uneven.strict
    assert uneven.value == pytest.approx(even.value, rel=1e-9)


@pytest.mark.parametrize("tdim", [1, 2, 3])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_the_rule_is_exact_for_linear_functions(tdim: int, n: int) -> None:
    points, shares = composite_vertex_rule(tdim, n)
    assert len(points) == math.comb(n + tdim, tdim)
    assert (points >= 0).all()
    assert np.allclose(points.sum(axis=1), 1)
    assert (shares > 0).all()
    assert np.allclose(shares.sum(axis=1) @ points, 1 / (tdim + 1))
    # And for products of two linear functions: ∫ λ_i λ_j = (1 + δ_ij)/((d + 1)(d + 2)).
    assert np.allclose(shares.T @ points, (np.eye(tdim + 1) + 1) / ((tdim + 1) * (tdim + 2)))


def test_the_work_of_a_footing_from_above(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path)
    limit = interior_point(problem)
    true = work(problem, limit.mechanism, SOIL.yield_radius)
    bounds = [strict_upper_bound(problem, limit.mechanism, n) for n in (1, 2, 4, 8, 16)]
    values = [bound.value for bound in bounds]
    assert all(bound.strict and not bound.why_not for bound in bounds)
    assert values == sorted(values, key=lambda value: -(value or 0))
    assert values[-1] is not None
    assert limit.upper is not None
    assert limit.upper < true < values[-1] < 1.0005 * true  # the points do not suffice
    assert 5.17 < values[-1] / K < 5.18
    assert "of the body" in repr(bounds[-1])


def test_the_work_of_blocks_in_space() -> None:
    problem = Problem(
        stacked_blocks(COMM, 2, heights=(0.7, 1.2)),
        {"lower": BLOCK, "upper": BLOCK},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    limit = interior_point(problem)
    bound = strict_upper_bound(problem, limit.mechanism)
    assert bound.value is not None
    assert bound.value >= work(problem, limit.mechanism, BLOCK.yield_radius)
    assert bound.value >= 300 * (1 - 1e-9)


def test_linear_elements_lose_nothing() -> None:
    problem = l_plate_problem(1)
    limit = interior_point(problem)
    assert strict_upper_bound(problem, limit.mechanism).value == pytest.approx(limit.upper)


@pytest.mark.mpi3
def test_contact_that_is_entered_between_nodes_is_seen_and_mended() -> None:
    problem = blocks_in_space()
    limit = interior_point(problem)
    bound = strict_upper_bound(problem, limit.mechanism)
    assert not bound.strict
    assert bound.doubts == ("the mechanism enters contact between nodes",)
    assert "not strict" in repr(bound)
    mended = without_entering(problem)
    assert mended is not None
    found = interior_point(mended)
    strict = strict_upper_bound(problem, found.mechanism)
    assert strict.strict
    assert limit.upper is not None
    assert limit.upper < found.lower < 1.01 * limit.upper  # fewer mechanisms, a larger load


@pytest.mark.parametrize("enters", [True, False])
def test_three_nodes_that_do_not_enter_are_not_enough(enters: bool) -> None:
    """An edge with w = 0 at one end, 0 in the middle and −1 at the other end penetrates by 1/8."""
    problem = blocks_in_space()
    x = problem.V.tabulate_dof_coordinates()
    step = np.rint(6 * x[:, 0]).astype(int)  # nodes are 1/6 apart
    apart = step % 4 == 2 if enters else step
    v = fem.Function(problem.V)
    for sign in (1, -1):
        v.x.array.reshape(-1, 3)[:, 2] = sign * np.where(_of_upper(problem), apart, 0.0)
        jumps = problem.constraints.jumps(v.x.petsc_vec)
        half = 0.5  # jumps are whole numbers, up to rounding
        if problem.comm.allreduce(float(jumps.max(initial=0)), MPI.MAX) < half:
            break
    expected = ["the mechanism enters contact between nodes"] if enters else []
    assert entering_between_nodes(problem, v) == expected


def _of_upper(problem: Problem) -> np.ndarray:
    """Return the nodes of the upper block, including ghosts."""
    nodes = np.unique(problem.V.dofmap.list[problem.tagged_mesh.cells("upper")])
    flags = np.zeros(len(problem.V.tabulate_dof_coordinates()), dtype=bool)
    flags[nodes] = True
    return flags


def test_curved_cells_and_averaged_normals_are_not_enough(shared_tmp_path: Path) -> None:
    mesh = made(shared_tmp_path, write_thick_tube, size=0.1, order=2, interface=1.15)
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, VonMises(young=70e3, poisson=0.3, yield_stress=250.0)),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=2,
    )
    bound = strict_upper_bound(problem, interior_point(problem).mechanism)
    assert bound.of is Scope.MESH
    assert set(bound.why_not) == {
        "the mechanism enters contact between nodes",
        "cells are curved",
    }


def test_no_mechanism_no_bound() -> None:
    problem = l_plate_problem(1)
    bound = strict_upper_bound(problem, fem.Function(problem.V))
    assert bound.value is None
    assert not bound.strict
    assert "not admissible" in repr(bound)


def test_no_bound_beside_motions_that_grow() -> None:
    """A constant one does no work at collapse, and does not change the bound."""
    rollers = [Support("x0", "x"), Support("y0", "y")]
    growing = Support("bottom", "z", value=-0.01, constant=False)
    problem = touching_blocks(supports=[*rollers, growing])
    with pytest.raises(InputError, match="moves supports"):
        strict_upper_bound(problem, fem.Function(problem.V))
    bounds = []
    for value in (0.0, -0.01):
        problem = touching_blocks(supports=[*rollers, Support("bottom", "z", value=value)])
        bounds.append(strict_upper_bound(problem, interior_point(problem).mechanism).value)
    assert bounds[0] is not None
    assert bounds[1] == pytest.approx(bounds[0], rel=1e-6)


def test_what_supports_hold_does_not_move(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path)
    mechanism = interior_point(problem).mechanism
    assert strict_upper_bound(problem, mechanism).strict
    mechanism.x.array[0::2] += 1e-6  # all bodies, slightly to the right
    bound = strict_upper_bound(problem, mechanism)
    assert not bound.strict
    assert "not admissible" in bound.doubts[0]
