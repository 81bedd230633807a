"""Test the checker's cones: dissipation by sampling, and invalid or different arrays."""

from collections.abc import Callable
from decimal import Decimal, getcontext
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    Pressure,
    Problem,
    Support,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.proof.cones import Cones, vectors
from tests.materials.energy_cap import Foam
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    alone,
    both,
    drop,
    high,
    in_turn,
    make,
    put,
    said_of_forged,
    times,
    write,
    written,
)

pytestmark = pytest.mark.serial

AT = np.zeros(1, dtype=np.int64)

NONE = np.array([np.nan])
"""Sine of cones that do not bound principal stresses."""


def cone(k: int, m: int, steep: float, seed: int) -> Cones:
    """Return a random cone of rank k, with M⁺ᵀq of a given size if M bounds all, or q·ν = 0."""
    random = np.random.default_rng(seed)
    matrix = np.zeros((m, m))
    matrix[:k] = random.normal(size=(k, m))
    inside = random.normal(size=k)
    slope = steep * matrix[:k].T @ inside / np.linalg.norm(inside)
    return Cones(np.array([2.0]), slope[None], matrix[None], NONE, NONE, NONE)


def best(cones: Cones, rate: np.ndarray, seed: int) -> float:
    """Return the largest work of random stresses on the surface; free stresses do no work."""
    random = np.random.default_rng(seed)
    stresses = random.normal(size=(200_000, rate.size))
    ratios = cones.ratios(AT, stresses[None])[0]
    on = stresses[ratios > 0] / ratios[ratios > 0, None]
    return float((on @ rate).max())


@pytest.mark.parametrize(("k", "steep"), [(3, 0.0), (3, 0.7), (2, 0.0), (2, 0.6)])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_convex_dissipation(k: int, steep: float, seed: int) -> None:
    cones = cone(k, 3, steep, seed)
    cones.check(3)
    assert not cones.grows.any()
    M, random = cones.matrix[0], np.random.default_rng(10 + seed)
    for _ in range(3):
        rate = M.T @ random.normal(size=3)
        sizes, along = cones.convex_power(AT, rate[None, None])
        power = float(np.linalg.norm(sizes[0, 0]) + along[0, 0])
        found = best(cones, rate, seed)
        assert found <= power * (1 + 1e-12)
        assert found >= power * (1 - 2e-2)
        assert power <= cones.steepness[0] * np.linalg.norm(rate)
    assert cones.takes_any[0] == (k == 3)
    assert not cones.keeps_volume(2)[0]  # the free stress is not the mean stress


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_dissipation_of_what_grows(seed: int) -> None:
    """The dissipation is the work at the apex; smaller dilation is inadmissible."""
    random = np.random.default_rng(seed)
    flat = cone(2, 3, 0.5, seed)
    free = np.linalg.svd(flat.matrix[0])[2][-1]
    cones = Cones(flat.bound, flat.slope + 0.8 * free, flat.matrix, NONE, NONE, NONE)
    cones.check(3)
    assert cones.grows.all()
    M, q = cones.matrix[0], cones.slope[0]
    apex = 2.0 * free / (q @ free)
    assert cones.ratios(AT, apex[None, None])[0, 0] == pytest.approx(1)
    y = random.normal(size=3)
    y[2] = 0
    for head, lacks in ((1.5, False), (0.5, True)):
        rate = M.T @ y + head * np.linalg.norm(y) * q
        assert (cones.short(AT, rate[None, None])[0, 0] > 0) == lacks
        power = cones.linear_power(AT, rate[None, None])[0, 0]
        assert power == pytest.approx(2.0 * max(head, 1.0) * np.linalg.norm(y))
        if not lacks:
            assert best(cones, rate, seed) <= power * (1 + 1e-12)
            assert power == pytest.approx(apex @ rate)


def exact_power(cones: Cones, rate: np.ndarray) -> float:
    """Return the dissipation of a cone with M of full rank, with 60 digits."""
    getcontext().prec = 60
    columns = [[Decimal(x) for x in of] for of in (*cones.matrix[0].tolist(),)]
    det = _mixed(*columns)

    def back(v: np.ndarray) -> list[Decimal]:
        right = [Decimal(x) for x in v.tolist()]
        each = [[right if i == k else columns[i] for i in range(3)] for k in range(3)]
        return [_mixed(*of) / det for of in each]

    r, h = back(cones.slope[0]), back(rate)
    square, along = 1 - _dot(r, r), _dot(h, r)
    head = ((along**2 + square * _dot(h, h)).sqrt() - along) / square
    return float(Decimal(float(cones.bound[0])) * head)


def _dot(a: list[Decimal], b: list[Decimal]) -> Decimal:
    return sum((x * y for x, y in zip(a, b, strict=True)), start=Decimal(0))


def _mixed(a: list[Decimal], b: list[Decimal], c: list[Decimal]) -> Decimal:
    across = [b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2] for i in range(3)]
    return _dot(a, across)


@pytest.mark.parametrize("seed", range(6))
def test_rounding_of_a_steep_cone(seed: int) -> None:
    """M is 1e-4 times as large along one stress, and 1 − ‖r‖² is 2e-6."""
    random = np.random.default_rng(seed)
    left, right = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    matrix = left @ np.diag([1.0, 0.7, 1e-4]) @ right
    slope = (1 - 1e-6) * matrix.T @ left[:, 2]
    cones = Cones(np.array([2.0]), slope[None], matrix[None], NONE, NONE, NONE)
    cones.check(3)
    sizes, along = cones.convex_power(AT, -slope[None, None])
    power = float(np.linalg.norm(sizes[0, 0]) + along[0, 0])
    error = 2 * cones.digits[0] * cones.steepness[0] * np.linalg.norm(slope)
    assert abs(exact_power(cones, -slope) - power) <= error


def test_vectors_do_the_work_of_tensors() -> None:
    random = np.random.default_rng(0)
    for d in (2, 3):
        a, b = (it + it.T for it in random.normal(size=(2, d, d)))
        assert vectors(a) @ vectors(b) == pytest.approx((a * b).sum(), rel=1e-14)


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return foam under steel, from the program."""
    path = tmp_path_factory.mktemp("cones")
    problem = Problem(
        stacked_blocks(MPI.COMM_SELF, 1),
        {"lower": Foam(1e4, 0.3, 10.0, 3.0), "upper": VonMises(2e5, 0.3, 100.0)},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    found = written(path, limit_bounds(problem))
    assert "·σ with M = " in check(path / "bounds.h5")["lower"].words[0]
    return found


def turned(them: Arrays) -> None:
    """Rotate the rows of each matrix: the sets do not change."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    them["cone_matrix"] = turn @ them["cone_matrix"]


def flattened(them: Arrays) -> None:
    """Let the foam carry any mean stress."""
    unit = np.array([1.0, 1, 1, 0, 0, 0]) / np.sqrt(3)
    them["cone_matrix"][0] -= np.outer(them["cone_matrix"][0] @ unit, unit)
    them["cone_slope"][0] = 0


def tiny_slope(them: Arrays) -> None:
    """Give the steel a tiny dilation."""
    them["cone_slope"][1, :3] = 1e-3
    them["cone_slope"][1, :2] += [1e3, -1e3]
    them["cone_slope"][1, 2] = -2e-3 + 1e-6


def steeper(them: Arrays) -> None:
    """Open the ellipsoid of the foam."""
    them["cone_slope"][0] *= 10.0


def more_cones(them: Arrays) -> None:
    """Add a cone that no cell has, and that is invalid."""
    for name in (name for name in them if name.startswith("cone_")):
        them[name] = np.concatenate([them[name], -them[name][:1]])


FORGED: dict[str, tuple[Forgery, str]] = {
    "no numbers": (both(drop("cone")), "missing"),
    "no bounds": (both(drop("cone_bound")), "missing"),
    "no slopes": (both(drop("cone_slope")), "missing"),
    "no sines": (both(drop("cone_sine")), "missing"),
    "a tensile strength as well": (both(put("cone_tension", 0, 0.5)), "does not bound principal"),
    "a tensile strength too few": (both(make("cone_tension", lambda a: a[1:])), "the shape of"),
    "a sine too few": (both(make("cone_sine", lambda a: a[1:])), "the shape of"),
    "principal as well": (both(put("cone_sine", 0, 0.5)), "has a slope or a matrix"),
    "no matrices": (both(drop("cone_matrix")), "missing"),
    "one too few": (both(make("cone_matrix", lambda a: a[1:])), "the shape of"),
    "of the plane": (both(make("cone_matrix", lambda a: a[:, :3, :3])), "the shape of"),
    "complex": (both(make("cone_matrix", lambda a: a + 0j)), "consist of numbers|real numbers"),
    "numbers as floats": (both(make("cone", lambda a: a.astype(float))), "whole numbers"),
    "that there is not": (both(put("cone", 0, 2)), "do not exist"),
    "before the first": (both(put("cone", 0, -2)), "do not exist"),
    "no cell yields": (both(make("cone", lambda a: 0 * a - 1)), "joint_force is missing"),
    "bound zero": (both(put("cone_bound", 0, 0.0)), "not positive|is negative"),
    "bound infinite": (both(put("cone_bound", 0, np.inf)), "not positive|is negative"),
    "slope nan": (both(put("cone_slope", (0, 0), np.nan)), "not finite"),
    "matrix infinite": (both(put("cone_matrix", (0, 0, 0), np.inf)), "not finite"),
    "matrix zero": (both(times("cone_matrix", 0.0)), "more than one stress free"),
    "matrix of rank four": (both(put("cone_matrix", (1, 0), 0.0)), "more than one stress free"),
    "nearly singular": (
        both(put("cone_matrix", (1, 5), 1e-9 * np.array([1.0, 1, 1, 0, 0, 0]))),
        "nearly singular",
    ),
    "nearly no slope": (both(tiny_slope), "nearly zero"),
    "open": (both(steeper), "too steep"),
    "a negative one of no cell": (both(more_cones), "not positive|is negative"),
    "weaker": (both(times("cone_bound", 0.999)), "times as large"),
    "a higher bound": (alone("lower", times("bound", 1.001)), "tractions"),
    "stronger": (alone("upper", times("cone_bound", 1.001)), "only"),
    "about another pressure": (alone("lower", times("cone_slope", 0.9)), "times as large"),
    "about another pressure, above": (alone("upper", times("cone_slope", 1.1)), "only"),
    "that bears any pressure": (alone("upper", flattened), "only"),
    "another shape above": (high(times("cone_slope", 0.9)), "of other shapes|only"),
    "changed over": (both(make("cone", lambda a: 1 - a)), "times as large|only"),
    "changed over above": (high(make("cone", lambda a: 1 - a)), "other shapes|only"),
}


@pytest.mark.parametrize("name", list(FORGED))
def test_a_forged_cone_is_refused(honest: Halves, tmp_path: Path, name: str) -> None:
    forge, words = FORGED[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(word in said for word in words.split("|")), said


@pytest.mark.parametrize(
    "change",
    [
        turned,
        in_turn(times("cone_bound", 3.0), times("cone_slope", 3.0), times("cone_matrix", 3.0)),
    ],
)
def test_the_same_sets_in_other_words(
    honest: Halves, tmp_path: Path, change: Callable[[Arrays], object]
) -> None:
    """The file defines a set; another matrix for the same set is accepted."""
    halves = {kind: {k: v.copy() for k, v in half.items()} for kind, half in honest.items()}
    change(halves["upper"])
    checked = check(write(tmp_path / "same.h5", halves))
    assert not any(half.faults for half in checked.values())
