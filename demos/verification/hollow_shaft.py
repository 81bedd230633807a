# %% [markdown]
# # A hollow shaft under tension and torsion
#
# At the limit load, the walls of a thin hollow shaft of any section carry a tension N and a torque
# T with
#
#     (N/N₀)² + (T/T₀)² = 1,  N₀ = σ_y A,  T₀ = 2 A_m t σ_y/√3,
#
# where A is the sectional area of the walls, t their thickness, and A_m the area within their
# centre lines. In each of the eight flat walls of an octagon, the stress is uniform, with σ² + 3τ²
# = σ_y². The shear stress is equal on both sides of each corner, so the stress is in equilibrium.
# For thin walls this load is exact. Two polygons from strict bounds enclose the boundary of the
# pairs of N and T that the shaft carries. The circle must lie between the polygons, whose distance
# is two percent. A small square at the bottom is held in all directions: rounding leaves a torque,
# and without a support against rotation no lower bound is proven.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/hollow_shaft.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, mesh, on_rank_0, run
from meshes.hollow_shaft import SIDES, write_hollow_shaft
from perfplast_fenicsx import Problem, Support, Traction, VonMises, envelope
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.pictures import save_envelope

TITLE = "Hollow shaft"
STEEL = VonMises(2e5, 0.3, 1.0)
APART = 0.02
"""Largest relative distance of the polygons along a ray."""


def tension() -> list[Traction]:
    """Return tractions with the resultant N₀ at the upper end."""
    return [Traction(f"top{i}", (0.0, 0.0, 1.0)) for i in range(SIDES)]


def torsion() -> list[Traction]:
    """Return tractions with the torque T₀ at both ends: σ_y/√3 along each wall."""
    shear, loads = STEEL.yield_stress / math.sqrt(3), []
    for i in range(SIDES):
        angle = 2 * math.pi * i / SIDES
        along = (-shear * math.sin(angle), shear * math.cos(angle), 0.0)
        loads += [Traction(f"top{i}", along), Traction(f"bottom{i}", tuple(-a for a in along))]
    return loads


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows that compare the exact circle with both polygons. Collective."""
    began = time.perf_counter()
    problem = Problem(
        mesh(folder, write_hollow_shaft, size=1.0 if coarse else 0.5),
        {"shaft": STEEL},
        [Support("held"), *(Support(f"bottom{i}", "z") for i in range(SIDES))],
        tension(),
        degree=2,
    )
    found = envelope(problem, [tension(), torsion()], 3 if coarse else 12, APART)
    rays, path = range(91), folder.file("hollow_shaft.png")
    on_rank_0(comm, lambda: save_envelope(found.rows(), ("N/N₀", "T/T₀"), TITLE, path, alone=True))
    told = [
        ("gap in %", 100 * found.gap, 100 * APART, None if coarse else 1e-9),
        ("inner polygon/circle", max(found.inner(angle) for angle in rays), 1.0, 1e-9),
        ("circle/outer polygon", max(1 / found.outer(angle) for angle in rays), 1.0, 1e-9),
    ]
    seconds = time.perf_counter() - began
    return [
        Row(
            "hollow shaft, N and T",
            quantity,
            "P1 and P2",
            1.0,
            problem.num_dofs,
            small,
            large,
            allowed,
            0,
            seconds,
            bound=True,
            bracket=f"{len(found.directions)} directions",
        )
        for quantity, small, large, allowed in told
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
