# %% [markdown]
# # Cost of bounds for the body
#
# The case is the block between rough platens in plane strain. Half of this block is rigid at
# collapse. The demo counts the cells that are necessary for a gap of 1 %, on adapted and on
# uniformly refined meshes. It also counts the iterations of the interior point method on meshes of
# increasing size.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/bound_costs.py

# %%
import time
from collections.abc import Sequence
from itertools import pairwise

from mpi4py import MPI

import numpy as np

from demos.verification.body_bounds import show
from demos.verification.bounded_bodies import PLATENS
from demos.verification.study import Row, run
from perfplast_fenicsx import Adaptation, BodyBounds, Problem, adaptive_bounds, limit_bounds
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.mesh import refine

TITLE = "Cost of bounds"
GAP, ROUGHLY = 0.01, 0.05
"""The gap for which cells are counted, and the gap of a quick run."""
FEWER, LESS = 1 / 5, 1 / 2
"""Largest ratio of the number of cells of adapted to uniform meshes, for these gaps."""
STEPS = 30
"""Largest number of interior point iterations for one bound."""
LARGE = 0.0125
"""Edge length of the largest mesh."""

Reached = list[tuple[int, float]]
"""Numbers of cells and gaps for a sequence of meshes."""


def cells_for(reached: Reached, gap: float) -> float:
    """Return the number of cells for a gap, interpolated between meshes by a power law."""
    for (few, wide), (many, narrow) in pairwise(reached):
        if narrow <= gap:
            share = np.log(wide / gap) / np.log(wide / narrow)
            return float(few * (many / few) ** share)
    return np.nan


def num_cells(problem: Problem) -> int:
    """Return the number of cells on all ranks."""
    count: int = problem.tagged_mesh.mesh.topology.index_map(2).size_global
    return count


def uniform(problem: Problem, gap: float) -> Reached:
    """Return the gaps on uniformly refined meshes, until one is small enough. Collective."""
    reached: Reached = []
    while not reached or reached[-1][1] > gap:
        if reached:
            every = np.ones(problem.tagged_mesh.mesh.topology.index_map(2).size_local, dtype=bool)
            problem = problem.on(refine(problem.tagged_mesh, every).tagged_mesh)
        reached.append((num_cells(problem), gap_of(limit_bounds(problem))))
    return reached


def gap_of(found: BodyBounds) -> float:
    """Return the relative gap of the bounds."""
    assert found.lower.value is not None
    assert found.upper.value is not None
    return found.upper.value / found.lower.value - 1


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the cells for a gap, and the iterations on the finest mesh. Collective."""
    gap, fewer = (ROUGHLY, LESS) if coarse else (GAP, FEWER)
    began, problem = time.perf_counter(), PLATENS.problem(folder)
    found = adaptive_bounds(problem, Adaptation(until=gap))
    show(folder, PLATENS, found)
    adapted = [(round_.cells, round_.gap) for round_ in found.rounds if round_.gap is not None]
    few, many = cells_for(adapted, gap), cells_for(uniform(problem, gap), gap)
    rows = [
        Row(
            case=PLATENS.name,
            quantity=f"cells for {100 * gap:g} %, to uniform",
            element="P1 and P2",
            size=1.0,
            dofs=found.problem.num_dofs,
            computed=few / many,
            exact=fewer,
            allowed=0.0,
            solves=0,
            seconds=time.perf_counter() - began,
            bound=True,
        )
    ]
    for size in () if coarse else (4 * LARGE, 2 * LARGE, LARGE):
        began, problem = time.perf_counter(), PLATENS.problem(folder, size=size)
        bounds = limit_bounds(problem)
        assert bounds.static is not None
        of_lower = len(bounds.static.steps)
        rows.append(
            Row(
                case=PLATENS.name,
                quantity=f"steps, {num_cells(problem)} cells",
                element="P1 and P2",
                size=size,
                dofs=problem.num_dofs,
                computed=max(of_lower, bounds.steps - of_lower),
                exact=STEPS,
                allowed=0.0,
                solves=0,
                seconds=time.perf_counter() - began,
                bound=True,
                bracket=f"{bounds.lower.shown} ... {bounds.upper.shown}",
            )
        )
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
