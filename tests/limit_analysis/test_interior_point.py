"""Test the interior point method: exact limit loads, independently proven bounds, and verdicts."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from meshes.platens import write_platens
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import (
    Contact,
    DruckerPrager,
    Elastic,
    InputError,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    read_gmsh,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.limit_analysis import LimitLoad, Verdict, interior_point
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.discrete import discrete_bounds
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import KinematicLoad
from perfplast_fenicsx.materials import Material, deviator, trace
from perfplast_fenicsx.problem import Integral
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.problem import variant
from tests.models import (
    PUNCH_LIMIT,
    STEEL,
    l_plate_problem,
    punch_problem,
    stack_problem,
    two_blocks_problem,
)

COMM = MPI.COMM_WORLD
SOIL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
K = SOIL.yield_stress / math.sqrt(3)
PUNCH = VonMises(young=2e5, poisson=0.3, yield_stress=PUNCH_LIMIT)
BLOCK = VonMises(young=2e5, poisson=0.3, yield_stress=300.0)
RIGID = Elastic(young=2e5, poisson=0.3)


def made(path: Path, write: Callable[..., None], **arguments: object) -> TaggedMesh:
    """Return the mesh of a generator, on all ranks."""
    file = path / "mesh.msh"
    if COMM.rank == 0:
        write(file, **arguments)
    COMM.barrier()
    return read_gmsh(COMM, file)


def footing(path: Path, punch: bool = False) -> Problem:
    """Return half a strip footing, 353 cells, under pressure or an elastic punch in contact."""
    mesh = made(path, write_strip_footing, size=0.4, punch=punch)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    materials = {"ground": SOIL} | ({"punch": RIGID} if punch else {})
    contacts = [Contact("ground_footing", "punch_footing")] if punch else []
    load = Pressure("top" if punch else "footing", 1.0)
    return Problem(mesh, materials, supports, [load], contacts, degree=2)


def blocks(lower: Material, upper: Material, pressure: float = 1.0) -> Problem:
    """Return two quadratic blocks on rollers; only contact holds the upper block."""
    return Problem(
        stacked_blocks(COMM, 2, heights=(0.7, 1.2)),
        {"lower": lower, "upper": upper},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", pressure)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )


def proven(problem: Problem, limit: LimitLoad, materials: Mapping[str, Material]) -> float:
    """Prove the bounds from the returned fields only, and return the estimate."""
    assert limit.verdict is Verdict.FOUND
    assert len(limit.steps) <= 30
    assert limit.factorisations is not None
    assert limit.factorisations <= 35
    assert np.isfinite(limit.lower)
    assert limit.upper is not None
    assert limit.estimate is not None
    assert limit.lower <= limit.estimate <= limit.upper <= limit.lower * (1 + 1e-4)
    weakness = fem.Function(problem.Q)
    for name, material in materials.items():
        points = problem.Q.dofmap.list[problem.tagged_mesh.cells(name)].ravel()
        weakness.x.array[points] = (
            1 / material.yield_radius if isinstance(material, VonMises) else 0.0
        )

    # static: an admissible stress, and compressive contact forces that balance the remainder
    comm, dx = problem.comm, problem.dx
    assert limit.stress is not None
    assert limit.contact_forces is not None
    s = deviator(limit.stress)
    over = ufl.max_value(ufl.sqrt(ufl.dot(s, s)) * weakness - 1 - 1e-9, 0.0)
    assert Integral(comm, over * dx)() == 0
    forces = contact_forces(problem, limit.stress, limit.lower)
    pushed = comm.allreduce(float(np.abs(forces).max(initial=0)), MPI.MAX)
    assert np.allclose(forces, limit.contact_forces, atol=1e-9 * pushed)
    assert (limit.contact_forces >= 0).all()
    assert limit.unbalanced < 1e-9

    # kinematic: L(v) = 1, no volume change, no strain in elastic bodies, no penetration
    v = limit.mechanism
    assert problem.loads.alpha(v.x.petsc_vec) == pytest.approx(1, rel=1e-9)
    rate = problem.kinematics.strain(v)
    shape = deviator(rate)
    elastic = ufl.conditional(ufl.gt(weakness, 0.0), 0.0, 1.0)
    wrong = trace(rate) ** 2 + elastic * ufl.dot(shape, shape)
    left = Integral(comm, wrong * dx)() / Integral(comm, ufl.dot(rate, rate) * dx)()
    assert math.sqrt(left) < 1e-9
    y = problem.create_vector()
    problem.basis.M.mult(v.x.petsc_vec, y)
    assert (y.array_r[problem.basis.index] <= 1e-8 * y.norm()).all()
    y.destroy()
    safe = weakness + elastic
    power = Integral(comm, (1 - elastic) * ufl.sqrt(ufl.dot(shape, shape)) / safe * dx)()
    assert power == pytest.approx(limit.upper, rel=1e-8)
    return limit.estimate


def test_a_punch_on_a_base() -> None:
    problem = punch_problem(4)
    found = proven(problem, interior_point(problem), {"base": PUNCH, "punch": PUNCH})
    assert found == pytest.approx(PUNCH_LIMIT, rel=1e-5)


def test_a_plate_of_linear_elements() -> None:
    problem = l_plate_problem(1)
    found = proven(problem, interior_point(problem), {"plate": STEEL})
    assert found == pytest.approx(1.299038, rel=1e-5)  # loading by α gives 1.29901


def test_a_footing_in_few_factorisations(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path)
    limit = interior_point(problem)
    assert proven(problem, limit, {"ground": SOIL}) / K == pytest.approx(5.16629, rel=2e-6)
    assert limit.factorisations <= 18  # loading by α solves 145 systems


def test_an_elastic_punch_on_the_ground(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path, punch=True)
    found = proven(problem, interior_point(problem), {"ground": SOIL, "punch": RIGID})
    assert found == pytest.approx(1351.67, rel=2e-5)  # loading by α


@pytest.mark.parametrize(("degree", "order"), [(2, 1), (2, 2), (1, 1)])
def test_a_tube_in_a_tube(shared_tmp_path: Path, degree: int, order: int) -> None:
    mesh = made(shared_tmp_path, write_thick_tube, size=0.1, order=order, interface=1.15)
    material = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)
    materials: dict[str, Material] = dict.fromkeys(mesh.volumes, material)
    problem = Problem(
        mesh,
        materials,
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=degree,
    )
    found = proven(problem, interior_point(problem), materials)
    exact = 2 * 250.0 / math.sqrt(3) * math.log(OUTER)
    assert found == pytest.approx(exact, rel=2e-3 if degree == 2 else 0.1)  # linear elements lock


@pytest.mark.parametrize("degree", [1, 2])
def test_a_block_on_a_rigid_plane(shared_tmp_path: Path, degree: int) -> None:
    problem = Problem(
        made(shared_tmp_path, write_platens, size=0.2),
        {"block": SOIL},
        [Support("x0", "x")],
        [Pressure("top", 1.0)],
        obstacles=[Plane("y0", point=(0.0, 0.0), normal=(0.0, 1.0))],
        degree=degree,
    )
    assert proven(problem, interior_point(problem), {"block": SOIL}) == pytest.approx(
        2 * K, rel=1e-5
    )


def test_blocks_in_space_in_contact() -> None:
    """The upper block lies partly open on the lower block."""
    materials: dict[str, Material] = {"lower": STEEL, "upper": STEEL}
    problem = Problem(
        two_blocks(COMM, 2),
        materials,
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )
    limit = interior_point(problem)
    estimate = proven(problem, limit, materials)
    assert limit.contact_forces is not None
    pushing = COMM.allreduce(int((limit.contact_forces > 1e-6 * estimate).sum()))
    assert 0 < pushing < problem.num_pairs


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4])
def test_bodies_of_any_strength(ratio: float) -> None:
    strong = VonMises(young=2e5, poisson=0.3, yield_stress=300.0 * ratio)
    found = proven(
        problem := blocks(BLOCK, strong),
        interior_point(problem),
        {"lower": BLOCK, "upper": strong},
    )
    assert found == pytest.approx(300.0, rel=1e-5)


def test_the_units_of_loads_do_not_matter() -> None:
    problem = blocks(BLOCK, BLOCK, pressure=1e-9)
    found = proven(problem, interior_point(problem), {"lower": BLOCK, "upper": BLOCK})
    assert found == pytest.approx(300.0e9, rel=1e-5)


def test_gaps_do_not_matter() -> None:
    found = [interior_point(stack_problem(2, gap), 1e-7).estimate for gap in (0.0, 0.01)]
    assert found[0] == pytest.approx(found[1], rel=2e-7)


def test_a_tolerance_is_reached_and_steps_are_told() -> None:
    told = []
    limit = interior_point(l_plate_problem(1), 1e-2, told.append)
    assert told == list(limit.steps)
    assert [step.number for step in told] == list(range(1, len(told) + 1))
    assert len(told) < 10
    assert limit.upper is not None
    assert limit.upper / limit.lower - 1 < 1e-2
    assert "1e-05" not in repr(limit)
    assert f"{len(told)} steps" in repr(limit)


@pytest.mark.mpi3("plate")
@pytest.mark.parametrize(
    ("make", "share"),
    [
        (lambda comm: l_plate_problem(1, comm), 1e-8),
        (lambda comm: two_blocks_problem(2, comm=comm), 1e-8),
        (lambda comm: punch_problem(2, comm=comm), 1e-6),  # many stresses have this limit load
    ],
    ids=["plate", "blocks", "punch"],
)
def test_every_number_of_ranks_finds_the_same(
    make: Callable[[MPI.Intracomm], Problem], share: float
) -> None:
    """Each rank alone and all ranks together find the same."""
    alone, together = interior_point(make(MPI.COMM_SELF)), interior_point(make(COMM))
    assert alone.lower == pytest.approx(together.lower, rel=share)
    assert alone.upper == pytest.approx(together.upper, rel=share)


@pytest.mark.parametrize("most", [5, 7])
def test_what_enters_once_it_keeps_the_volume_is_held(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If steps end early, the projected velocity penetrates at some pairs without force."""
    monkeypatch.setattr("perfplast_fenicsx.limit_analysis.conic.interior_steps.MOST_STEPS", most)
    given = two_blocks_problem(2).given
    limit = interior_point(Problem.from_given(two_blocks(COMM, 2), replace(given, degree=2)))
    assert limit.upper == pytest.approx(96.0, rel=3e-3)
    met = limit.upper - limit.lower <= 1e-4 * limit.lower
    assert limit.verdict is (Verdict.FOUND if met else Verdict.STALLED)
    assert ("have not met" in limit.reason) != met


def test_nothing_can_yield() -> None:
    limit = interior_point(blocks(RIGID, RIGID))
    assert limit.verdict is Verdict.UNBOUNDED
    assert "yield stress" in limit.reason
    assert limit.estimate is None
    assert limit.upper is None


def test_an_elastic_body_bears_the_load() -> None:
    problem = Problem(
        two_blocks(COMM, 2),
        {"lower": STEEL, "upper": RIGID},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )
    limit = interior_point(problem)
    assert limit.verdict is Verdict.UNBOUNDED
    assert "do not yield" in limit.reason
    assert limit.estimate is None
    assert not limit.mechanism.x.array.any()


def test_linear_elements_that_lock(shared_tmp_path: Path) -> None:
    mesh = made(shared_tmp_path, write_platens, size=0.1, platen=True)
    supports = [Support("x0", "x"), Support("y0", "y")]
    materials = {"block": SOIL, "platen": RIGID}
    problem = Problem(mesh, materials, supports, [Pressure("top", 1.0)])
    limit = interior_point(problem)
    assert limit.verdict is Verdict.UNBOUNDED
    assert "linear elements may lock" in limit.reason
    assert limit.estimate is None
    assert limit.upper is None


@pytest.mark.parametrize(("lower", "most"), [(BLOCK, 20), (RIGID, 40)])
def test_loads_that_meet_no_resistance(lower: Material, most: int) -> None:
    """The upper block moves up rigidly, so its strain rate is a rounding error."""
    limit = interior_point(blocks(lower, BLOCK, pressure=-1.0))
    assert limit.verdict is Verdict.NO_RESISTANCE
    assert "no stress can carry" in limit.reason
    assert limit.estimate is None
    assert len(limit.steps) < most


@pytest.mark.parametrize("rtol", [0.0, 1.0, -1.0, math.nan])
def test_a_tolerance_must_be_one(rtol: float) -> None:
    with pytest.raises(InputError, match="not between 0 and 1"):
        interior_point(punch_problem(2), rtol)


@pytest.mark.mpi2
def test_an_earlier_iterate_gives_the_mechanism_if_the_last_one_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where sand on clay dilates, later iterates may be too close to the edges of the cones."""
    rtol, clay = 1e-3, footing(tmp_path)
    ground = DruckerPrager(1e4, 0.3, 10.0, 20.0, "plane-strain")
    problem = variant(clay, materials={"ground": ground})
    usual = interior_point(problem, rtol)
    tried, admissible = list[float](), discrete_bounds._admissible_load

    def fails_at_first(iteration: InteriorIteration) -> KinematicLoad:
        tried.append(iteration.gap())
        if len(tried) == 1:
            return KinematicLoad(None, 0.0, 1.0)
        return admissible(iteration)

    monkeypatch.setattr(discrete_bounds, "_admissible_load", fails_at_first)
    found = interior_point(problem, rtol)
    last, earlier = tried
    assert last < earlier
    assert found.verdict is Verdict.FOUND
    assert found.upper == pytest.approx(usual.upper, rel=rtol)
