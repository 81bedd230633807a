"""Test factors of safety of slopes, with proofs of both bounds."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.retaining_wall import write_retaining_wall
from meshes.slope import write_slope
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Contact,
    DruckerPrager,
    Elastic,
    Flow,
    InputError,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Tie,
    VonMises,
    factor_of_safety,
    limit_bounds,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body import factor_roots, safety_factor
from perfplast_fenicsx.limit_analysis.body.body_bounds import NOT_SOUGHT, BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import NOT_ASKED, lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.body.safety_factor import times_in_words
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import Weakening, weakened
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Question, Scope
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.problem.problem import variant
from perfplast_fenicsx.proof.checker import check
from tests.checks import assert_refused
from tests.limit_analysis.test_associated_joints import COSINE, SINE, cut_column
from tests.models import Read
from tests.stones import box, stones

SUPPORTS = [Support("bottom"), Support("left", "x")]
WEIGHT = BodyForce("soil", (0.0, -1.0), constant=True)


def slope(read: Read, soil: Material, weight: BodyForce = WEIGHT) -> Problem:
    """Return D. V. Griffiths and P. A. Lane's first slope: 2:1, firm ground at the toe level."""
    return Problem(read(write_slope), {"soil": soil}, SUPPORTS, [weight], degree=2)


@pytest.mark.long
def test_the_slope_of_griffiths_and_lane(read: Read) -> None:
    """Géotechnique 49 (1999), 387: 1.4 by finite elements; log spirals collapse at 1.3978."""
    ground = DruckerPrager(1e3, 0.3, 0.05, 20.0, "plane-strain")
    seen = []
    found = factor_of_safety(
        slope(read, ground),
        2e-3,
        Adaptation(0.05, 500),
        monitor=lambda factor, low, high, _: seen.append((factor, low.value, high.value)),
    )
    assert found.lower is not None
    assert found.upper is not None
    assert 1.35 < found.lower < 1.3978
    assert 1.3743 < found.upper < 1.42
    assert found.stands is not None
    assert found.falls is not None
    for it, bound in ((found.stands, found.stands.lower), (found.falls, found.falls.upper)):
        assert it.question is Question.STANDS
        assert bound.strict
    assert 1 <= (found.stands.lower.value or 0) <= 1.02
    assert 0.98 <= (found.falls.upper.value or 2) <= 1
    assert found.searches <= 14
    both = [k for k, it in enumerate(seen) if it[1] is not None and it[2] is not None]
    assert len({seen[k][0] for k in both}) > 1  # the search for F begins again on each mesh
    last = seen[both[-1] :]
    for side in (1, 2):  # and each root on the last mesh needs only its bound
        values = [(it[0], it[side]) for it in sorted(last) if it[side] is not None]
        assert 2 <= len(values) < len(last)
        assert all(b < a for (_, a), (_, b) in pairwise(values))
    assert "stands with F = 1.3" in found.in_words()


@pytest.mark.mpi2
def test_without_friction_it_is_a_limit_load(read: Read) -> None:
    problem = slope(read, VonMises(1e3, 0.3, 0.3))
    bounds = limit_bounds(problem, 1e-5)
    found = factor_of_safety(problem, 1e-4)
    assert found.lower == pytest.approx(bounds.lower.value, rel=2e-4)
    assert found.upper == pytest.approx(bounds.upper.value, rel=2e-4)


def test_strengths_that_are_reduced() -> None:
    ground = DruckerPrager(1e3, 0.3, 0.05, 20.0, "compression").divided_by(1.25)
    assert ground.cohesion == pytest.approx(0.04)
    assert math.tan(math.radians(ground.friction_angle)) == pytest.approx(
        math.tan(math.radians(20.0)) / 1.25
    )
    assert VonMises(1e3, 0.3, 0.3).divided_by(2.0).yield_stress == pytest.approx(0.15)
    elastic = Elastic(1e3, 0.3)
    assert elastic.divided_by(3.0) is elastic


def test_strengths_that_are_kept(read: Read) -> None:
    """Strengths of bodies and contacts with reduced = false do not change."""
    steel = VonMises(2e5, 0.3, 235.0, reduced=False)
    kept = slope(read, MohrCoulomb(1e3, 0.3, 0.05, 20.0))
    kept = variant(kept, materials={"soil": steel})
    assert weakened(kept, 1.5).given.materials["soil"] == steel
    with pytest.raises(InputError, match="leaves no strength that a factor"):
        factor_of_safety(kept)
    joint = cut_column(0.4, 1.0)
    given = joint.given
    rubbing = ([replace(it, reduced=False) for it in given.contacts], given.obstacles)
    loads = [Pressure("top", 2.0, constant=True)]
    kept = variant(joint, loads=loads, rubbing=rubbing)
    np.testing.assert_array_equal(weakened(kept, 1.6).friction.coulomb, joint.friction.coulomb)
    weakening = Weakening(kept)
    weakening.divide(1.6)
    np.testing.assert_array_equal(weakening.problem.friction.coulomb, joint.friction.coulomb)
    with pytest.raises(InputError, match="reduced = false"):
        replace(given.contacts[0], tresca=None, coulomb=None, associated=False, reduced=False)


@pytest.fixture
def glued_wall(read: Read) -> Problem:
    """Return a wall that preserves volume, glued to ground that dilates; both have weight."""
    bodies = {
        "ground": DruckerPrager(1e4, 0.3, 0.05, 25.0, "plane-strain"),
        "wall": VonMises(1e6, 0.2, 20.0),
    }
    supports = [Support("bottom"), Support("side", "x"), Support("below", "x")]
    loads = [BodyForce(name, (0.0, -1.2), constant=True) for name in bodies]
    ties = [Tie("ground_face", "wall_face")]
    mesh = read(write_retaining_wall, width=3.0)
    return Problem(mesh, bodies, supports, loads, contacts=ties, degree=2)


@pytest.mark.parametrize("factor", [1.0, 1.3, 1.6])
def test_upper_bounds_of_ground_glued_to_what_keeps_its_volume(
    glued_wall: Problem, factor: float
) -> None:
    """Volume changes of 4e-11 of the strain rates remained, which is more than rounding."""
    bounds = upper_bound(weakened(glued_wall, factor), 1e-3)
    assert bounds.upper.strict, bounds.upper
    assert bounds.certificates["inadmissible"] < 1e-11


@pytest.mark.long
def test_values_that_are_not_strict_steer_the_search(
    glued_wall: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The program never reports them, but they lead to a factor where a bound is strict."""
    asked = []

    def sometimes(problem: Problem, rtol: float, steps: object) -> BodyBounds:
        bounds = upper_bound(problem, rtol)
        asked.append(bounds.upper.value)
        upper = replace(bounds.upper, of=Scope.MESH, why_not=("it was made so here",))
        return bounds if len(asked) > 2 else replace(bounds, upper=upper)

    monkeypatch.setattr(factor_roots, "upper_bound", sometimes)
    roots = factor_roots.FactorRoots(glued_wall, 1e-2, None, None)
    roots.keep(0.3, upper_bound(weakened(glued_wall, 0.3), 1e-3))
    found = roots.root("upper")
    assert found is not None
    assert 0.9 < (roots.found["upper"][found].upper.value or 0.0) <= 1.0
    assert roots.found["upper"][found].upper.strict
    assert 3 <= len(asked) <= 5


SAND, GENTLE = 32.0, 2.5
"""Friction angle, and horizontal over vertical length of a slope of 21.8°."""

NO_COHESION = GENTLE * math.tan(math.radians(SAND))
"""Its factor of safety as the cohesion tends to zero: tan φ/tan β."""


def gentle(read: Read, cohesion: float, size: float = 0.25) -> Problem:
    mesh = read(write_slope, run=GENTLE, size=size)
    sand = MohrCoulomb(1e4, 0.3, cohesion, SAND)
    return Problem(mesh, {"soil": sand}, SUPPORTS, [WEIGHT], degree=2)


@pytest.mark.parametrize("cohesion", [1e-3, 1e-4])
def test_loads_that_next_to_no_strength_carries(read: Read, cohesion: float) -> None:
    """Searches ended at 0.1 and 0.01 of the weight, 50 times what a viscous flow carries."""
    problem = weakened(gentle(read, cohesion), 0.93 * NO_COHESION)
    beside = upper_bound(problem, 1e-3)
    assert beside.upper.value is None
    bounds = lower_bound(problem, beside, 1e-3)
    assert bounds.lower.strict
    assert (bounds.lower.value or 0.0) > 1


@pytest.mark.parametrize("share", [0.97, 0.98])
def test_rounding_beside_all_but_no_cohesion(
    read: Read, shared_tmp_path: Path, share: float
) -> None:
    """The stress has a reserve everywhere, and what rounding leaves of its balance takes little.

    Earlier, a bound held only for 0.73 and 0.78 times the weight.
    """
    problem = weakened(gentle(read, 1e-5, 0.12), share * NO_COHESION)
    bounds = lower_bound(problem, upper_bound(problem, 1e-3), 1e-3)
    assert bounds.lower.strict, bounds.lower.why_not
    assert (bounds.lower.value or 0.0) > 1
    folder = ResultFolder(MPI.COMM_WORLD, shared_tmp_path)
    stress, _ = proofs(bounds, bounds)
    write_proof(folder, folder.file("stands.h5"), stress, None)
    half = check(folder.file("stands.h5"))["lower"]
    assert not half.faults
    assert half.proven is not None
    assert half.proven > 1


@pytest.mark.long
def test_a_slope_with_a_skin_of_sand(read: Read) -> None:
    """The search for F begins again on each mesh, because the first mesh is much too strong."""
    factors = []
    found = factor_of_safety(
        gentle(read, 1e-3),
        5e-3,
        Adaptation(0.2, 450),
        monitor=lambda factor, *_: factors.append(factor),
    )
    assert found.lower is not None
    assert found.upper is not None
    assert 0.99 * NO_COHESION < found.lower < found.upper < 1.07 * NO_COHESION
    assert len(set(factors[:4])) > 2


def test_where_the_next_mesh_is_bounded() -> None:
    """The next F lies between proven factors of all earlier meshes."""
    mesh, none = Bound(None, "lower", Scope.MESH), Bound(None, "upper", Scope.MESH)

    def curve(factor: float, low: float | None, high: float | None) -> factor_roots.FactorRoots:
        lower = mesh if low is None else Bound(low, "lower", Scope.BODY)
        upper = none if high is None else Bound(high, "upper", Scope.BODY)
        roots = factor_roots.FactorRoots(None, 1e-3, None, None, 2.0)  # type: ignore[arg-type]
        roots.keep(factor, SimpleNamespace(lower=lower, upper=upper))  # type: ignore[arg-type]
        return roots

    def then(*curves: factor_roots.FactorRoots) -> float:
        (factor,) = curves[-1].found["lower"]
        return factor_roots.next_factor(curves, factor, curves[-1].found["lower"][factor])

    assert then(curve(1.5, 0.9, 1.1)) == pytest.approx(1.5 * 0.9**0.5)
    assert then(curve(1.5, None, 1.1)) == pytest.approx(1.5 * 1.1**0.5)
    assert then(curve(1.46, 1.0, 1.3), curve(1.5, 0.9, 1.1)) == pytest.approx(1.46, rel=2e-3)
    assert then(curve(1.5, 0.1, None)) == 1.5  # no mechanism so far
    assert then(curve(1.5, 4.0, None)) > 1.6  # the ground certainly carries the loads
    assert then(curve(1.5, 0.9, 0.95)) < 1.5
    stood = curve(1.45, 4.0, None)
    assert 1.45 < then(stood, curve(1.5, 0.01, 0.02)) < 1.5


def test_why_there_is_no_bound_is_told() -> None:
    loose = Bound(0.9, "upper", Scope.MESH, ("volume changes are more than rounding",))
    told = times_in_words(1.04, Bound(None, "lower", Scope.MESH, (NOT_ASKED,)), loose, 12)
    assert told.endswith("the upper bound is not strict: volume changes are more than rounding.")
    assert NOT_ASKED not in told
    assert "there is no upper bound: it is so" in times_in_words(
        1.04, NOT_SOUGHT, Bound(None, "upper", Scope.MESH, ("it is so",)), 12
    )
    assert told.startswith("12 cells: ")


def test_why_the_factors_are_further_apart_than_requested() -> None:
    """Earlier, the program did not give this reason."""
    found, none = Bound(1.0, "upper", Scope.BODY), Bound(None, "upper", Scope.MESH, ("it locks",))
    stands, carried = Bound(1.0, "lower", Scope.BODY), NOT_SOUGHT

    def of_mesh(cells: int, low: float, high: float, upper: Bound) -> factor_roots.FactorRoots:
        topology = SimpleNamespace(dim=2, index_map=lambda _: SimpleNamespace(size_global=cells))
        mesh = SimpleNamespace(mesh=SimpleNamespace(topology=topology))
        problem: Any = SimpleNamespace(tagged_mesh=mesh)
        roots = factor_roots.FactorRoots(problem, 1e-3, None, None)
        one: Any = SimpleNamespace(lower=stands, upper=carried)
        other: Any = SimpleNamespace(lower=carried, upper=upper)
        roots.keep(low, one, "lower")
        roots.keep(high, other, "upper")
        return roots

    def told(curves: list[factor_roots.FactorRoots], until: float, ended: str = "") -> str:
        return safety_factor._missed(1.3, 1.32, curves, Adaptation(until, 500), ended)

    coarse, fine = of_mesh(90, 1.2, 1.32, found), of_mesh(400, 1.3, 1.31, none)
    last = of_mesh(400, 1.3, 1.32, found)
    assert told([coarse, fine], 0.02) == ""
    assert told([coarse, fine], 0.01) == (
        "The factors are 1.5 % apart, more than until = 0.01: the upper factor comes from an"
        " earlier mesh, because it locks. The last mesh has 400 cells."
    )
    assert "until = 0.01: too many cells. The" in told([coarse, last], 0.01, "too many cells")
    assert "limit_tolerance = 0.001" in told([coarse, last], 0.01)
    assert safety_factor._missed(1.3, 1.32, [fine], None, "") == ""
    none_found = "No upper factor was found: it locks."
    assert safety_factor._missed(1.3, None, [fine], None, "") == none_found


def test_what_is_refused(read: Read) -> None:
    ground = VonMises(1e3, 0.3, 0.3)
    growing = BodyForce("soil", (0.0, -1.0))
    with pytest.raises(InputError, match="the load on 'soil' grows"):
        factor_of_safety(slope(read, ground, growing))
    with pytest.raises(InputError, match="friction that F divides"):
        factor_of_safety(slope(read, Elastic(1e3, 0.3)))
    with pytest.raises(InputError, match="Flow\\) has no strength"):
        weakened(slope(read, Flow(ground)), 1.1)


@pytest.mark.long
def test_strengths_that_f_does_not_divide_and_that_limit(read: Read) -> None:
    """A body with unreduced strength collapses, or is stable, at any F: one sentence ends the
    search.

    Earlier, the program reported at most 0.14, and at least 86 000.
    """
    mesh = stones(MPI.COMM_WORLD, [box([0, 0], [1, 1]), box([0, 1], [1, 2])], (2, 2))
    held = [Support("0_y0", "y"), Support("0_x0", "x"), Support("1_x0", "x")]
    joint = [Contact("0_y1", "1_y0", coulomb=0.5, associated=True)]
    block = VonMises(1e4, 0.3, 1.0, reduced=False)

    def asked(pressure: float, push: float) -> Problem:
        loads = [Pressure("1_y1", pressure, constant=True)]
        loads.append(Pressure("1_x1", push, constant=True))
        materials = {"0": block, "1": replace(block, yield_stress=10.0)}
        return Problem(mesh, materials, held, loads, joint, degree=2)

    assert_refused(
        lambda: factor_of_safety(asked(2.0, 0.0), 1e-2),
        ["(F = 0.01)", "the strength of '0' and the strength of '1'", "reduced = false"],
    )
    assert_refused(lambda: factor_of_safety(asked(0.5, 0.1), 1e-2), ["even with F = 100"])


@pytest.mark.long(but=["0.3"])
@pytest.mark.parametrize("tolerance", [0.3, 0.9])
def test_wide_tolerances(read: Read, tolerance: float) -> None:
    """The first mesh initially has ten times the tolerance, which may exceed one."""
    found = factor_of_safety(slope(read, VonMises(1e3, 0.3, 0.5)), tolerance)
    assert found.lower is not None
    assert found.upper is not None
    assert found.lower < found.upper < (1 + 3 * tolerance) * found.lower


@pytest.mark.long
def test_joints_are_reduced_as_bodies_are() -> None:
    """F q sin cos = c + μ q cos² on the cut of a column under a constant pressure q."""
    mu, c, q = 0.4, 1.0, 2.0
    problem = cut_column(mu, c)
    found = factor_of_safety(variant(problem, loads=[Pressure("top", q, constant=True)]), 1e-5)
    exact = (c + mu * q * COSINE**2) / (q * SINE * COSINE)
    assert found.lower == pytest.approx(exact, rel=1e-4)
    assert found.upper == pytest.approx(exact, rel=1e-4)
    assert (found.lower or 0.0) <= exact * (1 + 1e-9)
    assert (found.upper or 0.0) >= exact * (1 - 1e-9)
    assert found.falls is not None
    forces = found.falls.mesh.contact_forces  # forces of pairs, which carry the normal part of q
    assert forces is not None
    assert len(forces) == len(found.falls.problem.basis.index)
    pressed = float(problem.comm.allreduce(forces.sum()))
    times = found.falls.mesh.standing
    assert times is not None and times.lower is not None
    assert pressed == pytest.approx(times.lower * q * COSINE, rel=1e-3)


def test_friction_of_a_reduced_problem_is_that_of_a_new_one() -> None:
    weaker, other = weakened(cut_column(0.4, 1.0), 1.6), cut_column(0.4 / 1.6, 1.0 / 1.6)
    for key in ("coulomb", "adhesion", "bound"):
        found, expected = getattr(weaker.friction, key), getattr(other.friction, key)
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert [it.coulomb for it in weaker.constraints.sources] == pytest.approx([0.25])
    assert [it.coulomb for it in weaker.given.contacts] == pytest.approx([0.25])
