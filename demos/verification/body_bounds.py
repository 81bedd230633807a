# %% [markdown]
# # Bounds for the body, on adapted meshes
#
# Both bounds on the limit load hold for the body that the mesh fills, for any mesh. So an exact
# limit load must lie between the bounds, and the mesh determines only the gap between them. The
# program refines coarse, almost uniform meshes where the bounds require smaller cells, until the
# gap is small enough or the number of cells reaches its limit. The cases are footings, rough
# platens, and strips with a slit and with notches, whose limit loads are known; a block on a weaker
# block; and the tutorial's beam on its prop.
#
# If the body is round, a mesh of straight-sided cells fills a different body. A tube under inner
# pressure therefore has one polygonal mesh for each bound. The tube carries every pressure that a
# polygonal body inside it carries: hydrostatic compression by the pressure is an admissible stress
# in the rest of the tube. A mechanism of a polygonal body that contains the tube is also a
# mechanism of the tube.
#
# The beam shows how accurate the limit load of a mesh is. With an edge length of 12, this limit
# load is 5 % too large. On the last adapted mesh it lies between the bounds.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/body_bounds.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

from demos.verification.bounded_bodies import ADAPTED, BEAM, PLATENS, TUBE, Case
from demos.verification.slip import draw_slip
from demos.verification.study import Row, run
from perfplast_fenicsx import (
    Adaptation,
    BodyBounds,
    LimitLoad,
    Problem,
    adaptive_bounds,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.limit_analysis import AdaptiveBounds
from perfplast_fenicsx.problem import Prescribed

TITLE = "Bounds of the body, plane strain"
POLYGONS = ((8, (0.043, 96)), (29, TUBE.asked))
"""Number of polygon sides in a quarter of the tube, with the required gap and limit on cells."""
COARSE = 12.0
"""Edge length of a mesh that is not adapted."""


# %% [markdown]
# ## Rows of the table
#
# For each case, the table compares the number of cells of the last mesh, and the gap in percent,
# with their limits. If the limit load is known, the table also contains both inequalities.


# %%
def rows_of(case: Case, low: BodyBounds, high: BodyBounds, cells: int, seconds: float) -> list[Row]:
    """Return the table rows for the lower and the upper bound of a case."""
    lower, upper = low.lower, high.upper
    assert lower.strict and upper.strict, f"{case.name}: {lower!r}, {upper!r}"
    assert lower.value is not None and upper.value is not None
    row = Row(
        case=case.name,
        quantity="cells",
        element="P1 and P2",
        size=1.0,
        dofs=high.problem.num_dofs,
        computed=cells,
        exact=case.asked[1],
        allowed=0.0,
        solves=0,
        seconds=seconds,
        bound=True,
        bracket=f"{lower.shown} ... {upper.shown}",
    )
    rest = replace(row, seconds=0.0, bracket="")
    gap = 100 * (upper.value / lower.value - 1)
    rows = [row, replace(rest, quantity="gap in %", computed=gap, exact=100 * case.asked[0])]
    if case.exact is not None:
        exact = case.exact
        rows.append(replace(rest, quantity="lower bound", computed=lower.value, exact=exact))
        rows.append(replace(rest, quantity="exact value", computed=exact, exact=upper.value))
    return rows


def adapted(case: Case, problem: Problem) -> tuple[AdaptiveBounds, list[Row]]:
    """Return bounds for a case on adapted meshes. Collective."""
    began = time.perf_counter()
    found = adaptive_bounds(problem, Adaptation(*case.asked))
    seconds = time.perf_counter() - began
    return found, rows_of(case, found.low, found.high, found.rounds[-1].cells, seconds)


def tube(folder: ResultFolder, sides: int, asked: tuple[float, int]) -> list[Row]:
    """Return bounds for the round tube from an inner and an outer polygon. Collective."""
    began, size = time.perf_counter(), math.pi / 2 / sides
    low, high = (
        limit_bounds(TUBE.problem(folder, lesser=lesser, size=size)) for lesser in (True, False)
    )
    cells = high.problem.tagged_mesh.mesh.topology.index_map(2).size_global
    return rows_of(replace(TUBE, asked=asked), low, high, cells, time.perf_counter() - began)


def of_mesh(row: Row, limit: LimitLoad, element: str, inside: bool) -> Row:
    """Return a row that compares a limit load of a mesh with the middle of the bracket."""
    low, high = (float(end) for end in row.bracket.split(" ... "))
    return replace(
        row,
        quantity="limit load of a mesh",
        element=element,
        computed=math.nan if limit.estimate is None else limit.estimate,
        exact=(low + high) / 2,
        allowed=(high - low) / (high + low) if inside else None,
        seconds=0.0,
        bound=False,
        factorisations=limit.factorisations,
    )


def show(folder: ResultFolder, case: Case, found: AdaptiveBounds) -> None:
    """Draw the mechanism on the mesh of the best bounds. Collective."""
    scene = Scene(case.name, case.loads, case.contacts)
    writer = ResultWriter(
        folder, found.problem, scene, "interior-point", prescribed=Prescribed.WORK
    )
    writer.write_limit(found.best.mesh, found.body, found)
    draw_slip(folder, case.name)


# %% [markdown]
# The limit load of the beam on a mesh without adaptation is compared with the middle of the
# bracket. On this mesh, one cell is as wide as a plastic hinge or the edge of the supporting block.


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds on adapted meshes, and bounds for the tube from polygons. Collective."""
    rows = []
    for case in ADAPTED:
        if coarse:
            if case.coarse is None:
                continue
            case = replace(case, asked=case.coarse)
        found, new = adapted(case, case.problem(folder))
        rows += new
        if case.exact is None:
            rows.append(of_mesh(new[0], found.last.mesh, "P2, last mesh", inside=True))
        if case is BEAM:
            found_there = limit_load(case.problem(folder, size=COARSE))
            rows.append(of_mesh(new[0], found_there, "P2, size 12", inside=False))
        if case.name == PLATENS.name:
            show(folder, case, found)
    for sides, asked in POLYGONS[:1] if coarse else POLYGONS:
        rows += tube(folder, sides, asked)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
