# %% [markdown]
# # Bounds with constant loads
#
# - A strip footing of width B on weightless ground with shear strength k, under a shear force H,
#   carries the vertical force V = kB (1 + π − arcsin h + √(1 − h²)) with h = H/(kB) (A. P. Green,
#   J. Mech. Phys. Solids 2, 1954). With a constant H = kB/2, the limit of a growing V is 4.484019
#   kB. Conversely, with a constant V of this size, a growing H may reach −kB/2 and kB/2. V depends
#   little on H at this point: a change of H by one percent changes V by a fifth of a percent. The
#   first meshes have fans of long thin cells at the ends of the footing, where the stress depends
#   only on the direction. Without fans, 4 000 cells leave a gap of 1.7 % of H.
# - A vertical cut of height 1 has the unit weight γ = 2k, and a growing pressure on its crest.
# - The same cut has the unit weight γ = 4k. Without a pressure, the limit of γ is between 3.7752 k
#   and 3.7776 k (F. Kammoun and others, see published.py). So the cut collapses: its strength is
#   too small by a factor between 4/3.7776 and 4/3.7752. Tension on the crest would prevent the
#   collapse, so the cut can carry a pressure on the crest only with a negative factor. A negative
#   upper bound on the largest factor proves this.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/dead_loads.py

# %%
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.bounded_bodies import GROUND
from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.fanned_footing import write_fanned_footing
from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Pressure,
    Problem,
    Support,
    Traction,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder

TITLE = "Bounds beside loads that stay"
GREEN, SHEAR = 4.484019, 0.5
"""V/kB and H/kB at the limit."""
CUT = (3.7752, 3.7776)
"""Published bracket for the limit of γH/k of a vertical cut of height H under its weight."""
CELLS = 4000
STRIP, STEEP, CREST, FALLS, QUICK = 0.003, 0.01, 0.005, 0.01, 0.15
"""Widths of strict brackets; the last value is for a quick run."""


# %% [markdown]
# ## The strip


# %%
def strip(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds on V with a constant H, and on ±H with a constant V. Collective."""
    rows = []
    least = 1e-3  # gap at which the search ends before the limit on cells
    cases = {
        "dead H, live V": ((0.0, -1.0), (SHEAR, 0.0), GREEN, STRIP),
        "dead V, live H": ((1.0, 0.0), (0.0, -GREEN), SHEAR, STEEP),
        "dead V, live H, other end": ((-1.0, 0.0), (0.0, -GREEN), SHEAR, STEEP),
    }
    for case, (live, dead, exact, asked) in cases.items():
        if coarse and case != "dead H, live V":
            continue
        began = time.perf_counter()
        problem = Problem(
            mesh(folder, write_fanned_footing),
            {"ground": GROUND},
            [Support("bottom"), Support("sides")],
            [Traction("footing", live), Traction("footing", dead, constant=True)],
            degree=2,
        )
        gap = QUICK if coarse else asked
        found = adaptive_bounds(problem, Adaptation(QUICK if coarse else least, CELLS))
        lower, upper = ends(found)
        told = [
            ("gap in %", 100 * (upper / lower - 1), 100 * gap),
            ("below", lower, exact),
            ("above", exact, upper),
        ]
        rows += at_most(case, found, time.perf_counter() - began, told)
    return rows


# %% [markdown]
# ## The cut


# %%
def cut(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bounds on a pressure on the crest, and the missing strength of a collapsing cut.

    Collective.
    """
    rows = []
    crest = [Pressure("top", 1.0)]
    cases = {"live crest": (2.0, crest), "too heavy": (4.0, crest), "falls": (4.0, [])}
    for case, (weight, live) in cases.items():
        if coarse and live and weight > CUT[1]:
            continue
        began = time.perf_counter()
        problem = Problem(
            mesh(folder, write_vertical_cut),
            {"ground": GROUND},
            [Support("sides"), Support("bottom")],
            [*live, BodyForce("ground", (0.0, -weight), constant=True)],
            degree=2,
        )
        gap = QUICK if coarse else CREST if live else FALLS
        found = adaptive_bounds(problem, Adaptation(gap, CELLS))
        lower, upper = ends(found)
        told = [("gap in %", 100 * (upper / lower - 1), 100 * gap)]
        if live and weight > CUT[1]:
            told = [("largest factor, above", upper, 0.0)]
        if not live:
            told += [] if coarse else [("weight that is carried", upper, 1.0)]
            told += [
                ("falls short, at least", 1 / upper, weight / CUT[0]),
                ("falls short, at most", weight / CUT[1], 1 / lower),
            ]
        rows += at_most(f"vertical cut, {case}", found, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "cut"), f"Vertical cut, {case}", found)
    return rows


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of all cases. Collective."""
    return [*strip(folder, coarse), *cut(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
