# %% [markdown]
# # Bounds for bodies with joints
#
# A block whose width is twice its height is pressed between platens in plane strain. By symmetry
# the model is a quarter of the block.
#
# - With Tresca friction τ̄ = m k, k = σ_y/√3, the mean pressure at the limit load increases with m,
#   from 2k for smooth platens to 2.4277 k for rough platens. Strict brackets on adapted meshes are
#   half a percent wide. Up to m = 3/4 the brackets increase with m and do not overlap. The brackets
#   for m = 3/4 and m = 1 overlap, because the limit load for 3/4 is almost the limit load for rough
#   platens.
# - With Coulomb friction the collapse load depends on the history of slip. It lies between the
#   limit loads without friction and with associated slip (Drucker's two theorems). The program
#   computes bounds on these two limit loads, and a path with nonassociated slip ends between the
#   bounds.
# - If the case declares slip as associated, both bounds hold for this joint. Closer bounds on finer
#   meshes lie between these bounds.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/joints.py

# %%
import math
import time
from collections.abc import Sequence
from itertools import pairwise

from mpi4py import MPI

from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.facing_blocks import write_facing_blocks
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Pressure,
    Problem,
    Support,
    VonMises,
    adaptive_bounds,
    limit_load,
)
from perfplast_fenicsx.io import ResultFolder

TITLE = "Bounds with joints"
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
STRONGER = VonMises(young=206900.0, poisson=0.29, yield_stress=4500.0)
K = STEEL.yield_stress / math.sqrt(3)
ROUGH = 2.42768
"""Mean pressure between rough platens, divided by k."""
CELLS = 4000
MONOTONE, JOINT, FINER, QUICK = 0.005, 0.015, 0.003, 0.1
"""Widths of strict brackets: with Tresca friction, for an associated joint, on finer meshes, and in
a quick run."""
COULOMB = 0.1


def between_platens(folder: ResultFolder, size: float, **friction: float | bool) -> Problem:
    """Return a quarter of the block, with the platen as a body. Collective."""
    shape = {"left": 0.0, "below": 0.5, "above": 0.25, "fine": size, "size": size}
    return Problem(
        mesh(folder, write_facing_blocks, **shape),
        {"lower": STEEL, "upper": STRONGER},
        [Support("left", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_seam", "upper_seam", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


# %% [markdown]
# ## Tresca's friction


# %%
def adhesive(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for strict brackets for several values of m. Collective."""
    gap, rows = QUICK if coarse else MONOTONE, list[Row]()
    found = []
    for m in (0.0, 1.0) if coarse else (0.0, 0.25, 0.5, 0.75, 1.0):
        began = time.perf_counter()
        problem = between_platens(folder, 0.25, tresca=m * K)
        bounds = adaptive_bounds(problem, Adaptation(gap, CELLS))
        low, high = ends(bounds)
        found.append((low / K, high / K))
        told = [("gap in %", 100 * (high / low - 1), 100 * gap)]
        known = {0.0: 2.0, 1.0: ROUGH}.get(m)
        if known is not None:
            told += [("below, over k", low / K, known), ("above, over k", known, high / K)]
        rows += at_most(f"platens, m = {m:g}", bounds, time.perf_counter() - began, told)
    apart = [(a[1], b[0]) for a, b in pairwise(found[:-1])]
    told = [("upper, lower of next m", *pair) for pair in apart]
    told.append(("lower, upper of m = 1", found[-2][0], found[-1][1]))
    show_bounds(subfolder(folder, "platens"), "Rough platens", bounds)
    return rows + at_most("platens, monotone in m", bounds, 0.0, told)


# %% [markdown]
# ## Coulomb's friction


# %%
def joint(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for an associated joint, Drucker's two bounds, and a Coulomb path. Collective."""
    gap, finer = (QUICK, QUICK / 2) if coarse else (JOINT, FINER)
    began, rubs = time.perf_counter(), {"coulomb": COULOMB}
    associated = between_platens(folder, 0.25, **rubs, associated=True)
    joint = adaptive_bounds(associated, Adaptation(gap, CELLS))
    took = time.perf_counter() - began
    within = adaptive_bounds(associated, Adaptation(finer, CELLS))
    smooth = adaptive_bounds(between_platens(folder, 0.25), Adaptation(gap, CELLS))
    pair = adaptive_bounds(between_platens(folder, 0.25, **rubs), Adaptation(gap, CELLS))
    path = limit_load(between_platens(folder, 0.25 if coarse else 0.1, **rubs), 1e-3)
    (free, _), (least, most), (low, high) = ends(smooth), ends(pair), ends(joint)
    inside = ends(within)
    rows = [
        ("gap in %", 100 * (high / low - 1), 100 * gap),
        ("below, below on a finer mesh", low, inside[0]),
        ("above on a finer mesh, above", inside[1], high),
        ("smooth below, joint below", free, low),
        ("path, joint above", path.lower, high),
    ]
    found = at_most(f"associated joint, mu = {COULOMB}", joint, took, rows)
    took = time.perf_counter() - began - took
    told = [
        ("smooth below, path", free, path.lower),
        ("Drucker's below, path", least, path.lower),
        ("path, associated above", path.lower, most),
    ]
    show_bounds(subfolder(folder, "joint"), "Associated joint", joint)
    return found + at_most(f"Drucker's pair, mu = {COULOMB}", pair, took, told)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of both kinds of joint. Collective."""
    return [*adhesive(folder, coarse), *joint(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
