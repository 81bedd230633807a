# %% [markdown]
# # A square plate with a square hole, in plane strain
#
# A plate of width L = 10 with a hole of width D = 5 in its middle is pulled along y. With
# k = σ_y/√3 its limit load is at most
#
#     2k (1 − D/L) = k,
#
# because the narrowest section carries at most the stress 2k. The plate collapses at a smaller
# load, because the frame around the hole bends: each quarter of the frame rotates about a plastic
# hinge in each of its two arms. A hinge is a pair of triangles with uniform strain at the axis of
# symmetry. The triangles meet at the centre of rotation, and fill the lengths s and a − s of the
# arm, where a = (L − D)/2. If the quarter rotates at unit speed, the triangles dissipate 2k times
# their areas. Let s belong to the arm beside the hole, and t to the arm above the hole, both
# measured from the outside. Then the mechanism gives the upper bound
#
#     2k [s² + (a − s)² + t² + (a − t)²] / [L²/4 − L s − t²],
#
# which is least for s = 0.28 and t = 1.05, where it is 0.7785 k. No better mechanism is known to
# us; the limit loads for quadratic elements converge to this bound from above. Linear triangles
# lock.
#
# The plate has also been published as a 3D slice of thickness 1 that is held in z, with linear
# tetrahedra in cubes (a quarter of a plate that is twice as large, `l_plate` here). These
# tetrahedra cannot represent the rotation at constant volume: for any refinement, the limit load of
# the slice is k.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/plate_with_hole.py

# %%
import math
from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

from scipy.optimize import minimize

from demos.verification.slip import draw_slip
from demos.verification.study import Row, collapse, mesh, run
from meshes.plate_with_hole import HOLE, WIDTH, write_plate_with_hole
from perfplast_fenicsx import Problem, Support, Traction, VonMises, l_plate
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Plate with a hole, plane strain"
MATERIAL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
K = MATERIAL.yield_stress / math.sqrt(3)
BOUND = 2 * K * (1 - HOLE / WIDTH)
SUPPORTS = [Support("x0", "x"), Support("y0", "y")]
LOADS = [Traction("top", (0.0, 1.0))]
ROUNDING = 1e-4
"""Relative tolerance of the limit loads."""
NEAR = 0.005
"""Largest relative distance of limit loads with quadratic elements from the bound of the hinges."""
FALLS = 0.8
"""Largest ratio of the distance on the finest mesh to the distance on the coarsest mesh."""


def hinges() -> float:
    """Return the upper bound by the mechanism with two hinges."""
    arm, square = WIDTH - HOLE, WIDTH**2

    def bound(parts: Sequence[float]) -> float:
        s, t = parts
        areas = s**2 + (arm - s) ** 2 + t**2 + (arm - t) ** 2
        return 2 * K * areas / (square - 2 * WIDTH * s - t**2)

    return float(minimize(bound, [0.3, 1.0]).fun)


# %%
def plane(folder: ResultFolder, size: float, degree: int) -> Problem:
    """Return a quarter of the plate. Collective."""
    tagged_mesh = mesh(folder, write_plate_with_hole, size=size)
    return Problem(tagged_mesh, {"plate": MATERIAL}, SUPPORTS, LOADS, degree=degree)


def slice_in_space(comm: MPI.Intracomm, cubes: int) -> Problem:
    """Return a quarter of a slice of the plate, ``cubes`` cubes thick. Collective."""
    supports = [*SUPPORTS, Support("z0", "z"), Support("z1", "z")]
    loads = [Traction("top", (0.0, 1.0, 0.0))]
    return Problem(l_plate(comm, cubes), {"plate": MATERIAL}, supports, loads)


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the limit loads of plate and slice. Collective."""
    rows = []
    for degree, sizes in ((1, (1.0, 0.5, 0.25)), (2, (1.0, 0.5, 0.25, 0.125))):
        for size in sizes[:2] if coarse else sizes:
            problem = plane(folder, size, degree)
            found = collapse(problem)
            rows.append(found.row("plate with hole", size, BOUND, ROUNDING, bound=True))
    found.write(folder, Scene(TITLE, LOADS))
    draw(folder)
    draw_slip(folder, TITLE)
    rows += against_hinges([row for row in rows if row.element == "P2"])
    for cubes in (1,) if coarse else (1, 2):
        problem = slice_in_space(comm, cubes)
        found = collapse(problem)
        rows.append(found.row("3D slice", 0.5 / cubes, BOUND, ROUNDING, bound=True))
    return rows


# %% [markdown]
# The next function compares the same limit loads with the bound of the hinges, and the distance on
# the finest mesh with the distance on the coarsest mesh.


# %%
def against_hinges(rows: Sequence[Row]) -> list[Row]:
    """Return rows that compare limit loads on a sequence of meshes with the bound of the hinges."""
    exact = hinges()
    near = [
        replace(
            row,
            quantity="against hinges",
            exact=exact,
            allowed=NEAR,
            bound=False,
            factorisations=None,
            bracket="",
        )
        for row in rows
    ]
    left = abs(near[-1].error / near[0].error)
    name = "distance, finest/coarsest"
    ratio = replace(near[-1], quantity=name, bound=True, computed=left, exact=FALLS, allowed=0.0)
    return [replace(row, solves=0, seconds=0.0) for row in (*near, ratio)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
