# %% [markdown]
# # Published limit loads of plates: NAFEMS' NL7
#
# A square plate of von Mises metal under a uniform load q is simply supported (NL7A) or clamped
# (NL7B). A. Ramsay (NAFEMS Benchmarks for Plastic Collapse of Square Metal Plates) found that the
# reference values of the benchmark are wrong. The limit load q L²/m_p of a thin plate (Kirchhoff
# plate with the moment m_p = σ_y t²/4) has no closed form.
#
# Here the plate is a 3D body of thickness L/20, with shear deformation. Half of the load acts on
# each face, so by symmetry the model is an eighth of the plate. The outer sides are held only along
# z in the case "supported", and along all axes in the case "clamped".
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/published_plates.py

# %%
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.thin_plate import write_thin_plate
from perfplast_fenicsx import Adaptation, Pressure, Problem, Support, VonMises, adaptive_bounds
from perfplast_fenicsx.io import ResultFolder

TITLE = "Published limit loads of plates"
METAL = VonMises(young=200e3, poisson=0.3, yield_stress=1.0)
SIDE, THICKNESS = 2.0, 0.1
UNIT = METAL.yield_stress * (THICKNESS / SIDE) ** 2 / 4
"""m_p / L², the unit of limit loads."""
PLATES = {"supported": ("z", 0.1, (0.025, 6000)), "clamped": ("xyz", 0.025, (0.04, 14000))}
"""Held components of the sides, width of the outermost elements of the first mesh, and the required
gap with the largest number of cells."""
THIN = {"supported": 25.02, "clamped": 42.86}
"""Published values for thin plates: an upper bound for the supported plate, and a lower bound for
the clamped plate.
"""
RTOL = 2e-3
"""Tolerance of each bound on its mesh, much smaller than the gaps."""


# %%
def plate(folder: ResultFolder, held: str, column: float, coarse: bool) -> Problem:
    """Return the problem of one plate. Collective."""
    size, layers = (0.25, 1) if coarse else (0.1, 2)
    body = mesh(
        folder,
        write_thin_plate,
        size=size,
        thickness=THICKNESS,
        layers=layers,
        column=size if coarse else column,
    )
    symmetry = [Support("x0", "x"), Support("y0", "y"), Support("z0", "xy")]
    half = [Pressure("top", UNIT / 2)]
    return Problem(body, {"plate": METAL}, [*symmetry, Support("edge", held)], half, degree=2)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for strict bounds on the limit loads of both plates. Collective."""
    rows = []
    for name, (held, column, asked) in PLATES.items():
        problem = plate(folder, held, column, coarse)
        began = time.perf_counter()
        gap, cells = (0.8, 400) if coarse else asked
        found = adaptive_bounds(problem, Adaptation(gap, cells), RTOL)
        lower, upper = ends(found)
        told = [("gap in %", 100 * (upper / lower - 1), 100 * gap)]
        if name == "supported":
            told.append(("ours below, thin above", lower, THIN[name]))
        else:
            told.append(("thin below, ours above", THIN[name], upper))
        rows += at_most(f"plate, {name}", found, time.perf_counter() - began, told)
        show_bounds(subfolder(folder, name), f"Plate, {name}", found)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
