"""Test user-defined yield sets of one cone: limit loads, strict bounds and proofs."""

import math
from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    Contact,
    DruckerPrager,
    Newton,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    Tie,
    VonMises,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.standard_cones import (
    PlainCone,
    shadow,
    standard_cone,
)
from perfplast_fenicsx.proof import check
from tests.materials.energy_cap import Foam
from tests.models import Read
from tests.random_bodies import stack, write_stack

COMM = MPI.COMM_WORLD
FOAM, STRONG = Foam(1e4, 0.3, 10.0, 3.0), VonMises(2e5, 0.3, 100.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]


def blocks(degree: int = 2) -> Problem:
    """Return foam below steel, pressed together."""
    return Problem(
        stacked_blocks(COMM, 1),
        {"lower": FOAM, "upper": STRONG},
        ROLLERS,
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=degree,
    )


def proven(bounds: BodyBounds, path: Path) -> None:
    """Check both halves from their file. Collective."""
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    for kind, half in checked.items():
        assert not half.faults, half
        bound = bounds.lower if kind == "lower" else bounds.upper
        assert half.proven == pytest.approx(bound.value, rel=1e-8)


@pytest.mark.mpi2
def test_a_block_in_space(shared_tmp_path: Path) -> None:
    """All spaces contain the uniform stress and flow, so both bounds are exact."""
    bounds = limit_bounds(blocks(), 1e-6)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(FOAM.pressed(), rel=1e-6)
    assert bounds.upper.value == pytest.approx(FOAM.pressed(), rel=1e-6)
    assert bounds.lower.value <= FOAM.pressed() * (1 + 1e-12) <= bounds.upper.value * (1 + 1e-9)
    assert COMM.allreduce(float(bounds.shares.sum())) < 1e-5  # type: ignore[union-attr]
    proven(bounds, shared_tmp_path)


@pytest.mark.long(but=["1"])
@pytest.mark.parametrize("degree", [1, 2])
def test_newton_and_the_interior_point_method_agree(degree: int) -> None:
    problem = blocks(degree=degree)
    limit = interior_point(problem)
    assert limit.lower == pytest.approx(FOAM.pressed(), rel=1e-4)
    newton = Newton(problem)
    assert newton.solve(0.999 * FOAM.pressed()).report.converged
    assert not newton.solve(1.02 * FOAM.pressed()).report.converged


def footing(read: Read, material: object, sign: float = 1.0) -> Problem:
    tagged_mesh = read(write_strip_footing, width=4.0, depth=2.0, grading=1.0, size=0.5)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    loads = [Pressure("footing", sign)]
    return Problem(tagged_mesh, {"ground": material}, supports, loads, degree=2)  # type: ignore[dict-item]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_footing(read: Read, shared_tmp_path: Path, sign: float) -> None:
    """The dissipation by the checker, the sum of shares and the bracket agree."""
    bounds = limit_bounds(footing(read, FOAM, sign))
    assert bounds.strict
    low, high, mesh = bounds.lower.value, bounds.upper.value, bounds.mesh.estimate
    assert low is not None and high is not None and mesh is not None
    assert low <= high
    assert low <= mesh <= high * (1 + 1e-6)
    shares = COMM.allreduce(float(bounds.shares.sum()))  # type: ignore[union-attr]
    assert shares == pytest.approx(high - low, rel=1e-6)
    assert high / low < 1.2
    proven(bounds, shared_tmp_path)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("centre", [0.0, 4.0])
def test_a_stack_in_plane_strain(shared_tmp_path: Path, centre: float, sign: int) -> None:
    """The stress is uniform, with the optimal out-of-plane stress.

    Contact with the platen is frictionless.
    """
    foam, it = Foam(1e4, 0.3, 10.0, centre), stack(3, 2)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, it)
    COMM.barrier()
    names = [f"block{i}" for i in range(len(it.heights))]
    contacts = [
        Contact(f"{below}_seam{i}", f"{above}_seam{i}")
        for i, (below, above) in enumerate(pairwise(names))
    ]
    ties = [Tie(contact.primary, contact.secondary) for contact in contacts]
    problem = Problem(
        read_gmsh(COMM, path),
        dict.fromkeys(names, foam),
        [Support("x0", "x"), Support("bottom", "y")],
        [Pressure("top", float(sign))],
        contacts if sign > 0 else ties,
        degree=2,
    )
    exact = foam.pressed_flat()[sign < 0]
    bounds = limit_bounds(problem, 1e-6)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(exact, rel=2e-6)
    assert bounds.upper.value == pytest.approx(exact, rel=2e-6)
    proven(bounds, shared_tmp_path)


@pytest.mark.serial
def test_coordinates_are_of_the_same_set() -> None:
    """Random stresses lie inside one of the cones if and only if they lie inside the other."""
    random = np.random.default_rng(3)
    for n, normal in ((3, 2), (4, 3), (6, 3)):
        for k, steep in ((n - 1, 0.0), (n - 1, 3.0), (n, 0.0), (n, 0.6)):
            matrix = random.normal(size=(k, n))
            slope = steep * random.normal(size=n)
            if k == n:
                slope *= steep / max(np.linalg.norm(np.linalg.solve(matrix.T, slope)), 1e-9)
            plain = PlainCone(2.0, slope, matrix).normalised()
            form = standard_cone(plain, normal)
            assert form is not None
            assert (form.slope > 0) == (k < n and steep > 0)
            for both in random.normal(size=(200, 1 + k)):
                both[0] *= k < n
                x = form.frame @ both
                size = np.linalg.norm(plain.matrix @ x) + plain.slope @ x
                theirs = plain.bound - size
                ours = form.radius - form.slope * both[0]
                ours -= np.linalg.norm(both[1:] + form.radius * form.tilt)
                if min(abs(theirs), abs(ours)) > 1e-9:
                    assert (ours > 0) == (theirs > 0)


@pytest.mark.serial
def test_a_shadow_has_the_best_of_what_is_free() -> None:
    random = np.random.default_rng(4)
    usual = np.array([0.5, 0.5, 0.0])
    for _ in range(20):
        matrix, slope = random.normal(size=(4, 4)), 0.3 * random.normal(size=4)
        cone = PlainCone(1.0, slope, matrix)
        left = shadow(cone, 2, usual)
        if left.cone is None:
            continue
        for x in random.normal(size=(10, 3)):
            size = np.linalg.norm(left.cone.matrix @ x)
            room = left.cone.bound - left.cone.slope @ x - size
            best = left.along @ x - left.share * size

            def rooms(free: float) -> float:
                whole = np.insert(x, 2, free)  # noqa: B023
                return float(1.0 - slope @ whole - np.linalg.norm(matrix @ whole))  # noqa: B023

            assert (rooms(best) > 0) == (room > 0) or abs(room) < 1e-9
            assert all(rooms(best) >= rooms(best + step) for step in (-0.1, -1e-3, 1e-3, 0.1))


def test_matches_of_ground_are_cones_about_the_axis(read: Read) -> None:
    """These cones and von Mises' depend on mean stress and deviator only; other cones do not."""
    for material, isotropic in (
        (STRONG, True),
        (DruckerPrager(1e4, 0.3, 1.0, 20.0, "compression"), True),
        (FOAM, False),
    ):
        assert body_cones(footing(read, material)).isotropic == isotropic
    eta = DruckerPrager(1e4, 0.3, 1.0, 20.0, "compression").cone[0]
    cone = body_cones(footing(read, DruckerPrager(1e4, 0.3, 1.0, 20.0, "compression"))).cones[0]
    alpha = math.sqrt(2) * eta
    assert cone.standard.slope == pytest.approx(alpha / math.sqrt(1 - alpha**2 / 6), rel=1e-12)
