# %% [markdown]
# # Published limit loads of blocks: SSNV124
#
# This is Code_Aster's test of limit analysis by Norton–Hoff regularisation (V6.04.124; the data are
# in `astest/ssnv124a.comm` to `c`). The yield stress is σ_y = 10, and the stress is uniform except
# in the tube.
#
# - A: a rectangle in plane strain. The limit load is 14.6837 under the pressure 0.8ζ along x and a
#   constant pressure of 0.2 along y, and 11.547 under the pressure ζ along x only.
# - B: a cube under the pressures 0.2ζ along x and 0.8ζ along y. The limit load is 13.8675.
# - C: a tube whose ends cannot move along its axis, under the inner pressure ζ. The limit load is
#   12.6857. The radii 1 and 3 follow from the published value 2σ_y/√3 ln 3.
#
# The published lower values (9.6225, 11.556, 8.5545) are estimates.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/published_blocks.py

# %%
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, collapse, mesh, run
from meshes.box import write_box
from perfplast_fenicsx import Pressure, Problem, Support, Traction, VonMises
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Published limit loads of blocks"
METAL = VonMises(young=200e3, poisson=0.3, yield_stress=10.0)
DIGITS = 1e-5
"""Relative precision of the published numbers."""


def rectangle(folder: ResultFolder, live: float, dead: float) -> Problem:
    """Return problem A, with a constant pressure along y. Collective."""
    section = mesh(folder, write_box, corner=(0.0, 0.0), extent=(3.0, 1.0), size=1.0)
    held = [Support("x_low", "x"), Support("y_low", "y")]
    loads = [Traction("x_high", (-live, 0.0))]
    if dead:
        loads.append(Traction("y_high", (0.0, -dead), constant=True))
    return Problem(section, {"box": METAL}, held, loads, degree=2)


def cube(folder: ResultFolder) -> Problem:
    """Return problem B. Collective."""
    block = mesh(folder, write_box, size=1.0)
    held = [Support(f"{axis}_low", axis) for axis in "xyz"]
    loads = [Traction("x_high", (-0.2, 0.0, 0.0)), Traction("y_high", (0.0, -0.8, 0.0))]
    return Problem(block, {"box": METAL}, held, loads, degree=2)


def tube(folder: ResultFolder) -> Problem:
    """Return problem C. Collective."""
    section = mesh(folder, write_box, corner=(1.0, 0.0), extent=(2.0, 1.0), size=0.1).turned()
    held = [Support("y_low", "y"), Support("y_high", "y")]
    return Problem(section, {"box": METAL}, held, [Pressure("x_low", 1.0)], degree=2)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for limit loads of all problems, with strict bounds for the bodies.

    Collective.
    """
    found = [
        collapse(rectangle(folder, 0.8, 0.2)).row("SSNV124 A, dead load", 1.0, 14.6837, DIGITS),
        collapse(rectangle(folder, 1.0, 0.0)).row("SSNV124 A", 1.0, 11.547, DIGITS),
        collapse(cube(folder)).row("SSNV124 B", 1.0, 13.867505, DIGITS),
    ]
    problem = tube(folder)
    last = collapse(problem)
    last.write(folder, Scene("SSNV124 C", problem.given.loads, axisymmetric=True))
    draw(folder)
    return [*found, last.row("SSNV124 C", 0.1, 12.6857, 1e-3)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
