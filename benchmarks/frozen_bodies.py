"""Compute bounds for 55 small problems, and compare them with stored bounds.

./fenicsx python3 -m benchmarks.frozen_bodies             # compare with frozen_bodies.json
./fenicsx python3 -m benchmarks.frozen_bodies --freeze    # write that file
./fenicsx python3 -m benchmarks.frozen_bodies --only ring --sweeps 3

A change of the interior point method is accepted if each bound agrees to a relative 1e-8, and if no
problem takes more steps. The output also gives the ratio of new to stored processor times. The
machine may have been in another state when the stored times were measured. For a fair comparison,
run the previous commit on the same machine with ``--freeze other.json``, and then the new commit
with ``--against other.json``. The exit status is 1 if a bound differs, or if a number of steps is
larger.

The stored bounds hold for one rank and one processor type, because the last steps of an iteration
amplify rounding errors.
"""

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.limit_cases import ROLLERS, STEEL, ground
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Force,
    Hill,
    LoadDomain,
    MohrCoulomb,
    Plane,
    PorePressure,
    Pressure,
    Problem,
    Rigid,
    RigidSurface,
    Support,
    Tie,
    Traction,
    Tresca,
    VonMises,
    envelope,
    factor_of_safety,
    limit_bounds,
    punch,
    shakedown_load,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import Progress, interior_point
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_static_bound import rectangle
from tests.stones import box, stones, weight_and

COMM = MPI.COMM_WORLD
FILE = Path(__file__).with_suffix(".json")
SAME = 1e-8
"""Relative difference below which two values count as equal."""

Row = dict[str, Any]
STRONG = VonMises(2e5, 0.3, 900.0)
CLAY = Tresca(1e4, 0.3, 10.0)
SAND, LOOSE = MohrCoulomb(1e4, 0.3, 10.0, 30.0), MohrCoulomb(1e4, 0.3, 0.0, 30.0)
CUT = MohrCoulomb(1e4, 0.3, 10.0, 25.0, tensile_strength=3.0)
SHEET = Hill(2e5, 0.3, 300.0, 1.0, 0.953, 1.195, 0.8, 1.3, 1.1, 25.0)
ROCK = ground(25.0, "compression")
SEAM = ("lower_top", "upper_bottom")
JOINED: dict[str, Any] = {"contacts": [Tie(*SEAM)]}
DOWN, PRESSED = BodyForce("ground", (0.0, -1.0)), Pressure("footing", 1.0)
HEAVY = BodyForce("ground", (0.0, -20.0), constant=True)
PULL = Traction("top", (0.0, 0.0, 1.0), name="pull")


def strip(law: Any, *loads: Any, rigid: Any = (), degree: int = 2, **more: Any) -> Problem:
    """Return the problem of half a strip footing; the plane of symmetry is on the left."""
    surfaces: dict[str, Any] = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 3 - 1e-9,
        "bottom": lambda x: x[1] < 1e-9,
        "footing": lambda x: (x[1] > 1.5 - 1e-9) & (x[0] < 1 + 1e-9),
        "beside": lambda x: (x[1] > 1.5 - 1e-9) & (x[0] > 1 - 1e-9),
    }
    mesh = rectangle((6, 3), (3.0, 1.5), {"ground": lambda x: x[1] < 2}, surfaces, shake=0.1)
    held = [Support("left", "x"), Support("right", "x"), Support("bottom")]
    loads = loads or (PRESSED,)
    return Problem(mesh, {"ground": law}, [*held, *rigid], loads, degree=degree, **more)


def bank(law: Any, *loads: Any) -> Problem:
    """Return the problem of a vertical cut of height 1, held at its bottom and back."""
    surfaces: dict[str, Any] = {
        "back": lambda x: x[0] < 1e-9,
        "bottom": lambda x: x[1] < 1e-9,
        "footing": lambda x: x[1] > 1 - 1e-9,
    }
    mesh = rectangle((5, 4), (1.25, 1.0), {"ground": lambda x: x[1] < 2}, surfaces, shake=0.1)
    held = [Support("back", "x"), Support("bottom")]
    return Problem(mesh, {"ground": law}, held, loads or (DOWN,), degree=2)


def square(law: Any, *loads: Any, thin: bool = False) -> Problem:
    """Return the problem of a quarter of a square whose middle has a quarter of the strength."""
    surfaces: dict[str, Any] = {
        "x0": lambda x: x[0] < 1e-9,
        "y0": lambda x: x[1] < 1e-9,
        "x1": lambda x: x[0] > 1 - 1e-9,
        "y1": lambda x: x[1] > 1 - 1e-9,
    }
    bodies: dict[str, Any] = {
        "sheet": lambda x: x[1] < 2,
        "weak": lambda x: (x[0] < 0.5) & (x[1] < 0.5),
    }
    mesh = rectangle((4, 4), (1.0, 1.0), bodies, surfaces)
    strengths = [name for name in ("yield_stress", "cohesion") if hasattr(law, name)]
    weak = replace(law, **{name: getattr(law, name) / 4 for name in strengths})
    held = [Support("x0", "x"), Support("y0", "y")]
    laws = {"sheet": law, "weak": weak}
    return Problem(mesh.thin() if thin else mesh, laws, held, loads, degree=2)


def pushed(n: int, slope: float = 0.0, gdim: int = 2, moved: float = 0.5, **rubs: Any) -> Problem:
    """Return two blocks; a pressure of 10 and a growing traction act on the upper block."""
    mesh = blocks_apart(COMM, [n] * gdim, [n] * gdim, moved_by=moved, slope=slope)
    push = Traction("top", (1.0, 0.0) if gdim == 2 else (0.8, 0.6, 0.0))
    return Problem(
        mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [Pressure("top", 10.0, constant=True), push],
        [Contact(*SEAM, **rubs)],
        degree=2,
    )


def pressed(lower: int, upper: int, **rubs: Any) -> Problem:
    """Return the problem of a strong block that is pressed on a weak block."""
    return Problem(
        blocks_apart(COMM, [lower, lower], [upper, upper], moved_by=0.0),
        {"lower": VonMises(2e5, 0.3, 100.0), "upper": STRONG},
        [Support("x0", "x"), Support("upper_x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact(*SEAM, **rubs)],
        degree=2,
    )


def disc(law: Any, *loads: Any, **rubs: Any) -> Problem:
    """Return the problem of a disc around the axis x = 0 on a rigid floor, with a load on top."""
    surfaces: dict[str, Any] = {
        "bottom": lambda x: x[1] < 1e-9,
        "side": lambda x: x[0] > 1 - 1e-9,
        "top": lambda x: x[1] > 0.5 - 1e-9,
    }
    mesh = rectangle((6, 3), (1.0, 0.5), {"disc": lambda x: x[1] < 2}, surfaces, shake=0.1)
    floor = Plane("bottom", [0.0, 0.0], [0.0, 1.0], name="floor", **rubs)
    loads = loads or (Traction("top", [0.0, -1.0]),)
    return Problem(mesh.turned(), {"disc": law}, [], loads, [], [floor], degree=2)


def blocks(lower: Any, upper: Any, *loads: Any, n: int = 1, **more: Any) -> Problem:
    """Return two stacked blocks in contact; arguments in ``more`` replace the contact."""
    more = more or {"contacts": [Contact(*SEAM)]}
    laws, loads = {"lower": lower, "upper": upper}, loads or (Pressure("top", 1.0),)
    return Problem(stacked_blocks(COMM, n), laws, ROLLERS, loads, degree=2, **more)


def stamped(base: Any, stamp: Any, degree: int = 2, **rubs: Any) -> Problem:
    """Return the problem of a quarter of a square punch on a block."""
    return Problem(
        punch(COMM, 2),
        {"base": base, "punch": stamp},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
        [Pressure("top", 1.0)],
        [Contact("punch_bottom", "base_top", **rubs)],
        degree=degree,
    )


def stone(mu: float) -> Problem:
    """Return a rigid stone on a fixed stone, under its weight and a growing force to the right."""
    mesh = stones(COMM, [box([0, -1], [1, 0]), box([0, 0], [1, 2])], (3, 2))
    laws: Any = {"0": Rigid(), "1": Rigid()}
    loads = weight_and(mesh, [1.0, 0.0], ["0"])
    joint = Contact("0_y1", "1_y0", associated=True, coulomb=mu)
    return Problem(mesh, laws, [Support("0_y0")], loads, [joint], degree=2)


def strict(problem: Problem) -> Row:
    """Return strict bounds on the limit load of the body, and the numbers of steps."""
    found = limit_bounds(problem)
    return {
        "lower": found.lower.value,
        "upper": found.upper.value,
        "steps": found.steps,
        "factorisations": found.factorisations,
    }


def of_mesh(problem: Problem) -> Row:
    """Return both bounds on the limit load of the mesh, and the numbers of steps."""
    found = interior_point(problem)
    return {
        "lower": found.lower,
        "upper": found.upper,
        "steps": found.iterations,
        "factorisations": found.factorisations,
    }


def factor(problem: Problem) -> Row:
    """Return both bounds on the factor of safety, and the number of steps."""
    steps: list[Any] = []
    found = factor_of_safety(problem, 1e-2, steps=steps.append)
    return {"lower": found.lower, "upper": found.upper, "steps": len(steps)}


def diagram(problem: Problem, *loads: Any) -> Row:
    """Return radii of both polygons of an interaction diagram, summed over rays, and the steps."""
    steps: list[Any] = []
    found = envelope(
        problem, [[load] for load in loads], 3, 0.01, progress=Progress(steps=steps.append)
    )
    rays = np.arange(5.0, 90.0, 20.0).tolist()
    inner, outer = sum(map(found.inner, rays)), sum(map(found.outer, rays))
    return {"lower": inner, "upper": outer, "steps": len(steps)}


def shaken(problem: Problem, **ranges: tuple[float, float]) -> Row:
    """Return both bounds on the shakedown load of the mesh, and the numbers of steps."""
    found = shakedown_load(problem, LoadDomain.of_ranges(ranges))
    return {
        "lower": found.load,
        "upper": found.upper,
        "steps": found.steps,
        "factorisations": found.factorisations,
    }


LATERAL = [Pressure("x1", 1.0), Pressure("y1", 0.3)]
TWO_WAYS = [Pressure("x1", -1.0, name="x"), Pressure("y1", -1.0, name="y")]

BODIES: dict[str, Callable[[], Row]] = {
    "plane: strip, von Mises": lambda: strict(strip(STEEL)),
    "plane: strip, Drucker-Prager 10": lambda: strict(strip(ground(10.0))),
    "plane: strip, Mohr-Coulomb 30": lambda: strict(strip(SAND)),
    "plane: strip, Tresca": lambda: strict(strip(CLAY)),
    "plane: strip, Hill": lambda: strict(strip(SHEET)),
    "plane: strip, cut off": lambda: strict(strip(CUT)),
    "plane: strip, cut-off clay": lambda: strict(strip(replace(CLAY, tensile_strength=1.0))),
    "plane: strip, surcharge, no cohesion": lambda: strict(
        strip(LOOSE, PRESSED, Pressure("beside", 1.0, constant=True))
    ),
    "plane: strip, weight": lambda: strict(strip(SAND, PRESSED, HEAVY)),
    "plane: strip, pore pressure": lambda: strict(
        strip(SAND, PRESSED, HEAVY, PorePressure("ground", "10*(1.5 - y)", constant=True))
    ),
    "plane: strip, less dilatancy": lambda: strict(
        strip(replace(SAND, dilatancy_angle=15.0, nonassociated="radenkovic"))
    ),
    "plane: strip, rigid": lambda: strict(
        strip(CLAY, Force("footing", (0.0, -1.0)), rigid=[RigidSurface("footing", held="x")])
    ),
    "plane: strip, mesh": lambda: of_mesh(strip(STEEL)),
    "plane: strip, mesh, linear": lambda: of_mesh(strip(SAND, degree=1)),
    "plane: cut, von Mises": lambda: strict(bank(STEEL)),
    "plane: cut, Mohr-Coulomb": lambda: strict(bank(SAND)),
    "plane: cut, cut off, mesh": lambda: of_mesh(bank(CUT)),
    "plane: square, two strengths": lambda: strict(square(STEEL, *LATERAL)),
    "plane: square, Tresca, mesh": lambda: of_mesh(square(CLAY, *LATERAL)),
    "sheet: square, von Mises": lambda: strict(square(STEEL, *LATERAL, thin=True)),
    "sheet: square, Hill, mesh": lambda: of_mesh(square(SHEET, *LATERAL, thin=True)),
    "plane: pressed, frictionless": lambda: strict(pressed(3, 3)),
    "plane: pressed, unequal meshes": lambda: strict(pressed(3, 2)),
    "plane: pressed, Tresca's friction": lambda: strict(pressed(3, 3, tresca=20.0)),
    "plane: pressed, Coulomb": lambda: strict(pressed(3, 3, coulomb=0.3)),
    "plane: pressed, associated": lambda: strict(pressed(3, 3, coulomb=0.3, associated=True)),
    "plane: pushed, Coulomb": lambda: strict(pushed(3, coulomb=0.3)),
    "plane: pushed, associated": lambda: strict(pushed(3, moved=0.0, coulomb=0.3, associated=True)),
    "plane: pushed, associated, inclined, adhesion": lambda: strict(
        pushed(3, 0.2, moved=0.0, coulomb=0.3, tresca=2.0, associated=True)
    ),
    "plane: stones": lambda: strict(stone(0.7)),
    "ring: disc, frictionless": lambda: strict(disc(STEEL)),
    "ring: disc, Tresca's friction": lambda: strict(disc(STEEL, tresca=50.0)),
    "ring: disc, constant load": lambda: strict(
        disc(STEEL, Traction("top", [0.0, -1.0]), Pressure("side", 50.0, constant=True))
    ),
    "ring: disc, Drucker-Prager, mesh": lambda: of_mesh(disc(ROCK)),
    "ring: disc, Tresca, mesh": lambda: of_mesh(disc(CLAY)),
    "space: blocks, contact": lambda: strict(blocks(STEEL, STRONG)),
    "space: blocks, tie": lambda: strict(blocks(ROCK, STEEL, **JOINED)),
    "space: blocks, elastic": lambda: strict(blocks(STEEL, Elastic(2e5, 0.3))),
    "space: blocks, constant load": lambda: strict(
        blocks(STEEL, STRONG, Pressure("top", 1.0), BodyForce("lower", (0, 0, -5.0), constant=True))
    ),
    "space: blocks, Mohr-Coulomb": lambda: strict(blocks(SAND, STEEL, **JOINED)),
    "space: blocks, Tresca": lambda: strict(blocks(CLAY, SAND, **JOINED)),
    "space: blocks, cut off": lambda: strict(blocks(CUT, CUT, Pressure("top", -1.0), **JOINED)),
    "space: blocks, Hill": lambda: strict(blocks(SHEET, Elastic(2e5, 0.3))),
    "space: punch, frictionless, mesh": lambda: of_mesh(stamped(STEEL, STRONG)),
    "space: punch, Tresca's friction, mesh": lambda: of_mesh(stamped(CLAY, STRONG, tresca=5.0)),
    "space: punch, linear, mesh": lambda: of_mesh(stamped(SAND, STRONG, degree=1)),
    "space: pushed, Tresca's friction, mesh": lambda: of_mesh(pushed(1, gdim=3, tresca=3.0)),
    "factor: cut, von Mises": lambda: factor(
        bank(VonMises(1e4, 0.3, 10.0), replace(DOWN, constant=True))
    ),
    "factor: cut, Mohr-Coulomb": lambda: factor(bank(SAND, HEAVY)),
    "factor: cut, Drucker-Prager": lambda: factor(bank(ground(20.0), HEAVY)),
    "envelope: sheet": lambda: diagram(square(STEEL, *TWO_WAYS[:1], thin=True), *TWO_WAYS),
    "envelope: square": lambda: diagram(square(SAND, *TWO_WAYS[:1]), *TWO_WAYS),
    "shakedown: blocks, von Mises": lambda: shaken(
        blocks(STEEL, STRONG, PULL, **JOINED), pull=(-0.5, 1.0)
    ),
    "shakedown: blocks, Drucker-Prager": lambda: shaken(
        blocks(ROCK, ROCK, PULL, **JOINED), pull=(-1.0, 0.5)
    ),
    "shakedown: square, two loads": lambda: shaken(
        square(STEEL, *TWO_WAYS), x=(0.0, 1.0), y=(-0.5, 1.0)
    ),
}
"""Functions that compute the bounds of each problem, by its name."""


@dataclass(frozen=True)
class Change:
    """The differences between the new and the stored result of a problem.

    Attributes:
        name: Name of the problem.
        apart: Largest relative difference of a bound; ∞ if only one result contains the bound.
        steps: New number of steps minus the stored number; the larger difference if the result
            also counts factorisations.
        seconds: New processor time divided by the stored processor time.
    """

    name: str
    apart: float
    steps: int
    seconds: float

    @property
    def worse(self) -> bool:
        """Return whether a bound differs or a number of steps is larger."""
        return self.apart > SAME or self.steps > 0


def solved(name: str, sweeps: int) -> Row:
    """Return the result of a problem, with the least processor time of all sweeps. Collective."""
    spent = []
    for _ in range(sweeps):
        began = time.process_time()
        row = BODIES[name]()
        spent.append(time.process_time() - began)
    return row | {"seconds": round(min(spent), 3)}


def changed(name: str, before: Row, after: Row) -> Change:
    """Return the differences between two results of a problem."""
    apart = max(_apart(before[key], after[key]) for key in ("lower", "upper"))
    counts = [key for key in ("steps", "factorisations") if key in before]
    more = max(after[key] - before[key] for key in counts)
    return Change(name, apart, more, after["seconds"] / before["seconds"])


def _apart(one: float | None, other: float | None) -> float:
    if one is None or other is None:
        return 0.0 if one is other else math.inf
    return 0.0 if one == other else abs(one - other) / max(abs(one), abs(other))


def main() -> None:
    """Compute the bounds that the command line selects; store them, or compare them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--freeze", type=Path, nargs="?", const=FILE, help="write, do not compare")
    parser.add_argument("--against", type=Path, default=FILE, help="the file to compare with")
    parser.add_argument("--only", default="", help="part of the names of the bodies to solve")
    parser.add_argument("--sweeps", type=int, default=1, help="solve each so often, count the best")
    arguments = parser.parse_args()
    chosen = [name for name in BODIES if arguments.only in name]
    known = {} if arguments.freeze else json.loads(arguments.against.read_text())
    solved(chosen[0], 1)  # so that no measured time includes compilation
    found, changes = {}, []
    for name in chosen:
        row = found[name] = solved(name, arguments.sweeps)
        told = f"{name}: " + ", ".join(f"{key} {value}" for key, value in row.items())
        if name in known:
            changes.append(changed(name, known[name], row))
            it = changes[-1]
            told += f"; {it.apart:.0e} apart, {it.steps:+d} steps, {it.seconds:.2f} times the time"
            told += " WORSE" if it.worse else ""
        print(told, flush=True)
    if arguments.freeze:
        arguments.freeze.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return
    spent = [sum(rows[it.name]["seconds"] for it in changes) for rows in (known, found)]
    worse = [it.name for it in changes if it.worse]
    print(f"{len(changes)} bodies, {len(worse)} worse: {', '.join(worse) or 'none'}")
    ratios = statistics.median(it.seconds for it in changes)
    print(f"{spent[1]:.1f} s for {spent[0]:.1f} s of processor time; median ratio {ratios:.2f}")
    sys.exit(bool(worse))


if __name__ == "__main__":
    main()
