# %% [markdown]
# # A rough rigid footing under loads that lean and turn
#
# The footing is a surface of the ground that moves as a rigid body: a rough plate. A central load V
# carries Prandtl's pressure (2 + π) k on its width of 2, as in the case of the strip footing; the
# values here are above it. A horizontal load H or a moment M beside V take much of it, so that the
# central one bounds V. Their sign makes no difference, as the mesh is its own mirror image: the
# loads of both signs are a row each, and the second is compared with the first. Each is known to
# the tolerance of the search; where both take as many steps they agree to rounding.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/rigid_footing.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Collapse, Row, mesh, run
from meshes.footing import write_footing
from perfplast_fenicsx import Force, Problem, RigidSurface, Support, VonMises, limit_load
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Rough rigid footing, plane strain"
SOIL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
EXACT = (2 + math.pi) * SOIL.yield_stress / math.sqrt(3)
SUPPORTS = [Support("bottom"), Support("sides", "x")]
ALLOWED, TOLERANCE = 0.015, 1e-4
LOADS = {
    "central": (0.0, 0.0),
    "inclined": (0.3, 0.0),
    "eccentric": (0.0, 0.3),
    "both": (0.2, 0.2),
}
"""H and M of loads with V = 1."""


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Limit loads over the width, central and otherwise. Collective."""
    rows = []
    for size in (0.8, 0.2) if coarse else (0.8, 0.4, 0.2, 0.1):
        ground = mesh(folder, write_footing, size=size)
        for case, (across, moment) in LOADS.items():
            found = None
            central = not (across or moment)
            if coarse and size < 0.8 and not central:
                continue
            for sign in (1,) if central else (1, -1):
                began = time.perf_counter()
                load = Force("footing", (sign * across, -1.0), sign * moment)
                problem = Problem(
                    ground,
                    {"ground": SOIL},
                    SUPPORTS,
                    [load],
                    degree=2,
                    rigid=[RigidSurface("footing")],
                )
                limit = limit_load(problem, TOLERANCE)
                seconds = time.perf_counter() - began
                mean = (limit.estimate or math.nan) / 2
                allowed = None if central and size > 0.2 else ALLOWED
                rows.append(
                    Row(
                        case=f"footing, {case}",
                        quantity=f"limit load, sign {sign:+d}",
                        element="P2",
                        size=size,
                        dofs=problem.num_dofs,
                        computed=mean,
                        exact=EXACT if found is None else found,
                        allowed=allowed if found is None else TOLERANCE,
                        solves=limit.linear_solves,
                        seconds=seconds,
                        bound=found is None and not central,
                        factorisations=limit.factorisations,
                    )
                )
                found = mean
            if not coarse or case == "both":
                pictures = subfolder(folder, case)
                Collapse(problem, limit, "", seconds).write(pictures, Scene(TITLE, [load]))
                draw(pictures)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve, print the table and check it. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
