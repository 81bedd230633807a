"""Test dead and live loads in energy, gradient, algorithms and certificate."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    BorderedNewton,
    Contact,
    InputError,
    Level,
    Newton,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    WorkNewton,
    two_blocks,
)
from perfplast_fenicsx.problem import LoadCase, certify
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.solvers.iterate import Iterate
from tests.models import PUNCH_LIMIT, STEEL, punch_problem
from tests.solvers.levels import TIGHT

ZETA = 180.0


def problem(mesh: TaggedMesh, live: float, dead: float) -> Problem:
    """Return two cantilevers under a traction on the upper one and a force in the lower one."""
    loads = [Traction("top", (0.0, 0.0, -live)), BodyForce("lower", (0.0, dead, 0.0))]
    return Problem(
        mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [load for load in loads if np.any(load.value)],
        [Contact("upper_bottom", "lower_top")],
    )


@pytest.fixture(scope="module")
def mesh() -> TaggedMesh:
    return two_blocks(MPI.COMM_WORLD, 2)


@pytest.fixture(scope="module")
def both(mesh: TaggedMesh) -> Problem:
    """Return the problem under a live traction and a dead force."""
    both = problem(mesh, 1.0, 0.0)
    both.loads = LoadCase(problem(mesh, 0.0, 60.0).loads.live, both.loads.live)
    return both


@pytest.fixture(scope="module")
def known(mesh: TaggedMesh) -> Level:
    """Return the problem under one live load that is the sum of both."""
    level = Newton(problem(mesh, ZETA, 60.0), TIGHT).solve(1.0)
    assert level.report.converged
    assert 0 < level.report.plastic_fraction < 1
    return level


def distance(one: Level, other: Level) -> float:
    u, v = (level.state.u.x.petsc_vec.copy() for level in (one, other))
    size = v.norm()
    v.axpy(-1.0, u)
    return float(v.norm() / size)


def test_loads_of_a_load_factor(both: Problem) -> None:
    total = both.loads.total(ZETA, both.create_vector())
    u = both.create_vector()
    u.setRandom()
    assert both.loads.work(u, ZETA) == pytest.approx(total.dot(u), rel=1e-12)
    assert both.loads.norm(ZETA) == pytest.approx(total.norm(), rel=1e-12)
    assert both.loads.alpha(u) == pytest.approx(both.loads.live.dot(u), rel=1e-12)
    force = total.copy()
    both.loads.subtract_from(force, ZETA)
    assert force.norm() <= 1e-14 * total.norm()
    assert both.loads.has_dead()
    assert not LoadCase(both.create_vector(), both.loads.live).has_dead()


def test_gradient_is_the_derivative_of_the_energy(both: Problem, known: Level) -> None:
    iterate = Iterate(both)
    iterate.begin(known.state)
    u, v, y = iterate.fields.u, fem.Function(both.V), both.create_vector()
    v.interpolate(lambda x: np.array([np.sin(x[0]), x[0] * x[1], np.cos(x[2]) * x[0]]))
    v.x.array[both.fixed.ravel()] = 0
    both.basis.M.mult(v.x.petsc_vec, y)
    start = u.x.array.copy()

    def energy(step: float) -> float:
        u.x.array[:] = 1.3 * start + step * v.x.array
        iterate.fields.update()
        return iterate.energy(ZETA / 2)

    h = 1e-6
    difference = (energy(h) - energy(-h)) / (2 * h)
    energy(0.0)
    assert difference == pytest.approx(iterate.gradient(ZETA / 2).dot(y), rel=1e-6)
    dead, live = (load.dot(v.x.petsc_vec) for load in (both.loads.dead, both.loads.live))
    assert min(abs(dead), abs(ZETA / 2 * live)) > 1e-3 * abs(difference), "little is tested"


@pytest.mark.mpi2("Newton")
@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian, WorkNewton, BorderedNewton])
def test_every_algorithm_finds_the_state_under_the_sum_of_both(
    both: Problem, known: Level, method: type
) -> None:
    options = (
        AugmentedLagrangianOptions(tolerance=1e-10) if method is AugmentedLagrangian else TIGHT
    )
    alpha = both.loads.alpha(known.state.u.x.petsc_vec)
    solver = method(both, options)
    level = solver.solve(ZETA if method in (Newton, AugmentedLagrangian) else alpha)
    assert level.report.converged, level.report.reason
    assert level.state.zeta == pytest.approx(ZETA, rel=1e-8)
    assert level.state.alpha == pytest.approx(alpha, rel=1e-8)
    assert distance(level, known) < 1e-7
    assert abs(level.report.duality_gap) < 1e-8
    assert level.report.equilibrium < 1e-7
    assert level.iterations[-1].energy == pytest.approx(known.iterations[-1].energy, rel=1e-8)
    forces = both.comm.allreduce(abs(level.contact_forces - known.contact_forces).max(initial=0))
    assert forces < 1e-6 * both.loads.norm(ZETA)


def test_certificate_notices_a_dead_load_that_is_left_out(both: Problem, known: Level) -> None:
    fields = QuadratureFields(both)
    fields.u.x.array[:] = known.state.u.x.array
    fields.update()
    right = certify(both, fields, ZETA)
    assert abs(right.duality_gap) < 1e-8
    dead, both.loads = both.loads.dead, LoadCase(both.create_vector(), both.loads.live)
    wrong = certify(both, fields, ZETA)
    both.loads = LoadCase(dead, both.loads.live)
    assert abs(wrong.duality_gap) > 1e-2
    assert wrong.equilibrium > 1e-2


@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian])
def test_the_limit_of_the_sum_counts(method: type[Newton | AugmentedLagrangian]) -> None:
    punch = punch_problem(4)
    dead = punch.create_vector()
    dead.axpy(0.5 * PUNCH_LIMIT, punch.loads.live)
    punch.loads = LoadCase(dead, punch.loads.live)
    solver = method(punch)
    for share, solved in ((0.0, True), (0.45, True), (0.51, False), (-0.3, True)):
        level = solver.solve(share * PUNCH_LIMIT)
        assert level.report.converged == solved, level.report.reason
        assert solved or "above" in level.report.reason


def test_first_yield_is_that_of_loads_that_all_grow(both: Problem) -> None:
    with pytest.raises(InputError, match="not a multiple of an elastic state"):
        WorkNewton(both).first_yield()
