# %% [markdown]
# # The diagram of a bolted joint
#
# A bolt of radius 10 mm is tightened in a ring of radii 11 and 20 mm. Both are of steel and 60 mm
# long. A head that is 1000 times stiffer covers both. Then a force pulls the head. With the
# stiffnesses k = EA/L of bolt and ring, the bolt carries the fraction Φ = k_b/(k_b + k_r) of a load
# F while the joint is closed, and all of F after the joint has opened:
#
#     N = F_V + ΦF  for  F < F_V/(1 − Φ),    N = F  beyond
#
# (VDI 2230, part 1, and textbooks on machine elements). Ring and bolt stand on smooth ground, so
# they behave like bars, except where head and bolt are connected. At the limit load the shank
# yields, for any preload. The interior point method, which ignores preloads, must find the same
# limit load with and without preload. A test checks that a loading path from the preload also ends
# at this load (`tests/solvers/test_bolts.py`).
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/bolted_ring.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, mesh, run, show
from meshes.bolted_ring import INNER, OUTER, SHANK, write_bolted_ring
from perfplast_fenicsx import (
    Bolt,
    Contact,
    Newton,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    limit_load,
    load_path,
)
from perfplast_fenicsx.io import ResultFolder, Scene

TITLE = "A bolt that is tightened in a ring"
ALLOWED, SAME = 0.03, 1e-4
PRELOAD = 40e3
"""Preload of the bolt (N); the shank yields at 200.9 kN."""

STEEL, STIFF = VonMises(210e3, 0.3, 640.0), VonMises(210e6, 0.3, 64e3)
SHARE = SHANK**2 / (SHANK**2 + OUTER**2 - INNER**2)
APART = PRELOAD / (1 - SHARE)
LOADS = (0.0, 0.5, 0.9, 1.1, 1.5)
"""Loads, divided by the load at which the joint opens."""


# %%
def joint(tagged_mesh: TaggedMesh, preload: float) -> Problem:
    """Return the bolted ring; ζ is the force at the head (N). Collective."""
    bolts = [Bolt("bolt", preload, (0.0, 1.0), (15.0, 45.0))] if preload else []
    return Problem(
        tagged_mesh,
        {"bolt": STEEL, "ring": STEEL, "head": STIFF},
        [Support("bolt_bottom", "y"), Support("ring_bottom", "y")],
        [Pressure("top", -1 / (math.pi * OUTER**2))],
        [Contact("seat", "ring_top")],
        degree=2,
        initial=bolts,
    )


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return bolt forces, and limit loads with and without preload. Collective."""
    rows = []
    for size in (5.0,) if coarse else (5.0, 2.5):
        tagged_mesh = mesh(folder, write_bolted_ring, size=size).turned()
        problem = joint(tagged_mesh, PRELOAD)
        levels = []
        began = time.perf_counter()
        for share, level in zip(
            LOADS, load_path(Newton(problem), [one * APART for one in LOADS]), strict=True
        ):
            levels.append(level)
            load = share * APART
            exact = PRELOAD + SHARE * load if load < APART else load
            rows.append(
                Row(
                    case="bolt in a ring",
                    quantity=f"force of the bolt, F = {share:g} of the load that opens the joint",
                    element="P2",
                    size=size,
                    dofs=problem.num_dofs,
                    computed=level.report.bolts["bolt"],
                    exact=exact,
                    allowed=ALLOWED,
                    solves=level.report.linear_solves,
                    seconds=time.perf_counter() - began,
                )
            )
            began = time.perf_counter()
        began = time.perf_counter()
        plain, found = (limit_load(joint(tagged_mesh, force), SAME) for force in (0.0, PRELOAD))
        rows.append(
            Row(
                case="",
                quantity="limit load, against that without preload",
                element="P2",
                size=size,
                dofs=problem.num_dofs,
                computed=found.lower,
                exact=plain.lower,
                allowed=SAME,
                solves=found.linear_solves,
                seconds=time.perf_counter() - began,
            )
        )
        if size == 5.0:
            contacts = [Contact("seat", "ring_top")]
            show(folder, problem, Scene(TITLE, contacts=contacts, axisymmetric=True), levels)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
