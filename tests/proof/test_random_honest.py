"""Test honest proofs of extreme bodies: slender bodies, strong contrasts, very large loads.

The file proves a bound that the program calls strict, and the bounds enclose the limit load if it
is known. The bounds of the search and of the proof differ by at most 1e-8, or the file names the
difference. ``PERFPLAST_FUZZ=10`` tries 300 bodies.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    Contact,
    MohrCoulomb,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    Traction,
    VonMises,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body import limit_bounds as search
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_static_bound import rectangle
from tests.random_bodies import problem_of, stack, write_stack

pytestmark = pytest.mark.serial

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "0.2"))
SIDES = ("x0", "x1", "y0", "y1")
SMALL = 1e-9
NEAR = 1e-8
"""Largest difference of proven and found bounds without a message."""


@dataclass(frozen=True)
class Extreme:
    """A problem, its description, and its limit load; None if it is not known."""

    problem: Problem
    words: str
    exact: float | None = None


def size(random: Random, decades: float, least: float = 0.0) -> float:
    """Return a number between powers of 10."""
    return float(10 ** random.uniform(least, decades))


def metal(strength: float) -> VonMises:
    """Return metal with a shear strength in plane strain."""
    return VonMises(young=1e3, poisson=0.3, yield_stress=math.sqrt(3.0) * strength)


def bar(
    random: Random, counts: tuple[int, int], length: float, layers: dict[str, Material]
) -> Problem:
    """Return stacked layers along x, under one constant pressure on all free sides.

    The first side is held, or guided by rollers. The last side is pulled, pressed, or pushed
    sideways.
    """
    number = len(layers)
    volumes = {
        name: lambda x, i=i: (x[0] > i * length / number) & (x[0] < (i + 1) * length / number)
        for i, name in enumerate(layers)
    }
    ends = {"x0": (0, 0.0), "x1": (0, length), "y0": (1, 0.0), "y1": (1, 1.0)}
    surfaces = {
        name: lambda x, a=a, at=at: abs(x[a] - at) < SMALL * max(at, 1.0)
        for name, (a, at) in ends.items()
    }
    mesh = rectangle(counts, (length, 1.0), volumes, surfaces)
    around = size(random, 6.0, -6.0) * random.choice([0.0, 1.0, 1.0])
    held = random.random() < 0.5
    supports = [Support("x0")] if held else [Support("x0", "x"), Support("y0", "y")]
    ways = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)) if held else ((1.0, 0.0), (-1.0, 0.0))
    free = ("x1", "y0", "y1") if held else ("x1", "y1")
    loads = [Pressure(side, around, constant=True) for side in free if around]
    return Problem(mesh, layers, supports, [Traction("x1", random.choice(ways)), *loads], degree=2)


def slender(random: Random, path: Path) -> Extreme:
    """Return a bar of one metal, up to a million times as long as thick, or as thick as long."""
    length = size(random, 6.0, -6.0 if random.random() < 0.3 else 0.0)
    counts = random.choice([(8, 2), (12, 2), (4, 4)])
    problem = bar(random, counts, length, {"bar": metal(1.0)})
    rolls = len(problem.given.supports) == 2
    return Extreme(problem, f"bar, {length:.1e} long", 2.0 if rolls else None)


def layered(random: Random, path: Path) -> Extreme:
    """Return glued metal layers with strengths between 1 and 1e15."""
    strengths = [size(random, 15.0) for _ in range(random.randint(2, 3))]
    layers: dict[str, Material] = {f"layer{i}": metal(s) for i, s in enumerate(strengths)}
    n = 2 * len(strengths)
    problem = bar(random, (2 * n, 2), size(random, 2.0) * len(strengths), layers)
    return Extreme(problem, f"layers, contrast {max(strengths) / min(strengths):.1e}")


def stacked(random: Random, path: Path) -> Extreme:
    """Return blocks in contact; one of them is up to 1e15 times as strong."""
    it = stack(random.randrange(10_000), 3 if random.random() < 0.15 else 2)
    it = replace(it, size=1.5 * it.size)
    write_stack(path / "stack.msh", it)
    contrast = size(random, 15.0)
    problem, exact = problem_of(it, read_gmsh(COMM, path / "stack.msh"), contrast)
    return Extreme(problem, f"stack, contrast {contrast:.1e}", exact)


def ground(random: Random, path: Path) -> Extreme:
    """Return ground between smooth planes, under pressures up to a million times its cohesion."""
    angle = random.uniform(5.0, 40.0)
    pressure = size(random, 6.0, -2.0)
    names = {name: (i // 2, float(i % 2)) for i, name in enumerate(SIDES)}
    surfaces: dict[str, Callable] = {
        name: lambda x, a=a, at=at: abs(x[a] - at) < SMALL for name, (a, at) in names.items()
    }
    mesh = rectangle((3, 3), (1.0, 1.0), {"ground": lambda x: x[0] > -1}, surfaces, shake=0.2)
    loads = [Pressure("y1", 1.0), *(Pressure(s, pressure, constant=True) for s in ("x1", "y1"))]
    problem = Problem(
        mesh,
        {"ground": MohrCoulomb(1e4, 0.3, 1.0, angle)},
        [Support("x0", "x"), Support("y0", "y")],
        loads,
        degree=2,
    )
    slope = math.tan(math.radians(45 + angle / 2))
    exact = pressure * (slope**2 - 1) + 2 * slope
    return Extreme(problem, f"ground, pressure {pressure:.1e}", exact)


def in_space(random: Random, path: Path) -> Extreme:
    """Return two blocks in contact, flat or high, one much stronger, under hydrostatic pressure."""
    heights = (size(random, 3.0, -3.0), size(random, 3.0, -3.0))
    strengths = sorted([1.0, size(random, 15.0)], key=lambda _: random.random())
    around = size(random, 6.0, -6.0)
    problem = Problem(
        stacked_blocks(COMM, 1, heights),
        {name: metal(s) for name, s in zip(("lower", "upper"), strengths, strict=True)},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0), Pressure("top", around, constant=True)],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    # the constant pressure acts only on the top, and takes its part of the limit load
    words = f"blocks in space, heights {heights[0]:.1e} and {heights[1]:.1e}, {around:.1e} stays"
    return Extreme(problem, words, math.sqrt(3.0) * min(strengths) - around)


KINDS = (slender, layered, stacked, ground, in_space)


@pytest.mark.parametrize("seed", range(max(int(30 * EFFORT), len(KINDS))))
def test_an_honest_file(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    it = KINDS[seed % len(KINDS)](Random(51_000 + seed), tmp_path)
    raw: list[BodyBounds] = []
    judge = search.proven

    def judged(bounds: BodyBounds) -> BodyBounds:
        raw.append(bounds)
        return judge(bounds)

    monkeypatch.setattr(search, "proven", judged)
    bounds = limit_bounds(it.problem, 1e-3)
    folder = ResultFolder(COMM, tmp_path)
    halves = proofs(bounds, bounds)
    checked = {}
    if halves != (None, None):
        write_proof(folder, folder.file("bounds.h5"), *halves)
        checked = check(folder.file("bounds.h5"))
    told = []
    for kind in ("lower", "upper"):
        bound, before = getattr(bounds, kind), getattr(raw[0], kind)
        assert bound.strict == (kind in checked)
        if not bound.strict:
            assert bound.why_not
            told.append(f"{kind} none: {bound.why_not[-1]}")
            continue
        half = checked[kind]
        assert not half.faults
        assert half.proven is not None
        scale = max(abs(before.value), 1e-300)
        off = (before.value - half.proven) * (1 if kind == "lower" else -1) / scale
        told.append(f"{kind} {half.proven:.9g} off {off:.1e}")
        if off > NEAR:
            assert any(
                "reduce the bound by" in w or "increase the bound by" in w for w in half.words
            )
        if it.exact is not None:
            beyond = (half.proven - it.exact) * (1 if kind == "lower" else -1)
            assert beyond <= 1e-9 * abs(it.exact)
    print("HONEST", seed, it.words, it.exact, *told, sep=" | ")
