"""Linear solvers: multigrid against a factorisation, its coarse spaces, and what users choose."""

from collections.abc import Callable, Iterator

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Newton,
    NewtonOptions,
    Problem,
    Support,
    Traction,
    punch,
    two_blocks,
)
from perfplast_fenicsx.contact.obstacles import Plane
from perfplast_fenicsx.problem.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.stiffness import Stiffness
from perfplast_fenicsx.solvers.linear import linear_solver as linear
from perfplast_fenicsx.solvers.linear import smoothed_aggregation as coarse
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.linear.petsc_options import default
from perfplast_fenicsx.solvers.linear.smoothed_aggregation import CoarseSpaces
from perfplast_fenicsx.solvers.load_stepping import load_path
from tests.models import STEEL, l_plate_problem, punch_problem, stack_problem, two_blocks_problem

TIGHT = NewtonOptions(tolerance=1e-10)


@pytest.fixture
def multigrid() -> Iterator[None]:
    """Coarse levels for problems that would be factorised."""
    options = PETSc.Options()
    given = {"perfplast_pc_type": "mg", "perfplast_coarse_pc_gamg_coarse_eq_limit": "60"}
    for key, value in given.items():
        options[key] = value
    yield
    for key in given:
        options.delValue(key)


def corner_problem() -> Problem:
    """A punch on a block, both in a corner of two rigid planes: its edge has two normals a node."""
    return Problem(
        punch(MPI.COMM_WORLD, 4),
        {"base": STEEL, "punch": STEEL},
        [Support("y0", "y")],
        [Traction("top", (-0.2, 0.0, -1.0)), BodyForce("base", (-0.1, 0.0, 0.0))],
        [Contact("punch_bottom", "base_top", 0.0)],
        [
            Plane("x0", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
            Plane("bottom", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ],
    )


def quadratic_problem() -> Problem:
    return Problem(
        two_blocks(MPI.COMM_WORLD, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
        degree=2,
    )


@pytest.mark.mpi3
@pytest.mark.parametrize(
    ("make", "levels", "most"),
    [
        (lambda: two_blocks_problem(4), (60.0, 120.0), 20),
        (lambda: two_blocks_problem(4, gap="0.001 + 0.002*x"), (60.0,), 20),
        (lambda: punch_problem(4), (450.0,), 25),
        (lambda: stack_problem(4), (200.0,), 20),
        (lambda: l_plate_problem(1), (0.9,), 45),
        (corner_problem, (200.0, 400.0), 30),
        (quadratic_problem, (60.0, 80.0), 45),
    ],
    ids=["two blocks", "gap", "punch", "held by contact", "plate", "two normals", "quadratic"],
)
def test_multigrid_gives_what_a_factorisation_gives(
    multigrid: None, make: Callable[[], Problem], levels: tuple[float, ...], most: int
) -> None:
    problem = make()
    iterative = Newton(problem, TIGHT)
    assert iterative.linear.name == "CG + smoothed aggregation"
    PETSc.Options().delValue("perfplast_pc_type")
    direct = Newton(problem, TIGHT)
    assert direct.linear.name == "MUMPS Cholesky"
    for one, other in zip(load_path(iterative, levels), load_path(direct, levels), strict=True):
        assert one.report.converged
        assert other.report.converged
        assert one.state.alpha == pytest.approx(other.state.alpha, rel=1e-9)
        difference = one.state.u.x.petsc_vec - other.state.u.x.petsc_vec
        assert difference.norm() < 1e-8 * other.state.u.x.petsc_vec.norm()
        assert abs(one.report.duality_gap) < 1e-8
    solves, _, iterations = iterative.linear.counts()
    assert iterations / solves < most


@pytest.mark.mpi3
def test_iterations_hardly_grow_as_the_mesh_is_refined(multigrid: None) -> None:
    """All contact closed, elastic bodies, relative residual 1e-8."""
    counts = []
    for n in (4, 8):
        problem = two_blocks_problem(n)
        operator = _operator(problem)
        solver = LinearSolver(problem)
        solver.set_operator(operator)
        solver.hold(problem.basis.index)
        b = problem.create_vector()
        problem.basis.T.multTranspose(problem.loads.live, b)
        b.array[problem.basis.index] = 0
        x = b.duplicate()
        solver.solve(b, x, 1e-8)
        operator.matrix.mult(x, b)
        counts.append(solver.iterations)
    assert counts[0] <= 16
    assert counts[1] <= 20


@pytest.mark.mpi3
def test_coarse_spaces_hold_what_is_held(multigrid: None) -> None:
    problem = two_blocks_problem(4)
    operator = _operator(problem)
    spaces = CoarseSpaces(problem, operator.nodal())
    finest = spaces.interpolations[0]
    index = problem.basis.index
    before = _row_sizes(finest, index)
    pc = PETSc.PC().create(problem.comm)
    pc.setType("mg")
    pc.setMGLevels(spaces.levels)
    held = index[::2]
    operator.hold(held)
    spaces.project(operator.matrix, held, pc)
    sizes = _row_sizes(finest, index)
    assert (sizes[::2] == 0).all()
    assert np.array_equal(sizes[1::2], before[1::2])
    operator.hold(index[:0])
    spaces.project(operator.matrix, index[:0], pc)
    assert np.array_equal(_row_sizes(finest, index), before)


@pytest.mark.mpi3
@pytest.mark.parametrize("large", [10**9, 0], ids=["small", "large"])
@pytest.mark.parametrize("flow", ["none", "some"])
def test_coarse_spaces_have_the_motion_that_they_are_given(
    multigrid: None, flow: str, large: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motion of no size adds nothing."""
    monkeypatch.setattr(coarse, "LARGE", large)
    problem = two_blocks_problem(4)
    operator = _operator(problem)
    held = problem.basis.index[::3]
    operator.hold(held)
    motion = problem.create_vector()
    nodes = problem.V.tabulate_dof_coordinates()[: motion.getLocalSize() // 3]
    if flow == "some":
        motion.array[:] = np.sin(4 * nodes).ravel()
    motion.array[held] = 0.0
    spaces = CoarseSpaces(problem, operator.nodal())
    left = []
    for _ in range(3):  # the third time in the place of the second
        pc = PETSc.PC().create(problem.comm)
        pc.setType("mg")
        pc.setMGLevels(spaces.levels)
        spaces.project(operator.matrix, held, pc)
        left.append(_energy_beyond(operator.matrix, spaces.interpolations[0], motion))
        spaces.add(motion, operator.nodal)
    if flow == "some":
        assert left[1] < 0.5 * left[0]
        assert left[2] == pytest.approx(left[1], rel=1e-6)
    else:
        assert left == [0.0, 0.0, 0.0]


def _energy_beyond(A: PETSc.Mat, P: PETSc.Mat, y: PETSc.Vec) -> float:
    """Energy of what is best left of y by the columns of P."""
    coarse, image = P.createVecs()
    ksp = PETSc.KSP().create(A.comm)
    ksp.setType("cg")
    ksp.getPC().setType("jacobi")
    ksp.setTolerances(rtol=1e-12, max_it=2000)
    operator = A.PtAP(P)
    diagonal = operator.getDiagonal()
    diagonal.array[:] = diagonal.array == 0
    operator.setDiagonal(diagonal, PETSc.InsertMode.ADD_VALUES)
    ksp.setOperators(operator)
    A.mult(y, image)
    P.multTranspose(image, coarse)
    best = coarse.duplicate()
    ksp.solve(coarse, best)
    assert ksp.getConvergedReason() > 0
    P.mult(best, image)
    image.aypx(-1.0, y)
    product = image.duplicate()
    A.mult(image, product)
    return float(image.dot(product))


@pytest.mark.mpi3
def test_flow_makes_fewer_iterations_where_coarse_spaces_follow_it(
    multigrid: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """About a sixth, more or less with the partition."""
    counts, alphas = [], []
    for worth in (np.inf, 1.0):
        monkeypatch.setattr(linear, "WORTH_A_MOTION", worth)
        solver = Newton(two_blocks_problem(8), TIGHT)
        levels = list(load_path(solver, (100.0, 150.0)))
        assert all(level.report.converged for level in levels)
        alphas.append(levels[-1].report.alpha)
        counts.append(solver.linear.iterations)
    assert alphas[1] == pytest.approx(alphas[0], rel=1e-9)
    assert counts[1] < counts[0]  # by 5 to 17 %, as the mesh is partitioned


@pytest.mark.mpi3
def test_a_set_up_serves_corrections_too(multigrid: None) -> None:
    """Its first solve may be one, which says nothing of what a digit costs."""
    problem = two_blocks_problem(4)
    index = problem.basis.index
    solver = LinearSolver(problem)
    solver.set_operator(_operator(problem))
    b, x = problem.create_vector(), problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, b)
    b.array[index] = 0
    for held in (index, index[1:], index):
        solver.hold(held)
        solver.solve(b, x, 1e-3, correction=True)
    assert (solver.solves, solver.setups) == (3, 1)


def _operator(problem: Problem) -> ContactOperator:
    fields = QuadratureFields(problem)
    fields.update()
    return ContactOperator(problem, Stiffness(fields).assemble(1.0))


def _row_sizes(A: PETSc.Mat, local: np.ndarray) -> np.ndarray:
    first = A.getOwnershipRange()[0]
    return np.array([np.abs(A.getRow(first + i)[1]).sum() for i in local])


@pytest.mark.mpi3
def test_products_with_the_operator_are_those_with_its_matrix() -> None:
    problem = two_blocks_problem(3)
    operator = _operator(problem)
    operator.hold(problem.basis.index[:0])
    y, r, f, image = (problem.create_vector() for _ in range(4))
    y.array[:] = np.sin(np.arange(*y.getOwnershipRange()))
    r.array[:] = np.cos(np.arange(*y.getOwnershipRange()))
    operator.mult_add(y, r, f)
    operator.matrix.multAdd(y, r, image)
    image.axpy(-1.0, f)
    assert image.norm() < 1e-12 * f.norm()


def test_a_small_problem_has_one_level() -> None:
    options = PETSc.Options()
    options["perfplast_pc_type"] = "mg"
    try:
        level = Newton(two_blocks_problem(2)).solve(60.0)
    finally:
        options.delValue("perfplast_pc_type")
    assert level.report.converged


def test_a_default_option_gives_way_to_the_users_and_is_gone_afterwards() -> None:
    options = PETSc.Options()
    with default("matptap_via", "allatonce"):
        assert options.getString("matptap_via") == "allatonce"
    assert not options.hasName("matptap_via")
    options["matptap_via"] = "scalable"
    with default("matptap_via", "allatonce"):
        assert options.getString("matptap_via") == "scalable"
    assert options.getString("matptap_via") == "scalable"
    options.delValue("matptap_via")


@pytest.mark.mpi3
@pytest.mark.parametrize(
    "make",
    [lambda: two_blocks_problem(3), corner_problem, quadratic_problem],
    ids=["two blocks", "two normals", "quadratic"],
)
def test_the_matrix_is_that_of_the_whole_product(make: Callable[[], Problem]) -> None:
    """Only rows near contact are formed anew; held pairs come and go."""
    problem = make()
    operator = _operator(problem)
    index, T = problem.basis.index, problem.basis.T
    for held in (index[::2], index, index[:0]):
        operator.hold(held)
    whole = operator.nodal().PtAP(T)
    difference = operator.matrix.copy()
    difference.axpy(-1.0, whole)
    assert difference.norm() < 1e-14 * whole.norm()
