# %% [markdown]
# # Published numbers
#
# This demo repeats published limit loads and bounds whose data are known completely or almost
# completely. [The page](../../docs/published.md) lists the sources, a verdict on each number, and
# the published numbers that are omitted, with the reasons.
#
# - **Vertical cut** of height H in ground with cohesion c and without friction, in plane strain. At
#   the limit 3.7752 ≤ γH/c ≤ 3.7776 (F. Kammoun, J. Pastor, H. Smaoui, J. Pastor, Int. J. Numer.
#   Anal. Meth. Geomech. 2010, doi:10.1002/nag.887). Tresca's and von Mises' conditions are
#   equivalent in plane strain. The ground extends by 2H to either side, and by H below the toe. It
#   is held at its sides and its bottom.
# - **Vessel with a torispherical head**, SSNV146 of Code_Aster, from the benchmark of the project
#   LISA, under internal pressure, with σ_y = 100. The published table (U2.05.04, section 4) has
#   3.8673 (lower estimate) and 3.9396 (upper value) by EDF, 3.931 (upper value) by Liège, and 3.997
#   (lower value) by Jülich. Jülich's lower value exceeds both upper values. The text gives the
#   inner radius 49 of the cylinder, the thickness 2, and the radii 98 and 20 of crown and knuckle.
#   It does not say whether the radii are those of the inner, middle or outer surface. The demo
#   computes all readings.
# - **Thick sphere** of radii 0.1 and 0.2 with σ_y = 240 under internal pressure, the validation
#   case of OnScale Solve. The limit load is 2σ_y ln 2.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/published.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.bounded_bodies import GROUND
from demos.verification.slip import subfolder
from demos.verification.study import Row, collapse, mesh, run
from meshes.thick_tube import write_thick_tube
from meshes.torispherical_head import CROWN, KNUCKLE, THICKNESS, write_torispherical_head
from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Pressure,
    Problem,
    Support,
    VonMises,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.limit_analysis import AdaptiveBounds
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Published numbers"
CUT = (3.7752, 3.7776)
"""Published bounds of γH/c, for cohesion 1 and height 1."""
ASKED, QUICK = (2e-4, 40000), (0.15, 400)
"""Required gap and largest number of cells for the cut; the same for a quick run."""
VESSEL = VonMises(young=200e3, poisson=0.3, yield_stress=100.0)
VESSEL_ASKED = (0.002, 4000)
"""Required gap and largest number of cells for the vessel."""
ESTIMATE, ABOVE, BELOW = 3.8673, 3.9396, 3.997
"""Limit loads of the vessel: a lower estimate and an upper value by EDF, and a lower value by
Jülich."""
READINGS = {
    "radii inside": (CROWN, KNUCKLE),
    "radii of the middle": (CROWN - THICKNESS / 2, KNUCKLE - THICKNESS / 2),
    "radii outside": (CROWN - THICKNESS, KNUCKLE - THICKNESS),
    "crown inside, knuckle out": (CROWN, KNUCKLE - THICKNESS),
}
"""Inner radii of crown and knuckle, for each reading of the published radii."""
AGREES = "crown inside, knuckle out"
"""The only reading with a limit load between EDF's two values."""
SPHERE = VonMises(young=210e3, poisson=0.3, yield_stress=240.0)


# %%
def at_most(
    case: str, found: AdaptiveBounds, seconds: float, rows: Sequence[tuple[str, float, float]]
) -> list[Row]:
    """Return rows for a strict bracket, each with a quantity, a number and its upper limit."""
    dofs = found.problem.num_dofs
    bracket = f"{found.lower.shown} ... {found.upper.shown}"
    return [
        Row(
            case=case,
            quantity=quantity,
            element="P1 and P2",
            size=1.0,
            dofs=dofs,
            computed=small,
            exact=large,
            allowed=0.0,
            solves=0,
            seconds=seconds,
            bound=True,
            bracket=bracket,
        )
        for quantity, small, large in rows
    ]


def ends(found: AdaptiveBounds) -> tuple[float, float]:
    """Return both strict bounds."""
    lower, upper = found.lower, found.upper
    assert lower.strict and upper.strict, f"{lower!r}, {upper!r}"
    assert lower.value is not None and upper.value is not None
    return lower.value, upper.value


def show_bounds(folder: ResultFolder, title: str, found: AdaptiveBounds) -> None:
    """Draw the mechanism on the mesh of the best bounds. Collective."""
    given, axisymmetric = found.problem.given, found.problem.tagged_mesh.axisymmetric
    scene = Scene(title, given.loads, given.contacts, axisymmetric=axisymmetric)
    writer = ResultWriter(
        folder, found.problem, scene, "interior-point", prescribed=Prescribed.WORK
    )
    writer.write_limit(found.best.mesh, found.body, found)
    draw(folder)


# %% [markdown]
# ## The cut
#
# The published bracket and the computed bracket contain the same number, so neither lower bound may
# exceed the other upper bound.


# %%
def cut(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the strict bounds on the limit of the cut. Collective."""
    ground = mesh(folder, write_vertical_cut)
    held = [Support("sides"), Support("bottom")]
    loads = [BodyForce("ground", (0.0, -1.0))]
    problem = Problem(ground, {"ground": GROUND}, held, loads, degree=2)
    began = time.perf_counter()
    gap, cells = QUICK if coarse else ASKED
    found = adaptive_bounds(problem, Adaptation(gap, cells), gap / 10)
    seconds = time.perf_counter() - began
    if not coarse:
        show_bounds(subfolder(folder, "cut"), "vertical cut", found)
    lower, upper = ends(found)
    told = [
        ("gap in %", 100 * (upper / lower - 1), 100 * gap),
        ("ours below, theirs above", lower, CUT[1]),
        ("theirs below, ours above", CUT[0], upper),
    ]
    return at_most("vertical cut", found, seconds, told)


# %% [markdown]
# ## The vessel and the sphere
#
# Both are bodies of revolution. The verdict on the published numbers for the vessel depends on the
# reading of its radii. For each reading, however, the strict bounds show that one published number
# is not a bound. Either EDF's upper value is below our lower bound, and Jülich's lower value is a
# valid bound, or Jülich's lower value is above our upper bound.


# %%
def vessel(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for strict bounds for the vessel, for each reading of its radii. Collective."""
    rows = []
    gap, cells = QUICK if coarse else VESSEL_ASKED
    for reading, (crown, knuckle) in READINGS.items():
        section = mesh(
            folder,
            write_torispherical_head,
            size=1.0 if coarse else 0.5,
            crown=crown,
            knuckle=knuckle,
        ).turned()
        held, loads = [Support("end", "y")], [Pressure("inside", 1.0)]
        problem = Problem(section, {"vessel": VESSEL}, held, loads, degree=2)
        began = time.perf_counter()
        found = adaptive_bounds(problem, Adaptation(gap, cells))
        lower, upper = ends(found)
        told = [("gap in %", 100 * (upper / lower - 1), 100 * gap)]
        if reading == AGREES:
            told += [
                ("EDF's below, ours above", ESTIMATE, upper),
                ("ours below, EDF's above", lower, ABOVE),
                ("ours above, Jülich's below", upper, BELOW),
            ]
        else:
            told += [("EDF's above, ours below", ABOVE, lower)]
            told += [] if coarse else [("Jülich's below, ours below", BELOW, lower)]
        rows += at_most(f"SSNV146, {reading}", found, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "vessel"), f"SSNV146, {reading}", found)
    return rows


# %%
def sphere(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the limit load of the sphere, with lengths divided by the inner radius.

    Collective.
    """
    size = 0.3 if coarse else 0.075
    section = mesh(folder, write_thick_tube, outer=2.0, size=size, order=2).turned()
    held, loads = [Support("y0", "y")], [Pressure("inner", 1.0)]
    problem = Problem(section, {"tube": SPHERE}, held, loads, degree=2)
    exact = 2 * SPHERE.yield_stress * math.log(2)
    return [collapse(problem).row("sphere, OnScale's", size, exact, 2e-3)]


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of all cases. Collective."""
    return [row for part in (cut, vessel, sphere) for row in part(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
