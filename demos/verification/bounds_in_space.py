# %% [markdown]
# # Bounds for the body, in 3D
#
# The demo brackets the limit loads of three bodies whose shear yield stress is 1. Each cell is
# split at its centre; the numbers of cells below count cells before the split.
#
# - An octant of a **thick sphere** with radii 1 and 2 under pressure, whose exact limit load is 2√3
#   ln 2 (R. Hill, The Mathematical Theory of Plasticity, Oxford 1950, chapter V). Facets are flat,
#   so each bound has a separate mesh, as for the tube in plane strain. For the lower bound, the
#   inner facets touch the inner sphere from outside, and the outer facets have their vertices on
#   the outer sphere. In the remaining inner part of the shell, the stress is hydrostatic and equal
#   to the pressure. For the upper bound the roles of the two spheres are reversed: the body that
#   flows is larger than the shell.
# - An octant of a **cube between rough platens**; the platen is elastic and glued to the cube.
# - A quarter of a smooth **square punch** on a block of ground whose bottom and outer sides are
#   held. The punch is an elastic body in frictionless contact.
#
# The limit loads of the last two bodies are not known. For these bodies the demo prescribes only
# the first mesh, and both bounds determine which cells are divided.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/bounds_in_space.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

from demos.verification.body_bounds import rows_of
from demos.verification.bounded_bodies import GROUND, Case
from demos.verification.published import show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, run
from meshes.rough_cube import write_rough_cube
from meshes.square_punch import write_square_punch
from meshes.thick_sphere import INNER, OUTER, write_thick_sphere
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Elastic,
    Pressure,
    Problem,
    Support,
    adaptive_bounds,
    limit_bounds,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import AdaptiveBounds

TITLE = "Bounds for the body, in 3D"
RTOL = 1e-3
"""Tolerance of each bound on its mesh, much smaller than the gaps."""
STRONG = Elastic(1e6, 0.3)
SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
TOP = [Pressure("top", 1.0)]

SPHERE = Case(
    name="thick sphere",
    write=write_thick_sphere,
    arguments={"size": 0.165},
    materials={"shell": GROUND},
    supports=[*SYMMETRY, Support("z0", "z")],
    loads=[Pressure("inner", 1.0)],
    asked=(0.06, 1500),
    exact=2 * math.sqrt(3) * math.log(OUTER / INNER),
    coarse=(0.23, 200),
)
CUBE = Case(
    name="cube, rough platens",
    write=write_rough_cube,
    arguments={"size": 0.25},
    materials={"cube": GROUND, "platen": STRONG},
    supports=[*SYMMETRY, Support("z0", "z")],
    loads=TOP,
    asked=(0.013, 2000),
    coarse=(0.03, 400),
)
PUNCH = Case(
    name="square punch",
    write=write_square_punch,
    arguments={"size": 0.8},
    materials={"ground": GROUND, "punch": STRONG},
    supports=[*SYMMETRY, Support("bottom"), Support("sides")],
    loads=TOP,
    contacts=[Contact("punch_seam", "ground_seam")],
    asked=(0.065, 8000),
)
FEWER = (0.12, 2300)
"""Required gap for the punch, and largest number of cells for this gap."""
COARSE_SPHERE = 0.4
"""Edge length of a quick run."""


# %%
def adapted(case: Case, problem: Problem) -> tuple[AdaptiveBounds, list[Row]]:
    """Return bounds for a case on adapted meshes. Collective."""
    began = time.perf_counter()
    found = adaptive_bounds(problem, Adaptation(*case.asked), RTOL)
    seconds = time.perf_counter() - began
    return found, rows_of(case, found.low, found.high, found.rounds[-1].cells, seconds)


def sphere(folder: ResultFolder, case: Case, **changes: object) -> list[Row]:
    """Return bounds for the sphere from an inner and an outer polyhedron. Collective."""
    began = time.perf_counter()
    low, high = (
        limit_bounds(case.problem(folder, circumscribed=surface, **changes), RTOL)
        for surface in ("inner", "outer")
    )
    cells = high.problem.tagged_mesh.mesh.topology.index_map(3).size_global // 4
    return rows_of(case, low, high, cells, time.perf_counter() - began)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds for the three bodies; the meshes of the punch are adapted. Collective."""
    if coarse:
        assert SPHERE.coarse is not None
        assert CUBE.coarse is not None
        rows = sphere(folder, replace(SPHERE, asked=SPHERE.coarse), size=COARSE_SPHERE)
        cube = replace(CUBE, asked=CUBE.coarse)
        found, new = adapted(cube, cube.problem(folder))
        show_bounds(subfolder(folder, "cube"), cube.name, found)
        return rows + new
    rows = sphere(folder, SPHERE)
    rows += adapted(CUBE, CUBE.problem(folder))[1]
    problem = PUNCH.problem(folder)
    for asked in FEWER, PUNCH.asked:
        found, new = adapted(replace(PUNCH, asked=asked), problem)
        rows += new
        problem = found.problem
    show_bounds(subfolder(folder, "punch"), PUNCH.name, found)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
