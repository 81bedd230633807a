# %% [markdown]
# # Bounds in space, and meshes that find the mechanism
#
# A stress that is in equilibrium everywhere and nowhere beyond yield bounds the limit load of a
# body from below, a velocity that keeps the volume everywhere from above. Three bodies in space are
# bracketed so, in units of k, the yield stress in shear:
#
# - An octant of a **thick sphere** of radii 1 and 2 under inner pressure: exactly 2√3 ln 2
#   (R. Hill, The Mathematical Theory of Plasticity, Oxford 1950, chapter V). Facets are flat, so
#   that each bound has a mesh of its own. Below, facets touch the inner sphere from outside and
#   have their vertices on the outer one: what is left of the shell outside of them bears the
#   pressure, or nothing. Above it is the other way round: what flows is larger than the shell.
# - A **cube between rough platens**, an octant of it; the platen is elastic, and glued to it. No
#   exact solution is known.
# - A smooth **square punch** on a block of ground whose bottom and outer sides are held, a quarter
#   of it: an elastic body in frictionless contact. No exact solution is known. That of the strip
#   punch is 2 + π.
#
# Of the last two only the first mesh is given: both bounds say which of its cells are to be refined
# until there are as many as are allowed. What is judged is the gap of the bounds, relative to the
# lower one.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/bodies_in_space.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.rough_cube import write_rough_cube
from meshes.square_punch import write_square_punch
from meshes.thick_sphere import INNER, OUTER, write_thick_sphere
from perfplast_fenicsx import (
    Adaptation,
    BodyBounds,
    Contact,
    Elastic,
    Pressure,
    Problem,
    Support,
    VonMises,
    adaptive_bounds,
    limit_bounds,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.limit_analysis import AdaptiveBounds
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Bounds in space"
SOFT: Material = VonMises(young=1000.0, poisson=0.3, yield_stress=math.sqrt(3))  # k = 1
STRONG: Material = Elastic(young=1e6, poisson=0.3)
SYMMETRY = [Support("x0", "x"), Support("y0", "y")]
TOP = [Pressure("top", 1.0)]
SEAM = [Contact("punch_seam", "ground_seam")]
EXACT = 2 * math.sqrt(3) * math.log(OUTER / INNER)
RTOL = 1e-3
"""Of each bound, on its mesh: far less than the gaps."""


# %% [markdown]
# ## The bodies


# %%
def sphere(folder: ResultFolder, size: float, circumscribed: str) -> Problem:
    """The thick sphere with the inner or the outer sphere touched by facets. Collective."""
    found = mesh(folder, write_thick_sphere, size=size, circumscribed=circumscribed)
    supports = [*SYMMETRY, Support("z0", "z")]
    return Problem(found, {"shell": SOFT}, supports, [Pressure("inner", 1.0)], degree=2)


def cube(folder: ResultFolder, size: float) -> Problem:
    """The cube and its platen. Collective."""
    found = mesh(folder, write_rough_cube, size=size)
    materials = {"cube": SOFT, "platen": STRONG}
    return Problem(found, materials, [*SYMMETRY, Support("z0", "z")], TOP, degree=2)


def punch(folder: ResultFolder, size: float) -> Problem:
    """The punch and the ground. Collective."""
    found = mesh(folder, write_square_punch, size=size)
    supports = [*SYMMETRY, Support("bottom"), Support("sides")]
    return Problem(found, {"ground": SOFT, "punch": STRONG}, supports, TOP, SEAM, degree=2)


# %% [markdown]
# ## Solve


# %%
def bracket(
    case: str,
    cells: int,
    low: BodyBounds,
    high: BodyBounds,
    allowed: float | None,
    seconds: float,
) -> Row:
    """The gap of two bounds as a row; nan without both."""
    lower, upper = low.lower, high.upper
    strict = lower.strict and upper.strict
    gap = upper.value / lower.value - 1 if lower.value and upper.value else math.nan
    return Row(
        case=case,
        quantity=f"gap, {cells} cells",
        element="P2, split",
        size=cells ** (-1 / 3),
        dofs=high.problem.num_dofs,
        computed=gap if strict else math.nan,
        exact=0.0,
        allowed=allowed,
        solves=0,
        seconds=seconds,
        bound=True,
        bracket=f"{lower.shown} ... {upper.shown}",
    )


def sphere_rows(folder: ResultFolder, size: float, allowed: float) -> list[Row]:
    """The gap, and where the exact value lies. Collective."""
    began = time.perf_counter()
    problems = [sphere(folder, size, surface) for surface in ("inner", "outer")]
    low, high = (limit_bounds(problem, RTOL) for problem in problems)
    seconds = time.perf_counter() - began
    gap = bracket("thick sphere", _cells(problems[0]), low, high, allowed, seconds)
    rows = [gap]
    for quantity, bounded, by in (
        ("lower bound", low.lower.value or math.nan, EXACT),
        ("exact value", EXACT, high.upper.value or math.nan),
    ):
        rows.append(
            Row(
                case="thick sphere",
                quantity=quantity,
                element="P2, split",
                size=gap.size,
                dofs=gap.dofs,
                computed=bounded,
                exact=by,
                allowed=0.0,
                solves=0,
                seconds=0.0,
                bound=True,
            )
        )
    return rows


def adapted_rows(
    case: str, problem: Problem, asked: Sequence[tuple[int, float]]
) -> tuple[list[Row], AdaptiveBounds]:
    """Gaps with more and more cells. Collective.

    Args:
        case: Name of the case.
        problem: On the first mesh.
        asked: Cells that there may be, and the gap that is allowed then.
    """
    rows = []
    began = time.perf_counter()
    for cells, allowed in asked:
        found = adaptive_bounds(problem, Adaptation(until=1e-3, cells=cells), RTOL)
        problem, seconds = found.problem, time.perf_counter() - began
        rows.append(bracket(case, _cells(problem), found.low, found.high, allowed, seconds))
    return rows, found


def _cells(problem: Problem) -> int:
    """Cells of all ranks, before they are split."""
    topology = problem.tagged_mesh.mesh.topology
    count: int = topology.index_map(topology.dim).size_global
    return count


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Brackets of three bodies, and pictures of two. Collective."""
    rows = sphere_rows(folder, 0.4 if coarse else 0.165, 0.25 if coarse else 0.06)
    for name, case, problem, contacts, asked in (
        ("cube", "cube, rough platens", cube(folder, 0.25), (), CUBE[coarse]),
        ("punch", "square punch", punch(folder, 1.0 if coarse else 0.8), SEAM, PUNCH[coarse]),
    ):
        of_case, found = adapted_rows(case, problem, asked)
        rows += of_case
        pictures = subfolder(folder, name)
        scene = Scene(f"Bounds in space: {case}", TOP, contacts)
        writer = ResultWriter(pictures, problem, scene, "bounds", prescribed=Prescribed.WORK)
        writer.write_limit(found.last.mesh, found.body, found)
        draw(pictures)
    return rows


CUBE = {False: [(2000, 0.018)], True: [(100, 0.1)]}
PUNCH = {False: [(2900, 0.12), (8000, 0.07)], True: [(150, 1.5)]}
"""Cells that there may be and gaps that are allowed, on fine and coarse meshes."""


def main(argv: Sequence[str] | None = None) -> None:
    """Solve, print the table and check it. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
