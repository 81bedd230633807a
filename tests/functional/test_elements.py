"""Test quadratic elements and plane strain: the same code and the same certificates."""

import itertools
import json
import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Elastic,
    InputError,
    Newton,
    NewtonOptions,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    WorkNewton,
    limit_load,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from perfplast_fenicsx.solvers.iterate import Iterate
from tests.models import case_text, stack_problem, write_case

TUBE = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)
SHEAR = TUBE.yield_stress / math.sqrt(3)
BURST = 2 * SHEAR * math.log(OUTER)


def tube(
    path: Path, degree: int = 2, order: int = 2, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> Problem:
    """Return a tube in a tube; the pressure ζ acts in the inner tube."""
    file = path / f"tube{order}.msh"
    if MPI.COMM_WORLD.rank == 0 and not file.exists():
        write_thick_tube(file, size=0.1, order=order, interface=1.15)
    MPI.COMM_WORLD.barrier()
    tagged_mesh = read_gmsh(comm, file)
    return Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, TUBE),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=degree,
    )


@pytest.mark.parametrize("order", [1, 2])
def test_a_tube_in_a_tube_bursts_where_one_tube_does(shared_tmp_path: Path, order: int) -> None:
    limit = limit_load(tube(shared_tmp_path, order=order), rtol=1e-4, method="path")
    assert limit.levelled_off
    assert limit.upper is not None
    assert limit.lower <= limit.upper * (1 + 1e-9)
    assert limit.lower == pytest.approx(BURST, rel=1e-3)
    assert limit.upper == pytest.approx(BURST, rel=1e-3)
    for level in limit.levels:
        assert abs(level.report.duality_gap) < 1e-4  # the steps end at 1e-4
        assert level.report.max_penetration < 1e-12


def test_stress_out_of_the_plane(shared_tmp_path: Path) -> None:
    """In an elastic tube σ_z = ν(σ_r + σ_θ) = 2νp a²/(b² − a²) everywhere."""
    problem = tube(shared_tmp_path)
    level = Newton(problem).solve(10.0)
    stress = OutputFields(problem).update(level)["stress"].x.array.reshape(-1, 3, 3)
    expected = 2 * TUBE.poisson * 10.0 / (OUTER**2 - 1)
    assert np.allclose(stress[:, 2, 2], expected, rtol=2e-2)
    assert np.allclose(stress[:, :2, 2], 0)
    assert np.allclose(stress, stress.transpose(0, 2, 1))


def test_elastic_tube_has_its_closed_form(shared_tmp_path: Path) -> None:
    a, b, nu = 1.0, OUTER, TUBE.poisson
    inner = (1 + nu) * a * ((1 - 2 * nu) * a**2 + b**2) / (TUBE.young * (b**2 - a**2))
    level = Newton(tube(shared_tmp_path)).solve(10.0)
    assert level.report.alpha == pytest.approx(2 * math.pi * a * 10.0 * inner / 4, rel=1e-4)


def test_last_steps_converge_quadratically(shared_tmp_path: Path) -> None:
    level = Newton(tube(shared_tmp_path), NewtonOptions(tolerance=1e-12)).solve(0.97 * BURST)
    assert level.report.converged
    assert level.report.plastic_cells > 0
    sizes = [step.increment for step in level.iterations]
    before, last = next((a, b) for a, b in itertools.pairwise(sizes) if a < 1e-2 and b < 1e-4)
    assert last < 50 * before**2 or last < 1e-9, sizes


@pytest.mark.parametrize("dim", [2, 3])
def test_the_tangent_is_the_derivative_of_the_forces(shared_tmp_path: Path, dim: int) -> None:
    """Compare the tangent with finite differences at a partly plastic state."""
    problem = (
        tube(shared_tmp_path)
        if dim == 2
        else Problem(
            stacked_blocks(MPI.COMM_WORLD, 1),
            {"lower": TUBE, "upper": TUBE},
            [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
            [Pressure("top", 1.0)],
            [Contact("lower_top", "upper_bottom")],
            degree=2,
        )
    )
    iterate = Iterate(problem)
    fields, load = iterate.fields, problem.loads.live
    random = np.random.default_rng(1)
    x = problem.V.tabulate_dof_coordinates()
    fixed = problem.fixed.ravel()

    def field(seed: int, size: float) -> np.ndarray:
        """Return a smooth field plus a value that differs at each node, equal for any ranks."""
        waves = np.random.default_rng(seed).normal(size=(3, problem.V.dofmap.index_map_bs))
        values = size * np.sin(3 * x @ waves + random.random()).ravel()
        return np.where(fixed, 0.0, values)

    u, direction = field(1, 4e-3), field(2, 4e-3)
    fields.u.x.array[:] = u
    fields.update()
    share = fields.plastic_fraction()
    assert 0.1 < share < 0.95
    K = Stiffness(fields).assemble(0.0)
    v = fem.Function(problem.V)
    v.x.array[:] = direction
    predicted = load.duplicate()
    K.mult(v.x.petsc_vec, predicted)
    free = ~fixed[: predicted.getLocalSize()]
    errors = []
    for h in (1e-5, 1e-6):
        forces = []
        for sign in (1, -1):
            fields.u.x.array[:] = u + sign * h * direction
            fields.update()
            forces.append(fields.assemble_force().array.copy())
        difference = ((forces[0] - forces[1]) / (2 * h) - predicted.array)[free]
        errors.append(
            math.sqrt(problem.comm.allreduce(float(difference @ difference))) / predicted.norm()
        )
    assert min(errors) < 1e-6, errors


@pytest.mark.mpi2
def test_one_rank_and_several_agree(shared_tmp_path: Path) -> None:
    together = Newton(tube(shared_tmp_path)).solve(0.9 * BURST)
    alone = Newton(tube(shared_tmp_path, comm=MPI.COMM_SELF)).solve(0.9 * BURST)
    assert together.state.alpha == pytest.approx(alone.state.alpha, rel=1e-9)
    assert together.report.plastic_cells == alone.report.plastic_cells
    assert together.report.newton_iterations == alone.report.newton_iterations


def test_prescribed_work_gives_the_load_back(shared_tmp_path: Path) -> None:
    problem = tube(shared_tmp_path)
    by_load = Newton(problem).solve(0.95 * BURST)
    by_work = WorkNewton(problem).solve(by_load.state.alpha)
    assert by_work.state.zeta == pytest.approx(0.95 * BURST, rel=1e-7)


def test_linear_elements_evaluate_the_law_once_in_a_cell(comm: MPI.Intracomm) -> None:
    linear = stack_problem(1)
    assert linear.degree == 1
    assert by_cell(fem.Function(linear.Q)).shape[1] == 1
    quadratic = Problem(
        linear.tagged_mesh,
        {"lower": TUBE, "upper": TUBE},
        [Support("bottom"), Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    assert by_cell(fem.Function(quadratic.Q)).shape[1] == 4


@pytest.mark.parametrize("degree", [0, 3, "2", True])
def test_other_degrees_are_refused(degree: int) -> None:
    with pytest.raises(InputError, match=r"degree = .* give 1 \(linear\) or 2"):
        tagged_mesh: TaggedMesh = stacked_blocks(MPI.COMM_WORLD, 1)
        Problem(tagged_mesh, {}, degree=degree)


@pytest.mark.long
@pytest.mark.parametrize("order", [pytest.param(1, marks=pytest.mark.serial), 2])
def test_a_plane_case_from_the_command_line(
    shared_tmp_path: Path, comm: MPI.Intracomm, order: int
) -> None:
    tube(shared_tmp_path, order=order)
    text = case_text(
        {"file": f"tube{order}.msh"},
        {"inner_tube": TUBE, "outer_tube": Elastic(70e3, 0.3)},
        [Support("x0", "x"), Support("y0", "y")],
        pushed="inner",
        contacts=[Contact("inner_tube_seam", "outer_tube_seam")],
        more="[element]\ndegree = 2\n[loading]\nvalues = [40.0, 60.0]\n",
        title="A tube in a tube",
    )
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    assert [step["zeta"] for step in summary["steps"]] == [40.0, 60.0]
    for name in ("fields.vtkhdf.series", "fields/level_0002.vtkhdf", "fields.png", "path.png"):
        assert (results / name).stat().st_size > 0
