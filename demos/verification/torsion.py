# %% [markdown]
# # Torsion of bars
#
# A bar is twisted at its end. The end section rotates rigidly in its plane, and may warp. The
# torque increases to the limit given by Nádai's sand-heap analogy (A. Nádai, Plasticity, 1931),
# with k = σ_y/√3:
#
#     round bar, radius 1:  T = 2πk/3        square bar, side 1:  T = k/3
#
# The round bar does not warp, and T/T_el = (4 − (θ_el/θ)³)/3 at the twist θ > θ_el = k/G. A
# traction k along circles on the end, given as a formula in x and y, has the same limit. After
# twisting to 2θ_el and unloading, the twist (2 − 31/24)θ_el remains, because T/T_el = 31/24 at
# 2θ_el and unloading is elastic. The traction k min(2r, 1) along circles corresponds to the twist
# 2θ_el. In the case with this traction, the bar is so long that the twist of the half away from the
# end depends only on the torque.
#
# By symmetry the model is a quarter of the bar: on the planes x = 0 and y = 0, points do not move
# within the plane. A slice of one element represents a long bar. ζ is the angle, and its conjugate
# force is the torque on the quarter.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/torsion.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

import ufl
from dolfinx import fem

from demos.verification.slip import subfolder
from demos.verification.study import Collapse, Row, mesh, run, show
from meshes.shaft import write_shaft
from meshes.square_bar import write_square_bar
from perfplast_fenicsx import (
    Flow,
    LoadingHistory,
    Newton,
    Problem,
    RigidSurface,
    Stage,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    limit_load,
    load_path,
    stage_path,
)
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.materials import Expr

TITLE = "Torsion of bars"
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
SHEAR = STEEL.yield_stress / math.sqrt(3)
ROUND, SQUARE = 2 * math.pi / 3 * SHEAR, SHEAR / 3
ELASTIC = SHEAR * 2 * (1 + STEEL.poisson) / STEEL.young
"""Twist per length at first yield of the round bar."""
SUPPORTS = [Support("x0", "yz"), Support("y0", "xz"), Support("z0", "xy")]
ALLOWED, UNTWISTED = 0.01, 0.005
TWISTS = (1.0, 2.0, 4.0, 10.0, 100.0)
"""Twists, divided by the twist at first yield of the round bar."""
PARTLY = (4 - TWISTS[1] ** -3) / 3
"""Exact T/T_el at 2θ_el."""
RESIDUAL = TWISTS[1] - PARTLY
LENGTH, FINE = 1.5, 0.15


# %%
def twisted(
    folder: ResultFolder | None, case: str, bar: TaggedMesh, size: float, exact: dict[float, float]
) -> list[Row]:
    """Return rows for torques at given twists. Collective.

    Args:
        folder: Folder for pictures; None to draw no pictures.
        case: Name of the case.
        bar: Mesh of a quarter of a slice that is one element long.
        size: Edge length of the elements, and length of the slice.
        exact: Exact torques by twist.
    """
    (body,) = bar.volumes
    turned = RigidSurface("z1", rotation=(0.0, 0.0, 1.0), components="xy", constant=False)
    problem = Problem(bar, {body: STEEL}, [*SUPPORTS, turned], degree=2)
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
def untwisted_by_traction(bar: TaggedMesh, size: float) -> list[Row]:
    """Return rows for the twists of a long bar at a torque and after unloading. Collective."""
    along = f"{SHEAR!r}*minimum(2, 1/sqrt(x*x + y*y + 1e-20))"
    traction = Traction("z1", (f"-y*{along}", f"x*{along}", 0.0), "torque")
    problem = Problem(bar, {"shaft": Flow(STEEL)}, SUPPORTS, [traction], degree=2)
    began = time.perf_counter()
    history = LoadingHistory(problem, [Stage({"torque": 1.0}, 4), Stage({"torque": 0.0})])
    levels = list(stage_path(Newton(problem), history))
    x = ufl.SpatialCoordinate(bar.mesh)
    here = ufl.conditional(ufl.lt(x[2], LENGTH / 2), 1.0, 0.0)
    polar = _integral(bar, here * (x[0] ** 2 + x[1] ** 2))
    rows = []
    for level, what, twist in (
        (levels[-2], "twist at the torque of 2θ_el", TWISTS[1]),
        (levels[-1], "residual twist", RESIDUAL),
    ):
        u = level.state.u
        turned = _integral(bar, here * (x[0] * u[1].dx(2) - x[1] * u[0].dx(2)))
        found = turned / polar / ELASTIC if level.report.converged else math.nan
        rows.append(
            Row(
                case="round bar, traction and back",
                quantity=what,
                element="P2",
                size=size,
                dofs=problem.num_dofs,
                computed=found,
                exact=twist,
                allowed=UNTWISTED if size <= FINE else None,
                solves=sum(each.report.linear_solves for each in levels),
                seconds=time.perf_counter() - began,
            )
        )
    return rows


def untwisted_by_motion(bar: TaggedMesh, size: float) -> list[Row]:
    """Return rows for the torque at 2θ_el, and the twist after elastic unloading. Collective."""
    turned = RigidSurface(
        "z1", rotation=(0.0, 0.0, 1.0), components="xy", constant=False, name="twist"
    )
    problem = Problem(bar, {"shaft": Flow(STEEL)}, [*SUPPORTS, turned], degree=2)
    began = time.perf_counter()
    there, back = (angle * ELASTIC * size for angle in (TWISTS[1], RESIDUAL))
    history = LoadingHistory(problem, [Stage({"twist": there}, 4), Stage({"twist": back})])
    levels = list(stage_path(Newton(problem), history))
    assert all(level.report.converged for level in levels)
    torques = [4 * level.report.driving_forces["twist"] for level in levels[-2:]]
    elastic = math.pi / 2 * SHEAR
    slope = (TWISTS[1] - RESIDUAL) / (torques[0] - torques[1])
    found = {
        "T/T_el at 2θ_el": (torques[0] / elastic, PARTLY),
        "residual twist": (RESIDUAL - torques[1] * slope, RESIDUAL),
    }
    return [
        Row(
            case="round bar, twisted and back",
            quantity=what,
            element="P2",
            size=size,
            dofs=problem.num_dofs,
            computed=computed,
            exact=exact,
            allowed=UNTWISTED,
            solves=sum(level.report.linear_solves for level in levels),
            seconds=time.perf_counter() - began,
        )
        for what, (computed, exact) in found.items()
    ]


def _integral(bar: TaggedMesh, value: Expr) -> float:
    """Return the integral of an expression over the bar. Collective."""
    return float(
        bar.mesh.comm.allreduce(fem.assemble_scalar(fem.form(value * ufl.dx(domain=bar.mesh))))
    )


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for limit torques of both bars, and the curve of the round bar. Collective."""
    rows = []
    sizes = (0.16, 0.08) if coarse else (0.16, 0.08, 0.04)
    for size in sizes:
        bar = mesh(folder, write_square_bar, length=size, size=size)
        pictures = subfolder(folder, "square") if size == sizes[-1] else None
        rows += twisted(pictures, "square bar", bar, size, {TWISTS[-1]: SQUARE})
    partly = ROUND / 4 * (4 - TWISTS[1] ** -3)
    along = "sqrt(x*x + y*y + 1e-20)"  # avoids 0/0 on the axis
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
        rows += untwisted_by_motion(bar, size)
    for size in (0.4,) if coarse else (0.25, FINE):
        rows += untwisted_by_traction(mesh(folder, write_shaft, length=LENGTH, size=size), size)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
