# %% [markdown]
# # Torsion of bars
#
# A bar is twisted by its end, which is turned as a rigid one in its plane and may warp. The torque
# rises to that of a heap of sand on the section (A. Nádai, Plasticity, 1931), with k = σ_y/√3:
#
#     round bar, radius 1:  T = 2πk/3        square bar, side 1:  T = k/3
#
# The round bar does not warp, and at the twist θ > θ_el = k/G it has T/T_el = (4 − (θ_el/θ)³)/3.
# Its limit is also that of a traction k along circles on the end, a formula in x and y.
#
# By symmetry a quarter is enough: on the planes x = 0 and y = 0 nothing moves within the plane. A
# slice of one element is as good as a long bar. ζ is the angle, the driving force the torque of the
# quarter.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/torsion.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Collapse, Row, mesh, run, show
from meshes.shaft import write_shaft
from meshes.square_bar import write_square_bar
from perfplast_fenicsx import (
    Newton,
    Problem,
    RigidSurface,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    limit_load,
    load_path,
)
from perfplast_fenicsx.io import ResultFolder, Scene

TITLE = "Torsion of bars"
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
SHEAR = STEEL.yield_stress / math.sqrt(3)
ROUND, SQUARE = 2 * math.pi / 3 * SHEAR, SHEAR / 3
ELASTIC = SHEAR * 2 * (1 + STEEL.poisson) / STEEL.young
"""Twist per length at which the round bar yields."""
SUPPORTS = [Support("x0", "yz"), Support("y0", "xz"), Support("z0", "xy")]
ALLOWED = 0.01
TWISTS = (1.0, 2.0, 4.0, 10.0, 100.0)
"""Relative to that of first yield of the round bar."""


# %%
def twisted(
    folder: ResultFolder | None, case: str, bar: TaggedMesh, size: float, exact: dict[float, float]
) -> list[Row]:
    """Torques at some twists. Collective.

    Args:
        folder: Where pictures of the levels go; None for none.
        case: Its name.
        bar: A quarter of a slice, as long as an element.
        size: Of that.
        exact: Torques by the twist.
    """
    (body,) = bar.volumes
    turned = RigidSurface("z1", rotation=(0.0, 0.0, 1.0), components="xy", constant=False)
    problem = Problem(bar, {body: STEEL}, SUPPORTS, degree=2, rigid=[turned])
    rows = []
    angles = [twist * ELASTIC * size for twist in TWISTS]
    began = time.perf_counter()
    levels = list(load_path(Newton(problem), angles))
    for twist, level in zip(TWISTS, levels, strict=True):
        report = level.report
        if twist in exact:
            rows.append(
                Row(
                    case=case,
                    quantity=f"torque at {twist:g} θ_el",
                    element="P2",
                    size=size,
                    dofs=problem.num_dofs,
                    computed=4 * report.driving_force if report.converged else math.nan,
                    exact=exact[twist],
                    allowed=ALLOWED,
                    solves=report.linear_solves,
                    seconds=time.perf_counter() - began,
                )
            )
    if folder is not None:
        show(folder, problem, Scene(TITLE, driven=True), levels)
    return rows


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Limit torques of both bars, and the way there of the round one. Collective."""
    rows = []
    sizes = (0.16, 0.08) if coarse else (0.16, 0.08, 0.04)
    for size in sizes:
        bar = mesh(folder, write_square_bar, length=size, size=size)
        pictures = subfolder(folder, "square") if size == sizes[-1] else None
        rows += twisted(pictures, "square bar", bar, size, {TWISTS[-1]: SQUARE})
    partly = ROUND / 4 * (4 - TWISTS[1] ** -3)
    along = "sqrt(x*x + y*y + 1e-20)"  # not 0/0 on the axis
    traction = Traction("z1", (f"-y/{along}", f"x/{along}", 0.0))
    sizes = (0.4, 0.2) if coarse else (0.4, 0.2, 0.1)
    for size in sizes:
        bar = mesh(folder, write_shaft, length=size, size=size)
        pictures = subfolder(folder, "round") if size == sizes[-1] and not coarse else None
        rows += twisted(pictures, "round bar", bar, size, {TWISTS[1]: partly, TWISTS[-1]: ROUND})
        problem = Problem(bar, {"shaft": STEEL}, SUPPORTS, [traction], degree=2)
        began = time.perf_counter()
        limit = limit_load(problem, 1e-4)
        found = Collapse(problem, limit, "", time.perf_counter() - began)
        rows.append(found.row("round bar, traction", size, SHEAR, ALLOWED))
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve, print the table and check it. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
