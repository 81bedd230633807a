"""Compare limit loads and bounds of fifteen cases before and after a change of the method.

./fenicsx python3 -m benchmarks.limit_cases -o before.json      (on the first commit)
./fenicsx python3 -m benchmarks.limit_cases -o after.json       (on the second commit)
./fenicsx python3 -m benchmarks.limit_cases --compare before.json after.json
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    Elastic,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Tie,
    VonMises,
    punch,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point

COMM = MPI.COMM_WORLD
STEEL, STRONG = VonMises(2e5, 0.3, 300.0), VonMises(2e5, 0.3, 900.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
ON_GROUND = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
SEAM = [Contact("lower_top", "upper_bottom")]


def ground(angle: float, match: str = "plane-strain") -> DruckerPrager:
    """Return Drucker–Prager ground with a friction angle (degrees) and a cohesion of 10."""
    return DruckerPrager(1e4, 0.3, 10.0, angle, match)  # type: ignore[arg-type]


def meshed(write: Callable[..., None], axisymmetric: bool = False, **sizes: Any) -> TaggedMesh:
    """Return the mesh that a generator writes. Collective."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(COMM.bcast(folder)) / "mesh.msh"
        if COMM.rank == 0:
            write(place, **sizes)
        COMM.barrier()
        found = read_gmsh(COMM, place)
        COMM.barrier()
    return found.turned() if axisymmetric else found


def footing(material: Any, size: float = 0.5) -> Problem:
    """Return the problem of a smooth strip footing. Collective."""
    tagged_mesh = meshed(write_strip_footing, width=6.0, depth=3.0, grading=1.0, size=size)
    return Problem(
        tagged_mesh, {"ground": material}, ON_GROUND, [Pressure("footing", 1.0)], degree=2
    )


def blocks(lower: Any, upper: Any, n: int = 2, **more: Any) -> Problem:
    """Return the problem of two stacked blocks; ``more`` replaces loads, contacts or degree."""
    arguments: dict[str, Any] = {
        "contacts": SEAM,
        "loads": [Pressure("top", 1.0)],
        "degree": 2,
    } | more
    return Problem(stacked_blocks(COMM, n), {"lower": lower, "upper": upper}, ROLLERS, **arguments)


def tube(material: Any, *loads: Any, size: float = 0.15) -> Problem:
    """Return the problem of a quarter of a thick tube on curved cells. Collective."""
    tagged_mesh = meshed(write_thick_tube, outer=2.0, interface=None, size=size, order=2)
    volumes = dict.fromkeys(tagged_mesh.volumes, material)
    return Problem(tagged_mesh, volumes, SYMMETRY, list(loads), degree=2)


def sphere(material: Any) -> Problem:
    """Return the problem of half a section of a thick sphere under inner pressure. Collective."""
    tagged_mesh = meshed(write_thick_tube, axisymmetric=True, outer=2.0, size=0.15, order=2)
    volumes = dict.fromkeys(tagged_mesh.volumes, material)
    return Problem(tagged_mesh, volumes, SYMMETRY[1:], [Pressure("inner", 1.0)], degree=2)


def punched(base: Any, stamp: Any, **more: Any) -> Problem:
    """Return the problem of a quarter of a square punch on a block."""
    supports = [*SYMMETRY, Support("bottom")]
    return Problem(
        punch(COMM, 2),
        {"base": base, "punch": stamp},
        supports,
        [Pressure("top", 1.0)],
        [Contact("punch_bottom", "base_top", **more)],
        degree=2,
    )


OUTSIDE = Pressure("outer", 20.0, constant=True)
HEAVY = BodyForce("lower", (0.0, 0.0, -5.0), constant=True)
TIED = [Tie("lower_top", "upper_bottom")]

CASES: dict[str, tuple[Callable[[], Problem], bool]] = {
    "plane: footing, steel": (lambda: footing(STEEL), True),
    "plane: footing, ground 10": (lambda: footing(ground(10.0)), True),
    "plane: footing, ground 30": (lambda: footing(ground(30.0)), True),
    "plane: tube, steel": (lambda: tube(STEEL, Pressure("inner", 1.0)), False),
    "plane: tube, ground 20, dead": (
        lambda: tube(ground(20.0), Pressure("inner", 1.0), OUTSIDE),
        False,
    ),
    "axisymmetric: sphere, steel": (lambda: sphere(STEEL), False),
    "axisymmetric: sphere, ground": (lambda: sphere(ground(30.0, "compression")), False),
    "space: blocks, contact": (lambda: blocks(STEEL, STRONG), True),
    "space: blocks, elastic part": (lambda: blocks(STEEL, Elastic(2e5, 0.3)), True),
    "space: blocks, tie": (lambda: blocks(STEEL, STRONG, contacts=TIED), True),
    "space: blocks, ground and steel": (lambda: blocks(ground(25.0, "compression"), STEEL), True),
    "space: blocks, dead load": (
        lambda: blocks(STEEL, STRONG, loads=[Pressure("top", 1.0), HEAVY]),
        True,
    ),
    "space: punch": (lambda: punched(STEEL, STRONG), True),
    "space: punch, elastic": (lambda: punched(STEEL, Elastic(2e5, 0.3)), False),
    "space: punch, Tresca's friction": (lambda: punched(STEEL, STRONG, tresca=50.0), False),
}
"""Function that makes each problem, and whether strict bounds of its body are also computed."""


def run(case: str) -> dict[str, Any]:
    """Return bounds, numbers of steps and processor time (s) of a case. Collective."""
    make, strictly = CASES[case]
    problem, began = make(), time.process_time()
    found = interior_point(problem)
    numbers: dict[str, Any] = {
        "lower": found.lower,
        "upper": found.upper,
        "steps": len(found.steps),
        "factorisations": found.factorisations,
    }
    if strictly:
        bounds = limit_bounds(problem)
        numbers |= {
            "strict_lower": bounds.lower.value if bounds.lower.strict else None,
            "strict_upper": bounds.upper.value if bounds.upper.strict else None,
            "strict_steps": bounds.steps,
        }
    return numbers | {"seconds": time.process_time() - began}


def compare(before: Path, after: Path) -> None:
    """Print the bounds after the change, their largest relative difference, steps and times."""
    one, other = (json.loads(path.read_text()) for path in (before, after))
    for case in CASES:
        a, b = one[case], other[case]
        bounds = [key for key in a if "lower" in key or "upper" in key]
        told = [f"{key} {b[key]:.10g}" for key in bounds if b[key] is not None]
        apart = max(_apart(a[key], b[key]) for key in bounds)
        counts = [f"{a[key]}/{b[key]}" for key in a if "steps" in key or key == "factorisations"]
        seconds = f"{a['seconds']:.2f} s/{b['seconds']:.2f} s"
        print(f"{case}: {', '.join(told)}; {apart:.0e}; {', '.join(counts)}; {seconds}")


def _apart(a: float | None, b: float | None) -> float:
    if a is None or b is None:
        return 0.0 if a is b else float("inf")
    return abs(b - a) / abs(a)


def main() -> None:
    """Run the cases, or compare two stored records, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--compare", type=Path, nargs=2)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    if arguments.compare:
        return compare(*arguments.compare)
    found = {}
    for case in CASES:
        if arguments.only in case:
            found[case] = run(case)
            print(case, found[case], flush=True)
    if arguments.output and COMM.rank == 0:
        arguments.output.write_text(json.dumps(found, indent=1) + "\n")
    return None


if __name__ == "__main__":
    main()
