"""Test rigid blocks: only joints limit the load, and both bounds meet in a linear program."""

import math
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from scipy.optimize import brentq, linprog

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Newton,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    Rigid,
    Support,
    VonMises,
    factor_of_safety,
    limit_bounds,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds
from perfplast_fenicsx.limit_analysis.blocks import block_limit
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.strength_search import check_curve
from perfplast_fenicsx.problem.problem import variant
from perfplast_fenicsx.proof import check
from tests.checks import assert_refused
from tests.stones import box, chain, lune, stones, voussoir, weight_and

COMM = MPI.COMM_WORLD


def proven(path: Path, bounds: BodyBounds) -> tuple[float, float]:
    """Return both bounds, which the checker also proves."""
    assert bounds.strict, bounds.why_not
    results = ResultFolder(COMM, path, force=True)
    write_proof(results, results.file("bounds.h5"), *proofs(bounds, bounds))
    found = check(results.file("bounds.h5"))
    values = [bounds.lower.value, bounds.upper.value]
    for (kind, half), value in zip(found.items(), values, strict=True):
        assert not half.faults, (kind, half.faults)
        assert half.proven == pytest.approx(value, rel=1e-9, abs=1e-12)
    return values[0] or 0.0, values[1] or 0.0


def pushed(mu: float, wide: float, high: float, c: float = 0.0) -> Problem:
    """Return a stone on a held stone, with its weight and a growing push to the right."""
    mesh = stones(COMM, [box([0, -1], [wide, 0]), box([0, 0], [wide, high])], (3, 2))
    friction = {"coulomb": mu} | ({"tresca": c} if c else {})
    return Problem(
        mesh,
        {"0": Rigid(), "1": Rigid()},
        [Support("0_y0")],
        weight_and(mesh, [1.0, 0.0], ["0"]),
        [Contact("0_y1", "1_y0", associated=True, **friction)],
        degree=2,
    )


@pytest.mark.mpi3
@pytest.mark.parametrize(
    ("mu", "wide", "high", "c"), [(0.3, 2.0, 1.0, 0.0), (0.7, 1.0, 2.0, 0.0), (0.2, 2.0, 1.0, 0.1)]
)
def test_a_stone_slides_or_tips(
    shared_tmp_path: Path, mu: float, wide: float, high: float, c: float
) -> None:
    """The stone slides at μ + c/h of its weight, and tips at b/h."""
    exact = min(mu + c / high, wide / high)
    low, up = proven(shared_tmp_path, limit_bounds(pushed(mu, wide, high, c)))
    assert low == pytest.approx(exact, rel=1e-8 if c else 1e-11)
    assert up == pytest.approx(exact, rel=1e-11)


@pytest.mark.serial
def test_rounding_below_zero_is_no_negative_bound(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stone that slides under its weight; the linear program may return −1e-14 for 0."""
    mesh = stones(COMM, [box([0, -1], [2, 0]), box([0, 0], [2, 1])], (3, 2))
    problem = Problem(
        mesh,
        {"0": Rigid(), "1": Rigid()},
        [Support("0_y0")],
        [BodyForce("1", (0.5, -1.0), constant=True)],
        [Contact("0_y1", "1_y0", associated=True, coulomb=0.3)],
        degree=2,
    )
    solve, seen = block_limit.best_of_joints, []

    def rounded(*how: Any) -> Any:
        low, high, count = solve(*how)
        seen.append(high.value)
        return low, replace(high, value=high.value - 1e-14), count

    monkeypatch.setattr(block_limit, "best_of_joints", rounded)
    assert proven(shared_tmp_path, limit_bounds(problem)) == (0.0, 0.0)
    assert seen == [pytest.approx(0.0, abs=1e-13)]


def oppenheim(push: bool = True) -> Problem:
    """Return seven stones over 157.5°, of thickness 0.15 mean radii, on two held stones."""
    step = math.radians(157.5) / 7
    angles = (np.arange(10) - 4.5) * step
    places = [voussoir(a, b, 0.925, 1.075) for a, b in pairwise(angles)]
    mesh = stones(COMM, places, (1, 2))
    loads = weight_and(mesh, [1.0, 0.0], ["0", "8"])
    return chain(
        mesh, [Support("0_x0"), Support("8_x1")], loads[: None if push else 7], coulomb=0.75
    )


def least_by_hinges() -> float:
    """Return the least factor over all motions of the arch about corners of four joints.

    Three moving parts rotate about their instantaneous centres. Weight and push act at the middle
    of each stone.
    """
    step = math.radians(157.5) / 7
    angles = (np.arange(10) - 4.5) * step
    ends = np.column_stack([np.sin(-angles), np.cos(angles)])
    corners = ends[:, None] * np.array([0.925, 1.075])[:, None]
    middle, area = [], []
    for one, other in pairwise(corners):
        x = np.array([one[0], one[1], other[1], other[0]])
        cross = x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1)
        area.append(abs(cross.sum()) / 2)
        middle.append((x + np.roll(x, -1, axis=0)).T @ cross / (3 * cross.sum()))
    x, weight = np.array(middle), np.array(area)
    best = math.inf
    for joints in combinations(range(1, 9), 4):
        for first in (0, 1):
            a, b, c, d = (corners[at, (first + i) % 2] for i, at in enumerate(joints))
            # Rotations t of the parts: t1(b − a) + t2(c − b) + t3(d − c) = 0.
            rows = np.column_stack([b - a, c - b, d - c])
            turns = np.linalg.svd(rows)[2][2]
            centres = [a, b - turns[0] / turns[1] * (b - a), d]
            live = dead = 0.0
            for part, (low, high) in enumerate(pairwise(joints)):
                away = (x[low:high] - centres[part]) * turns[part]
                live -= float(weight[low:high] @ away[:, 1])  # component (1, 0) of t × away
                dead -= float(weight[low:high] @ away[:, 0])  # component (0, −1)
            opens = [turns[0], turns[1] - turns[0], turns[2] - turns[1], -turns[2]]
            # A joint opens on the side where it has no hinge: 1 outside, −1 inside.
            wanted = np.array([1.0, -1.0, 1.0, -1.0]) * (1 - 2 * first)
            if live and (np.sign(opens) * math.copysign(1.0, live) == wanted).all():
                best = min(best, -dead / live)
    return best


def test_arch_of_oppenheim(shared_tmp_path: Path) -> None:
    """The arch collapses at 0.37 g (I. J. Oppenheim, Earthquake Engng Struct. Dyn. 21, 1992)."""
    low, up = proven(shared_tmp_path, limit_bounds(oppenheim()))
    assert low == pytest.approx(up, rel=1e-10)
    assert up == pytest.approx(0.37, abs=5e-3)
    assert up == pytest.approx(least_by_hinges(), rel=1e-9)


def half_circle(thickness: float, stones_of_half: int = 20) -> Problem:
    """Return a half circle of mean radius 1 under its weight, and a growing push."""
    count = 2 * stones_of_half
    angles = np.linspace(-math.pi / 2, math.pi / 2, count + 1)
    step = angles[1] - angles[0]
    angles = np.concatenate([[angles[0] - step], angles, [angles[-1] + step]])
    inner, outer = 1 - thickness / 2, 1 + thickness / 2
    places = [voussoir(a, b, inner, outer) for a, b in pairwise(angles)]
    mesh = stones(COMM, places, (1, 1))
    loads = weight_and(mesh, [1.0, 0.0], ["0", str(count + 1)])
    return chain(mesh, [Support("0_x0"), Support(f"{count + 1}_x1")], loads, coulomb=2.0)


def least_thickness(of_dome: bool, count: int) -> float:
    """Return the least thickness, over the mean radius, that contains a line of thrust.

    Let a = H and b = H·y, with the thrust H at the height y of the crown. The line lies inside all
    joints β if b − a·r cos β is at least M(r, β) at the intrados, and at most M(r, β) at the
    extrados. M = ∫ (r sin β − x) dW is the moment of the weight W between the crown and β.

    Args:
        of_dome: Whether it is a slice of a dome, whose width grows with x, or an arch.
        count: Number of stones of a half.
    """
    beta = np.linspace(0.0, math.pi / 2, count + 1)

    def room(thickness: float) -> float:
        sides = 1 - thickness / 2, 1 + thickness / 2
        first, second = (
            (sides[1] ** power - sides[0] ** power) / power for power in (2 + of_dome, 3 + of_dome)
        )
        if of_dome:
            weight, lever = first * (1 - np.cos(beta)), second * (beta / 2 - np.sin(2 * beta) / 4)
        else:
            weight, lever = first * beta, second * (1 - np.cos(beta))
        rows, right = [], []
        for sign, r in zip((1.0, -1.0), sides, strict=True):
            slack = np.ones_like(beta)
            rows.append(np.column_stack([sign * r * np.cos(beta), -sign * slack, slack]))
            right.append(-sign * (r * np.sin(beta) * weight - lever))
        found = linprog(
            [0.0, 0.0, -1.0],
            A_ub=np.vstack(rows),
            b_ub=np.concatenate(right),
            bounds=[(0, None), (None, None), (None, None)],
        )
        return float(found.x[2])

    return float(brentq(room, 0.02, 0.3, xtol=1e-8))


@pytest.mark.long
def test_least_thickness_of_a_half_circle(shared_tmp_path: Path) -> None:
    """The least thickness is 0.1075 radii (J.

    A. Ochsendorf, The masonry arch on spreading supports, Struct. Eng. 84 (2006), 29). A mechanism
    shows that the arch collapses if it is 0.25 % thinner.
    """
    least = least_thickness(False, 20)
    assert least == pytest.approx(0.1075, abs=5e-5)
    stands = limit_bounds(half_circle(1.0025 * least))
    assert stands.question is Question.LIMIT
    low, up = proven(shared_tmp_path, stands)
    assert 0 < low <= up < 0.05
    falls = limit_bounds(half_circle(0.9975 * least))
    assert falls.question is Question.STANDS
    assert falls.upper.strict
    assert falls.upper.value == pytest.approx(0.0, abs=1e-9)
    assert "does not stand" in falls.in_words()
    proven(shared_tmp_path, falls)


def wall(courses: int) -> Problem:
    """Return equal courses on a held course, without bond, pushed in proportion to their weight."""
    places = [box([0, i - 1.0], [1.5, i + 0.0]) for i in range(courses + 1)]
    mesh = stones(COMM, places, (2, 1))
    return Problem(
        mesh,
        {name: Rigid() for name in mesh.volumes},
        [Support("0_y0")],
        weight_and(mesh, [1.0, 0.0], ["0"]),
        [Contact(f"{i}_y1", f"{i + 1}_y0", coulomb=0.6, associated=True) for i in range(courses)],
        degree=2,
    )


def test_a_wall_tips_as_a_whole(shared_tmp_path: Path) -> None:
    low, up = proven(shared_tmp_path, limit_bounds(wall(5)))
    assert low == pytest.approx(1.5 / 5, rel=1e-10)
    assert up == pytest.approx(1.5 / 5, rel=1e-10)


def test_drucker_without_associated_friction(shared_tmp_path: Path) -> None:
    """The lower bound has no friction and carries no push.

    The upper bound has a joint that dilates.
    """
    problem = pushed(0.3, 2.0, 1.0)
    contact = Contact("0_y1", "1_y0", coulomb=0.3)
    other = Problem(
        problem.tagged_mesh,
        problem.given.materials,
        problem.given.supports,
        problem.given.loads,
        [contact],
        degree=2,
    )
    bounds = limit_bounds(other)
    low, up = proven(shared_tmp_path, bounds)
    assert low == pytest.approx(0.0, abs=1e-12)
    assert up == pytest.approx(0.3, rel=1e-11)
    assert "Drucker" in bounds.in_words()
    assert "not the best" not in bounds.in_words()


def test_an_arch_without_friction_from_below() -> None:
    """Drucker's lower bound has no forces; the program reports that the upper bound is optimal."""
    problem = oppenheim()
    joints = [Contact(it.primary, it.secondary, coulomb=0.75) for it in problem.given.contacts]
    given = problem.given
    bounds = limit_bounds(
        Problem(problem.tagged_mesh, given.materials, given.supports, given.loads, joints, degree=2)
    )
    assert bounds.lower.value is None
    assert "associated = true" in " ".join(bounds.why_not)
    assert bounds.upper.value == pytest.approx(0.37, abs=5e-3)
    assert "not the best" not in bounds.in_words()


def test_a_plane_holds_a_stone(shared_tmp_path: Path) -> None:
    """On an inclined plane a stone slides when slope and push together equal the friction."""
    slope, mu = 0.2, 0.5
    angle = math.atan(slope)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    mesh = stones(COMM, [lambda share: (share * [4.0, 1.0]) @ turn.T], (2, 1))
    normal = turn @ [0.0, 1.0]
    problem = Problem(
        mesh,
        {"0": Rigid()},
        [],
        weight_and(mesh, [-1.0, 0.0], []),
        [],
        [Plane("0_y0", [0.0, 0.0], normal, coulomb=mu, name="floor", associated=True)],
        degree=2,
    )
    exact = (mu - slope) / (1 + mu * slope)
    low, up = proven(shared_tmp_path, limit_bounds(problem))
    assert (low, up) == pytest.approx((exact, exact), rel=1e-10)


@pytest.mark.mpi3
@pytest.mark.parametrize(("mu", "c", "exact"), [(0.3, 0.0, 0.3), (2.0, 0.0, 1.25), (0.1, 0.2, 0.3)])
def test_a_stone_in_space(shared_tmp_path: Path, mu: float, c: float, exact: float) -> None:
    """The stone slides in the oblique direction of the push, or tips about the edge x = 1."""
    mesh = stones(COMM, [box([0, 0, -1], [1, 1, 0]), box([0, 0, 0], [1, 1, 1])], (2, 2, 1))
    push = np.array([0.8, 0.6, 0.0])
    problem = Problem(
        mesh,
        {"0": Rigid(), "1": Rigid()},
        [Support("0_z0")],
        weight_and(mesh, list(push), ["0"]),
        [Contact("0_z1", "1_z0", coulomb=mu, associated=True, **({"tresca": c} if c else {}))],
        degree=2,
    )
    low, up = proven(shared_tmp_path, limit_bounds(problem))
    assert low <= up
    assert (low, up) == pytest.approx((exact, exact), rel=2e-4)


def staying(problem: Problem, push: float, **joint: bool) -> Problem:
    """Return the same problem with a constant push, and other properties of the joints."""
    given = problem.given
    loads = [
        it if it.constant else replace(it, value=[push * one for one in it.value], constant=True)  # type: ignore[union-attr]
        for it in given.loads
    ]
    joints = [replace(it, **joint) for it in given.contacts]
    return variant(problem, loads=loads, rubbing=(joints, given.obstacles))


@pytest.mark.mpi2
def test_factor_of_safety_of_stones(shared_tmp_path: Path) -> None:
    """F divides the friction of joints: a stone of any weight slides at μ/F."""
    problem = staying(pushed(0.3, 2.0, 1.0), 0.2)
    seen: list[float] = []
    found = factor_of_safety(
        problem, 1e-3, monitor=lambda factor, low, high, _: seen.append(factor)
    )
    assert found.lower is not None
    assert found.upper is not None
    assert found.lower <= 0.3 / 0.2 * (1 + 1e-9)
    assert found.upper >= 0.3 / 0.2 * (1 - 1e-9)
    assert found.upper / found.lower < 1.0011
    assert 2 * len(seen) == found.searches <= 40
    assert found.stands is not None
    assert found.falls is not None
    results = ResultFolder(COMM, shared_tmp_path, force=True)
    for name, side, factor, bounds in (
        ("stands", "lower", found.lower, found.stands),
        ("falls", "upper", found.upper, found.falls),
    ):
        write_proof(results, results.file(f"{name}.h5"), *proofs(bounds, bounds, factor))
        half = check(results.file(f"{name}.h5"))[side]
        assert not half.faults, half.faults
        assert f"Strengths are divided by F = {factor:.9g}" in " ".join(half.words)


@pytest.mark.long
def test_factor_of_safety_of_an_arch_and_of_joints_that_dilate_less() -> None:
    """A pushed arch fails by hinges or slip; without dilatancy there is only an upper bound."""
    arch = factor_of_safety(staying(oppenheim(), 0.2), 1e-2)
    assert arch.lower is not None
    assert arch.upper is not None
    assert 1.2 < arch.lower < arch.upper < 1.011 * arch.lower
    less = factor_of_safety(staying(pushed(0.3, 2.0, 1.0), 0.2, associated=False), 1e-2)
    assert less.lower is None
    assert less.upper == pytest.approx(1.5, rel=1.01e-2)


def test_stones_that_fall_or_stand_at_any_factor() -> None:
    """A slender stone tips, and a stone without a push does not slide, at any F."""
    assert_refused(lambda: factor_of_safety(staying(pushed(0.7, 1.0, 2.0), 0.6)), ["(F = 0.01)"])
    assert_refused(
        lambda: factor_of_safety(staying(pushed(0.3, 2.0, 1.0), 0.0)), ["even with F = 100"]
    )
    joints = staying(pushed(0.3, 2.0, 1.0), 0.2, associated=False)
    assert_refused(lambda: check_curve(joints), ["no curve of F", "remove path"])
    kept = staying(pushed(0.3, 2.0, 1.0), 0.2, reduced=False)
    assert_refused(lambda: factor_of_safety(kept), ["friction that F divides"])


def dome(thickness: float, count: int = 20) -> Problem:
    """Return half a slice of a dome of mean radius 1, at a smooth vertical plane, with weight."""
    angles = np.linspace(0, math.pi / 2, count + 1)
    angles = np.append(angles, angles[-1] + angles[1])
    radii = 1 - thickness / 2, 1 + thickness / 2
    mesh = stones(COMM, [lune(a, b, *radii, wide=0.1) for a, b in pairwise(angles)], (1, 1, 1))
    loads = weight_and(mesh, [1.0, 0.0, 0.0], [str(count)])
    crown = Plane("0_x0", [0.01 * radii[0], 0.0, 0.0], [1.0, 0.0, 0.0])
    return chain(mesh, [Support(f"{count}_x1")], loads, [crown], coulomb=1.0)


@pytest.mark.long
def test_least_thickness_of_a_dome(shared_tmp_path: Path) -> None:
    """The least thickness is 0.042 radii (J.

    Heyman, On shell solutions for masonry domes, doi:10.1016/0020-7683(67)90072-8) if slices only
    lean against each other. A line of thrust gives 0.0428 for thin stones, and 0.0427 for 20
    stones.
    """
    assert least_thickness(True, 400) == pytest.approx(0.0428, abs=1e-4)
    least = least_thickness(True, 20)
    assert least == pytest.approx(0.0427, abs=1e-4)
    low, up = proven(shared_tmp_path, limit_bounds(dome(1.0025 * least)))
    assert 0 < low <= up * (1 + 1e-9)
    falls = limit_bounds(dome(0.9975 * least))
    assert falls.upper.value is not None
    assert falls.upper.value < 0  # the push acts outwards; a push towards the crown helps
    assert "not carry the constant loads alone" in falls.in_words()
    proven(shared_tmp_path, falls)


def test_a_rigid_body_beside_one_that_yields() -> None:
    """A stone presses on a block, which yields at 2k."""
    mesh = stones(COMM, [box([0, 0], [1, 1]), box([0, 1], [1, 2])], (2, 2))
    problem = Problem(
        mesh,
        {"0": VonMises(young=1e4, poisson=0.3, yield_stress=math.sqrt(3)), "1": Rigid()},
        [Support("0_y0", "y"), Support("0_x0", "x"), Support("1_x0", "x")],
        [Pressure("1_y1", 1.0)],
        [Contact("0_y1", "1_y0")],
        degree=2,
    )
    bounds = limit_bounds(problem)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(2.0, rel=1e-3)
    assert bounds.upper.value == pytest.approx(2.0, rel=1e-3)


def test_refusals() -> None:
    problem = pushed(0.3, 2.0, 1.0)

    def other(**changes):  # type: ignore[no-untyped-def]
        given = problem.given
        known = {"loads": given.loads, "supports": given.supports} | changes
        return Problem(
            problem.tagged_mesh,
            given.materials,
            known["supports"],
            known["loads"],
            given.contacts,
            degree=2,
        )

    push = [load for load in problem.given.loads if not load.constant]
    assert_refused(lambda: limit_bounds(other(loads=push)), ["no joint forces balance", "weight"])
    held = [Support("0_y0"), Support("1_y0", "x")]
    assert_refused(lambda: limit_bounds(other(supports=held)), ["only the joints", "supports hold"])
    weight = limit_bounds(other(loads=[BodyForce("1", (0.0, -1.0))]))
    assert weight.lower.value is None
    assert weight.upper.value is None
    assert "carry the loads at any factor" in weight.in_words()
    assert_refused(lambda: Newton(problem), ["'0'", "rigid", "undefined", "control = 'bounds'"])


@pytest.mark.parametrize(("push", "carried"), [(0.37, True), (0.38, False)])
def test_certain_loads_are_carried_or_not(
    shared_tmp_path: Path, push: float, carried: bool
) -> None:
    """The result replaces a load level: whether bodies carry constant loads."""
    bounds = limit_bounds(staying(oppenheim(), push))
    assert bounds.question is Question.STANDS
    assert ("constant loads are carried" in bounds.in_words()) is carried
    assert ("does not stand" in bounds.in_words()) is not carried
    results = ResultFolder(COMM, shared_tmp_path, force=True)
    write_proof(results, results.file("bounds.h5"), *proofs(bounds, bounds))
    half = check(results.file("bounds.h5"))["lower" if carried else "upper"]
    assert not half.faults, half.faults
    assert half.proven is not None
    assert (half.proven > 1) is carried
