# %% [markdown]
# # Friction: a sliding block, rough platens, a slope, and partial slip
#
# With Tresca friction, slip occurs at a given shear stress τ̄; with Coulomb friction, slip occurs
# at μ times the pressure.
#
# - A force pushes a block sideways on another block until the upper block slides. It slides at the
#   force τ̄A in any direction, because the friction law is not approximated by a polygon.
# - A block is pressed between platens with τ̄ = m k, k = σ_y/√3. If the width of the block equals
#   its height, slip lines at 45° end on the sides of the block. The stress at collapse is then
#   uniform for any m, and the limit load is 2k. If the block is twice as wide, the limit load
#   increases with m from 2k to 2.4277 k, the limit load with glued platens.
# - A horizontal force F pushes a block of weight G up a slope with tan α = 0.1. The block slides at
#   F/G = (tan α + μ)/(1 − μ tan α) (NAFEMS, benchmark CGS-4, with μ = 0.3).
# - A block of 80 mm by 40 mm is pressed on a floor, by 50 N/mm² from above and by 150 N/mm² from
#   its sides; E = 130 GPa, ν = 0.2, μ = 1. The mesh is one half of the block. The block lifts off
#   near the corner, slips next to this part, and sticks in the middle. According to Code_Aster's
#   test SSNV128, other programs find that the corner moves by 0.0286 mm along the floor.
# - A force P presses two long cylinders of one material on each other, and Q < μP pushes them
#   sideways. The surfaces stick where |x| ≤ c = b √(1 − Q/(μP)), and slip elsewhere in the contact
#   zone |x| ≤ b (C. Cattaneo, 1938; K. L. Johnson, Contact Mechanics, chapter 7). Half planes with
#   the gap x²/(2R) represent the cylinders. 2c is the length of the part that is in contact and
#   does not slip.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/friction.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

import numpy as np

from demos.verification.hertz_line import contact_modulus
from demos.verification.study import Row, collapse, mesh, run
from meshes.facing_blocks import write_facing_blocks
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Newton,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    WorkNewton,
    limit_load,
    stacked_blocks,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Friction"
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
RIGID = Elastic(young=206900e3, poisson=0.29)
K = STEEL.yield_stress / math.sqrt(3)
SEAM = ("lower_seam", "upper_seam")


# %% [markdown]
# ## A block that slides, in 3D


# %%
def slides(comm: MPI.Intracomm, coarse: bool) -> list[Row]:
    """Return the ζ at which a block slides, for three directions. Collective."""
    rows = []
    for degrees in (0.0, 37.0, 45.0):
        angle, n = math.radians(degrees), 2 if coarse else 4
        aside = (0.2 * math.cos(angle), 0.2 * math.sin(angle), -1.0)
        problem = Problem(
            stacked_blocks(comm, n),
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom")],
            [Traction("top", aside)],
            [Contact("lower_top", "upper_bottom", tresca=10.0, formulation="mortar")],
        )
        began = time.perf_counter()
        limit = limit_load(problem, method="path")
        rows.append(
            Row(
                case=f"sliding block, {degrees:g}°",
                quantity="load factor",
                element="P1",
                size=1 / n,
                dofs=problem.num_dofs,
                computed=limit.lower,
                exact=50.0,
                allowed=1e-6,
                solves=limit.linear_solves,
                seconds=time.perf_counter() - began,
            )
        )
    return rows


# %% [markdown]
# ## Between platens, a quarter by symmetry


# %%
def platens(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads for several m and both shapes. Collective."""
    rows: list[Row] = []
    for shape, height in (("as wide as high", 1.0), ("twice as wide", 0.5)):
        fine, size = (0.01, 0.1) if coarse else (0.005, 0.05)
        tagged_mesh = mesh(
            folder,
            write_facing_blocks,
            left=0.0,
            below=height,
            above=0.25,
            finest_at=1.0,
            flat=0.02,
            fine=fine,
            size=size,
        )
        before = 2 * K
        for m in (0.5, 1.0) if coarse else (0.0, 0.25, 0.5, 0.75, 1.0):
            problem = Problem(
                tagged_mesh,
                {"lower": STEEL, "upper": RIGID},
                [Support("left", "x"), Support("bottom", "y")],
                [Pressure("top", 1.0)],
                [Contact(*SEAM, tresca=m * K)],
                degree=2,
            )
            found = collapse(problem)
            name = f"platens, {shape}, m = {m:g}"
            if shape == "as wide as high":
                rows.append(found.row(name, size, 2 * K, 0.01))
            else:
                exact = {0.0: 2 * K, 1.0: 2.4277 * K}.get(m)
                rows.append(found.row(name, size, exact or before, 0.02 if exact else None))
                assert found.zeta >= before * (1 - 1e-4), "the limit load falls with m"
                before = found.zeta
    return rows


# %% [markdown]
# ## On a slope


# %%
def slope(comm: MPI.Intracomm) -> list[Row]:
    """Return F/G at which a block slides up. Collective."""
    tangent, mu = 0.1, 0.3
    angle = math.atan(tangent)
    c, s = math.cos(angle), math.sin(angle)
    problem = Problem(
        stacked_blocks(comm, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("y0", "y")],
        [BodyForce("upper", (-s, 0.0, -c), constant=True), BodyForce("upper", (c, 0.0, -s))],
        [Contact("lower_top", "upper_bottom", coulomb=mu)],
    )
    began, solver = time.perf_counter(), WorkNewton(problem)
    level = rest = solver.at_rest()
    for further in (1e-6, 1e-5, 1e-4, 1e-3):
        level = solver.solve(rest.state.alpha + further, level.state)
    return [
        Row(
            case="block on a slope, Coulomb",
            quantity="F/G",
            element="P1",
            size=0.5,
            dofs=problem.num_dofs,
            computed=level.report.zeta if level.report.converged else math.nan,
            exact=(tangent + mu) / (1 - mu * tangent),
            allowed=1e-6,
            solves=solver.linear.solves,
            seconds=time.perf_counter() - began,
        )
    ]


# %% [markdown]
# ## On a floor


# %%
def floor(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the displacement of the corner of a block. Collective."""
    length, size = 40.0, 2.5 if coarse else 1.25
    tagged_mesh = mesh(
        folder,
        write_facing_blocks,
        left=-length,
        right=0.0,
        below=0.1 * length,
        above=length,
        fine=size,
        size=size,
    )
    problem = Problem(
        tagged_mesh,
        {"lower": Elastic(130e9, 0.2), "upper": Elastic(130e3, 0.2)},
        [Support("bottom"), Support("right", "x")],
        [Pressure("top", 50.0), Pressure("left", 150.0)],
        [Contact(*SEAM, coulomb=1.0)],
        degree=2,
    )
    began, solver = time.perf_counter(), Newton(problem)
    level = solver.solve(1.0)
    u = level.state.u.x.array.reshape(-1, 2)
    x = problem.V.tabulate_dof_coordinates()
    at_corner = np.hypot(x[:, 0] + length, x[:, 1]) < 1e-6 * length
    moved = problem.comm.allreduce(float(u[at_corner, 0].max(initial=0)), MPI.MAX)
    return [
        Row(
            case="block on a floor, Coulomb",
            quantity="displacement of the corner",
            element="P2",
            size=size,
            dofs=problem.num_dofs,
            computed=moved if level.report.converged else math.nan,
            exact=0.0286,
            allowed=5e-3,
            solves=solver.linear.solves,
            seconds=time.perf_counter() - began,
        )
    ]


# %% [markdown]
# ## Partial slip


# %%
def cattaneo(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the half-width of the part that sticks. Collective."""
    body, width, share, mu, radius = Elastic(210e3, 0.3), 0.1, 0.5, 0.3, 10.0
    modulus = contact_modulus(body, body)
    push = math.pi * modulus * width**2 / (4 * radius)
    aside = share * mu * push
    parts = 6 if coarse else 16
    tagged_mesh = mesh(folder, write_facing_blocks, fine=width / parts)
    # a couple on the top makes the moment of the contact forces zero
    down = f"{-push / 2!r} + {1.5 * aside!r}*x"
    problem = Problem(
        tagged_mesh,
        {"lower": body, "upper": body},
        [Support("bottom")],
        [Traction("top", (aside / 2, down))],
        [Contact(*SEAM, gap=f"x*x/{2 * radius}", coulomb=mu)],
        degree=2,
    )
    began = time.perf_counter()
    level = Newton(problem).solve(1.0)
    seconds = time.perf_counter() - began
    force = level.contact_forces
    x = problem.V.tabulate_dof_coordinates()[problem.constraints.host, 0]
    total, first, second = problem.comm.allreduce(np.array([force @ x**k for k in range(3)]))
    contact = 2 * math.sqrt(second / total - (first / total) ** 2)
    y = problem.create_vector()
    problem.basis.M.mult(level.state.u.x.petsc_vec, y)
    rubs = problem.friction
    sizes = np.abs(rubs.jumps(y)[:, 0])
    largest = problem.comm.allreduce(float(sizes.max(initial=0)), MPI.MAX)
    sticks = (sizes <= 1e-9 * largest) & (rubs.bound > 0)
    stick = problem.comm.allreduce(float(rubs.area[sticks].sum())) / 2
    y.destroy()
    scene = Scene(TITLE, problem.given.loads, problem.given.contacts)
    writer = ResultWriter(folder, problem, scene, "newton", prescribed=Prescribed.LOAD_FACTOR)
    writer.write(level)
    draw(folder)
    return [
        Row(
            case="stick within slip, Coulomb",
            quantity=quantity,
            element="P2",
            size=width / parts,
            dofs=problem.num_dofs,
            computed=computed if level.report.converged else math.nan,
            exact=exact,
            allowed=allowed,
            solves=level.report.linear_solves,
            seconds=seconds,
        )
        for quantity, computed, exact, allowed in (
            ("half-width of contact", contact, width, 0.03),
            ("half-width of stick", stick, width * math.sqrt(1 - share), 0.05),
        )
    ]


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of all cases. Collective."""
    return [
        *slides(comm, coarse),
        *slope(comm),
        *floor(folder, coarse),
        *cattaneo(folder, coarse),
        *platens(folder, coarse),
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
