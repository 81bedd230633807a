# %% [markdown]
# # Bounds for ground in 3D
#
# The demo computes strict bounds for associated Mohr–Coulomb ground and for Tresca ground in 3D.
#
# - An octant of a **thick sphere** of radii 1 and 2 under pressure, with c = 10 and φ = 10°. The
#   exact limit load is c cot φ (2^m − 1) with m = 4 sin φ/(1 + sin φ). Facets are flat, so each
#   bound has a separate mesh, as for the sphere in `bounds_in_space.py`. This is valid because
#   ground carries an equal pressure on all its sides, and plastic flow never decreases its volume.
# - An octant of a **cube between rough platens** with φ = 20° and c = 1. The result is the mean
#   pressure. A prototype with different elements gave 2.941 … 3.349.
# - A quarter of a **square rough footing** 2×2 on Tresca ground with c = 1. Published bounds are
#   5.523 and 6.221 (R. Salgado, A. V. Lyamin, S. W. Sloan, H. S. Yu, Géotechnique 54 (2004), 297).
#   The bracket must overlap the published bracket, and must not be wider. The ground measures 6 by
#   6 by 2, and its bottom and sides are held.
#
# Platens and footings are rigid surfaces, glued to the ground.
#
#     ./fenicsx python3 demos/verification/ground_in_space.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.rough_cube import HALF, write_rough_cube
from meshes.square_footing import write_square_footing
from meshes.thick_sphere import INNER, OUTER, write_thick_sphere
from perfplast_fenicsx import (
    Adaptation,
    Force,
    MohrCoulomb,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Tresca,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import AdaptiveBounds

TITLE = "Ground in 3D from both sides"
RTOL = 1e-3
"""Tolerance of each bound on its mesh, much smaller than the gaps."""
SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
SIZES = {"inner": 0.12, "outer": 0.14}
"""Edge lengths of the sphere's elements, for the lower and the upper bound."""
PROTOTYPE = 2.941, 3.349
PUBLISHED = 5.523, 6.221
ONE_MESH = 1
"""Largest number of cells, so small that only the first mesh is used."""


# %%
def sphere(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds for the sphere from an inner and an outer polyhedron. Collective."""
    began, found = time.perf_counter(), list[AdaptiveBounds]()
    for surface, size in SIZES.items():
        shell = mesh(
            folder, write_thick_sphere, size=0.4 if coarse else size, circumscribed=surface
        )
        problem = Problem(
            shell,
            {"shell": MohrCoulomb(1e4, 0.3, 10.0, 10.0)},
            [*SYMMETRY, Support("z0", "z")],
            [Pressure("inner", 1.0)],
            degree=2,
        )
        found.append(adaptive_bounds(problem, Adaptation(0.01, ONE_MESH), RTOL))
    both = replace(found[1], low=found[0].low)
    low, high = ends(both)
    sine = math.sin(math.radians(10.0))
    power = (OUTER / INNER) ** (4 * sine / (1 + sine))
    exact = 10.0 / math.tan(math.radians(10.0)) * (power - 1)
    told = [("below, exact", low, exact), ("exact, above", exact, high)]
    told += [("gap in %", 100 * (high / low - 1), 40.0 if coarse else 5.0)]
    return at_most("thick sphere, φ 10°", both, time.perf_counter() - began, told)


def cube(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds on the mean pressure on the cube between rough platens. Collective."""
    began, percent = time.perf_counter(), 30.0 if coarse else 6.0
    octant = mesh(folder, write_rough_cube, size=0.25 if coarse else 0.125, platen=False)
    problem = Problem(
        octant,
        {"cube": MohrCoulomb(1e3, 0.3, 1.0, 20.0)},
        [*SYMMETRY, Support("z0", "z"), RigidSurface("top", held="xy")],
        [Force("top", (0.0, 0.0, -(HALF**2)))],
        degree=2,
    )
    cells = ONE_MESH if coarse else 2000
    found = adaptive_bounds(problem, Adaptation(percent / 100, cells), RTOL)
    low, high = ends(found)
    told = [("gap in %", 100 * (high / low - 1), percent)]
    if not coarse:
        told += [("prototype, below", PROTOTYPE[0], low), ("above, prototype", high, PROTOTYPE[1])]
    show_bounds(subfolder(folder, "cube"), "Cube between rough platens", found)
    return at_most("rough cube, φ 20°", found, time.perf_counter() - began, told)


def footing(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds on the mean pressure under the square footing. Collective."""
    began = time.perf_counter()
    lowest, highest = PUBLISHED
    percent = 60.0 if coarse else 200 * (highest - lowest) / (highest + lowest)
    ground = mesh(folder, write_square_footing, cells=2 if coarse else 6)
    problem = Problem(
        ground,
        {"ground": Tresca(1e3, 0.3, 1.0)},
        [*SYMMETRY, Support("bottom"), Support("sides"), RigidSurface("footing", held="xy")],
        [Force("footing", (0.0, 0.0, -1.0))],
        degree=2,
    )
    asked = Adaptation(0.5, ONE_MESH) if coarse else Adaptation(0.12, 6000)
    found = adaptive_bounds(problem, asked, RTOL)
    low, high = ends(found)
    told = [("gap in %", 100 * (high / low - 1), percent)]
    told += [("below, published above", low, highest), ("published below, above", lowest, high)]
    show_bounds(subfolder(folder, "footing"), "Square rough footing", found)
    return at_most("square rough footing, Tresca", found, time.perf_counter() - began, told)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return brackets with the exact or published values. Collective."""
    return [row for case in (sphere, cube, footing) for row in case(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
