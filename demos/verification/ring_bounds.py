# %% [markdown]
# # Bounds for bodies of revolution
#
# The model is half of a section. The first bodies obey von Mises' law with yield stress 1: a tube
# between smooth planes with the limit load p = (2/√3) ln(b/a), a sphere with p = 2 ln(b/a), whose
# section is a polygon, and circular footings. The exact limit loads of these footings are not
# known. They lie between the limit loads for two Tresca materials: 2.845 and 3.285 for a smooth
# footing, 3.025 and 3.493 for a rough footing (R. T. Shield, Proc. R. Soc. A 233, 1955; G. Eason,
# R. T. Shield, ZAMP 11, 1960).
#
# - The smooth footing is a uniform pressure on ground whose surface moves freely.
# - The rough footing is a rigid surface that moves only along the axis. The tractions on it are
#   arbitrary, with a given resultant force.
#
# The last two cases are smooth footings on Mohr–Coulomb ground with cohesion 1, modelled as a
# strong punch in contact with the ground. The values of N_c come from the method of characteristics
# (A. D. Cox, G. Eason, H. G. Hopkins, Phil. Trans. R. Soc. A 254, 1961).
#
#     ./fenicsx python3 demos/verification/ring_bounds.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.bounded_bodies import HELD_GROUND, WIDE, of_shear
from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.ring import write_ring
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Elastic,
    Force,
    MohrCoulomb,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder

TITLE = "Bounds of bodies of revolution"
GROUND = of_shear(1 / math.sqrt(3))
SMOOTH, ROUGH = (5.69 / 2, 5.69 / math.sqrt(3)), (6.05 / 2, 6.05 / math.sqrt(3))
BELOW, ABOVE, GAP, QUICK = 0.005, 0.01, 0.01, 0.1
"""Largest relative errors of the lower and the upper bound, largest gap, and largest gap in a quick
run.
"""
CELLS = 4000
N_C = {10.0: 9.987, 20.0: 20.077}
"""N_c of smooth circular footings, by the friction angle (degrees)."""
DILATING = 0.02
"""Required gap for these footings."""


# %%
def problems(folder: ResultFolder, coarse: bool) -> dict[str, tuple[Problem, float | None]]:
    """Return the problems, and their exact loads where these are known. Collective."""
    inner, log = [Pressure("inner", 1.0)], math.log(2.0)
    ring = mesh(folder, write_ring, inner=1.0, outer=2.0, height=0.4, size=0.2).turned()
    size = 0.3 if coarse else 0.05
    sphere = mesh(folder, write_thick_tube, outer=2.0, size=size).turned()
    ground = mesh(folder, write_strip_footing, **WIDE).turned()
    planes = [Support("bottom", "y"), Support("top", "y")]
    side = [one for one in HELD_GROUND if one.on != "x0"]
    plate, force = RigidSurface("footing", held="x"), Force("footing", [0.0, -math.pi])
    of_ground, press = {"ground": GROUND}, [Pressure("footing", 1.0)]
    return {
        "tube": (Problem(ring, {"ring": GROUND}, planes, inner, degree=2), 2 / math.sqrt(3) * log),
        "sphere": (
            Problem(sphere, {"tube": GROUND}, [Support("y0", "y")], inner, degree=2),
            2 * log,
        ),
        "smooth footing": (Problem(ground, of_ground, side, press, degree=2), None),
        "rough footing": (
            Problem(ground, of_ground, [*side, plate], [force], degree=2),
            None,
        ),
    }


def punched(folder: ResultFolder, angle: float) -> Problem:
    """Return a smooth footing on ground that dilates. Collective."""
    section = mesh(folder, write_strip_footing, size=0.2, punch=True).turned()
    ground = MohrCoulomb(young=1e4, poisson=0.3, cohesion=1.0, friction_angle=angle)
    return Problem(
        section,
        {"ground": ground, "punch": Elastic(1e7, 0.3)},
        [Support("side", "x"), Support("bottom")],
        [Pressure("top", 1.0)],
        [Contact("ground_footing", "punch_footing")],
        degree=2,
    )


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for strict brackets on adapted meshes. Collective."""
    gap, rows = QUICK if coarse else GAP, list[Row]()
    for name, (problem, exact) in problems(folder, coarse).items():
        began = time.perf_counter()
        bounds = adaptive_bounds(problem, Adaptation(gap / 2 if exact else gap, CELLS))
        low, high = ends(bounds)
        told = [("gap in %", 100 * (high / low - 1), 100 * gap)]
        if exact is not None and not coarse:
            told += [("below", (1 - BELOW) * exact, low), ("above", high, (1 + ABOVE) * exact)]
        elif exact is None:
            least, most = SMOOTH if name.startswith("smooth") else ROUGH
            told += [("Tresca's, above", least, high), ("below, Tresca's", low, most)]
        rows += at_most(name, bounds, time.perf_counter() - began, told)
        if exact is None:
            show_bounds(subfolder(folder, name.replace(" ", "_")), name.capitalize(), bounds)
    for angle, exact in N_C.items():
        began, wide = time.perf_counter(), QUICK if coarse else DILATING
        bounds = adaptive_bounds(punched(folder, angle), Adaptation(wide, CELLS))
        low, high = ends(bounds)
        told = [
            ("gap in %", 100 * (high / low - 1), 100 * wide),
            ("lower, N_c", low, exact),
            ("N_c, upper", exact, high),
        ]
        rows += at_most(f"smooth footing, φ {angle:g}°", bounds, time.perf_counter() - began, told)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
