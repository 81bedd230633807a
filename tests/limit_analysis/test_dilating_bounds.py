"""Test strict bounds for ground: known limit loads lie between them, and the checker agrees."""

import math
import os
from dataclasses import replace
from pathlib import Path
from random import Random

from mpi4py import MPI

import numpy as np
import pytest

from demos.verification.ground import COHESION, block_limit, footing_limit, sphere_limit, tube_limit
from meshes.strip_footing import write_strip_footing
from meshes.thick_sphere import write_thick_sphere
from meshes.tube_polygon import write_tube_polygon
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Contact,
    DruckerPrager,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    adaptive_bounds,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import judge, write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds, limit_load
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.velocity.strict_work import strict_upper_bound
from perfplast_fenicsx.proof import check
from tests.models import Read
from tests.random_bodies import Stack, problem_of, stack, write_stack

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))
SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
STACKS = [
    pytest.param(
        seed, 3 if seed % 5 == 4 else 2, marks=[] if seed in (1, 14) else [pytest.mark.serial]
    )
    for seed in ([1, 6, 13, 14] if EFFORT < 2 else range(int(25 * EFFORT)))
]


def ground(angle: float, match: str = "plane-strain") -> DruckerPrager:
    return DruckerPrager(1e4, 0.3, COHESION, angle, match)  # type: ignore[arg-type]


def footing(read: Read, angle: float) -> Problem:
    tagged_mesh = read(write_strip_footing, width=6.0, depth=3.0, grading=1.0, size=0.7)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    loads = [Pressure("footing", 1.0)]
    return Problem(tagged_mesh, {"ground": ground(angle)}, supports, loads, degree=2)


def proven(low: BodyBounds, high: BodyBounds, path: Path) -> set[str]:
    """Check strict bounds from their file, and return the checked halves. Collective."""
    halves = proofs(low, high)
    if halves == (None, None):
        return set()
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *halves)
    checked = check(folder.file("bounds.h5"))
    for kind, half in checked.items():
        assert not half.faults, half
        bound = low.lower if kind == "lower" else high.upper
        assert half.proven is not None and bound.value is not None
        if kind == "lower":
            assert half.proven == pytest.approx(bound.value, rel=1e-9)
        else:
            # the program counts the work of rounding errors in strains as lost, and the checker
            # treats bodies that hardly strain as rigid
            assert half.proven <= bound.value * (1 + 1e-8)
            assert low.lower.value is None or half.proven >= low.lower.value * (1 - 1e-9)
    return set(checked)


def test_a_footing(read: Read, shared_tmp_path: Path) -> None:
    """Prandtl's load lies between the bounds, and the shares of cells sum to the gap."""
    bounds = limit_bounds(footing(read, 10.0))
    exact = footing_limit(10.0)
    assert bounds.strict
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert 0.5 * exact < bounds.lower.value < exact < bounds.upper.value < 1.2 * exact
    assert bounds.shares is not None
    assert bounds.shares.min(initial=0.0) >= 0.0
    gap = COMM.allreduce(float(bounds.shares.sum()))
    assert gap == pytest.approx(bounds.upper.value - bounds.lower.value, rel=1e-9)
    assert proven(bounds, bounds, shared_tmp_path) == {"lower", "upper"}


@pytest.mark.long
def test_refined_where_the_bounds_say(read: Read) -> None:
    """The gap is 7 % with 475 cells; the first mesh of 60 cells leaves a factor of 2."""
    found = adaptive_bounds(footing(read, 20.0), Adaptation(until=0.1, cells=700), 1e-3)
    assert found.lower.strict
    assert found.upper.strict
    assert found.lower.value is not None
    assert found.upper.value is not None
    assert found.lower.value < footing_limit(20.0) < found.upper.value < 1.1 * found.lower.value


@pytest.mark.long(but=["40.0"])
@pytest.mark.parametrize("angle", [10.0, 40.0])
def test_a_tube_between_two_polygons(read: Read, shared_tmp_path: Path, angle: float) -> None:
    """The tube carries what a polygon inside it carries, and no more than a polygon around it.

    A mechanism that dilates between both does at least as much work on the tube as on the polygon.
    """
    low, high = (
        limit_bounds(
            Problem(
                read(write_tube_polygon, lesser=lesser, size=0.2),
                {"tube": ground(angle)},
                SYMMETRY,
                [Pressure("inner", 1.0)],
                degree=2,
            )
        )
        for lesser in (True, False)
    )
    assert low.lower.strict
    assert high.upper.strict
    assert low.lower.value is not None
    assert high.upper.value is not None
    assert low.lower.value < tube_limit(angle) < high.upper.value < 1.07 * low.lower.value
    assert proven(low, low, shared_tmp_path) == {"lower", "upper"}


@pytest.mark.long(but=["plane-strain"])
@pytest.mark.parametrize("match", ["compression", "plane-strain"])
def test_a_sphere_between_two_polyhedra(read: Read, shared_tmp_path: Path, match: str) -> None:
    low, high = (
        limit_bounds(
            Problem(
                read(write_thick_sphere, circumscribed=surface, size=0.5),
                {"shell": ground(10.0, match)},
                [*SYMMETRY, Support("z0", "z")],
                [Pressure("inner", 1.0)],
                degree=2,
            ),
            1e-3,
        )
        for surface in ("inner", "outer")
    )
    assert low.lower.strict
    assert high.upper.strict
    assert low.lower.value is not None
    assert high.upper.value is not None
    assert low.lower.value < sphere_limit(10.0, match) < high.upper.value < 1.45 * low.lower.value
    assert proven(low, low, shared_tmp_path) == {"lower", "upper"}


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_blocks_in_space(degree: int, shared_tmp_path: Path) -> None:
    """Uniform stress and strain make both bounds exact, also with contact."""
    mesh = stacked_blocks(COMM, 1)
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, ground(25.0, "compression")),
        [*SYMMETRY, Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("upper_bottom", "lower_top")],
        degree=degree,
    )
    bounds = limit_bounds(problem, 1e-6)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(block_limit(25.0), rel=2e-6)
    assert bounds.upper.value == pytest.approx(block_limit(25.0), rel=2e-6)
    if degree == 2:
        assert proven(bounds, bounds, shared_tmp_path) == {"lower", "upper"}


def test_without_friction_it_is_von_mises(read: Read) -> None:
    """As the angle tends to 0, bounds tend to von Mises bounds on the same mesh."""
    weak = footing(read, 0.05)
    slope, strength = ground(0.05).cone
    equal = VonMises(1e4, 0.3, math.sqrt(3) * strength)
    same = Problem.from_given(weak.tagged_mesh, replace(weak.given, materials={"ground": equal}))
    found, known = (limit_bounds(problem) for problem in (weak, same))
    assert found.strict
    assert known.strict
    assert known.upper.value is not None
    assert found.lower.value == pytest.approx(known.lower.value, rel=20 * slope)
    # dilation costs at least the vertex rule, which here gives a few per cent more than finer rules
    assert known.upper.value * (1 - 1e-4) < found.upper.value < 1.06 * known.upper.value


def test_a_mechanism_of_points_alone_proves_nothing(read: Read) -> None:
    """Dilation may suffice at inner points and not at vertices. The bound is then not strict."""
    problem = footing(read, 20.0)
    bound = strict_upper_bound(problem, limit_load(problem).mechanism)
    assert not bound.strict
    assert any("control = 'bounds'" in why for why in (*bound.why_not, *bound.doubts))


@pytest.mark.long(but=["1-2", "6-2", "13-2"])
@pytest.mark.parametrize(("seed", "dim"), STACKS)
def test_random_stacks(shared_tmp_path: Path, seed: int, dim: int) -> None:
    """The stacks have ground, steel and elastic bodies, with contact, planes, weight and shear.

    ``PERFPLAST_FUZZ=4`` tries a hundred stacks.
    """
    it = stack(seed, dim)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    problem, _ = problem_of(it, read_gmsh(COMM, path))
    random, materials = Random(10_000 + seed), dict(problem.given.materials)
    names = [name for name in sorted(materials) if not isinstance(materials[name], Elastic)]
    for name in names:
        if name == names[0] or random.random() < 0.7:
            angle = random.uniform(2, 45)
            match = random.choice(["plane-strain", "compression", "extension"])
            materials[name] = DruckerPrager(1e3, 0.3, random.uniform(0.3, 1.5), angle, match)  # type: ignore[arg-type]
    problem = Problem.from_given(problem.tagged_mesh, replace(problem.given, materials=materials))
    bounds = limit_bounds(problem)
    lower, upper = bounds.lower.value, bounds.upper.value
    print(seed, dim, problem, lower, upper, bounds.why_not)
    assert lower is not None
    assert bounds.lower.strict
    expected = {"lower"}
    if upper is None:  # with confinement there is no mechanism
        assert "confined" in bounds.in_words()
    else:
        assert lower <= upper * (1 + 1e-9)
        assert bounds.upper.strict or "more than rounding" in bounds.in_words()
        expected |= {"upper"} if bounds.upper.strict else set()
    assert proven(bounds, bounds, shared_tmp_path) == expected


def test_the_law_of_a_cell_is_at_its_vertices(read: Read) -> None:
    """The law admits the rates at the vertices of the cells of a mechanism."""
    bounds = limit_bounds(footing(read, 30.0))
    points = bounds.problem.Q.element.interpolation_points
    places = points() if callable(points) else points
    assert np.allclose(np.sort(places.sum(axis=1)), [0.0, 1.0, 1.0])
    assert bounds.certificates["inadmissible"] <= 1e-12


def passive_block(comm: MPI.Intracomm, folder: Path, seed: int) -> tuple[Problem, Path]:
    """Return heavy ground with almost no cohesion that fails in compression between smooth planes.

    The weight acts along −x. The load on the top increases with the depth 1 − x. Its limit load
    factor is 1, W. J. M. Rankine's passive state.
    """
    random = Random(seed)
    cohesion, angle = random.choice([0.003, 0.01, 0.03]), random.uniform(20.0, 42.0)
    weight, size = random.uniform(1.5, 3.0), random.choice([0.35, 0.5])
    path = folder / f"passive_{seed}.msh"
    if comm.rank == 0:
        write_stack(path, Stack(seed, 2, (1.0,), ((1.0, 1.0),), size, plain=True))
    comm.barrier()
    slope = math.tan(math.radians(45 + angle / 2))
    top, deeper = slope**2 * weight + 2 * cohesion * slope, slope**2 * weight
    problem = Problem(
        read_gmsh(comm, path),
        {"block0": MohrCoulomb(1e4, 0.3, cohesion, angle)},
        [Support("x0", "x"), Support("bottom", "y")],
        [
            Pressure("top", f"{top:.17g} - {deeper:.17g}*x"),
            BodyForce("block0", [-weight, 0.0], constant=True),
        ],
        degree=2,
    )
    return problem, path.with_suffix(".h5")


@pytest.mark.parametrize("seed", [0, 1, 7, 11] if EFFORT < 2 else range(int(26 * EFFORT)))
def test_ground_whose_cohesion_is_far_below_its_pressures(
    comm: MPI.Intracomm, shared_tmp_path: Path, seed: int
) -> None:
    """Both bounds are close to the limit, and the checker proves them."""
    problem, path = passive_block(comm, shared_tmp_path, seed)
    bounds = limit_bounds(problem)
    low, high = judge(ResultFolder(comm, shared_tmp_path), path, bounds, bounds)
    assert low.lower.strict, low.why_not
    assert high.upper.strict, high.why_not
    assert low.lower.value is not None
    assert high.upper.value is not None
    assert 0.9998 < low.lower.value <= 1.0 + 1e-9
    assert 1.0 - 1e-9 <= high.upper.value < 1.0002
