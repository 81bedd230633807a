# %% [markdown]
# # Bodies of revolution: a thick sphere, a thick tube, a circular footing
#
# Half of a section represents the whole body. The [thick sphere](thick_sphere.py) must have the
# same curve ζ(α) and the same limit load as its octant in 3D, both as one body and divided at a
# radius of 1.4a into two shells in contact. The tube between smooth planes has p = 2/√3 σ_y
# ln(b/a).
#
# A smooth circular footing on a half space has the limit pressure 5.69 c with Tresca's condition
# (R. T. Shield, Proc. R. Soc. A 233, 1955). With von Mises' condition no exact value is known. The
# von Mises yield set lies between those of two Tresca materials: it contains the set with c =
# σ_y/2, and lies within the set with c = σ_y/√3. So
#
#     5.69/2 = 2.845 ≤ p/σ_y ≤ 3.285 = 5.69/√3.
#
# For a rough footing the limit pressure is 6.05 c (G. Eason, R. T. Shield, ZAMP 11, 1960), and so
# 3.025 to 3.493 σ_y.
#
# The table shows the middle of the range as the exact value, and half of its width as the allowed
# error. The smooth footing is modelled in two ways: as a pressure on the ground, and as a punch
# that is a thousand times stiffer than the ground and touches it without friction. The rough
# footing is a support that moves down. The results hold for the mesh: u_r/r is not a polynomial,
# and this demo computes no strict bounds.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/axisymmetry.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification import strip_footing, thick_sphere
from demos.verification.slip import subfolder
from demos.verification.study import Row, collapse, mesh, run
from demos.verification.thick_sphere import INTERFACE, MATERIAL, RADII, exact_points
from meshes.ring import write_ring
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Newton,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    WorkNewton,
    load_path,
)
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Bodies of revolution"
ALLOWED = 2e-3
OUTER = 2.0
LOADS = [Pressure("inner", 1.0)]
TUBE = 2 / math.sqrt(3) * MATERIAL.yield_stress * math.log(OUTER)
SMOOTH, ROUGH = 5.69, 6.05
"""Limit pressures of smooth and rough circular footings, divided by the cohesion c (Tresca)."""
MIDDLE = (1 / 2 + 1 / math.sqrt(3)) / 2
"""Mean of c/σ_y for the two Tresca materials, where σ_y is von Mises' yield stress."""
WIDTH = (1 / math.sqrt(3) - 1 / 2) / 2 / MIDDLE
"""Relative distance of the two Tresca materials from the mean."""
WAY = (0.005, 0.02, 0.1, 1.0)
"""Displacements of the rough footing; at the last displacement, the load has levelled off."""


# %% [markdown]
# ## Spheres and tubes


# %%
def shell(tagged_mesh: TaggedMesh, degree: int) -> Problem:
    """Return half of a shell, or of a shell in another shell, under inner pressure."""
    contacts = [Contact("inner_tube_seam", "outer_tube_seam")]
    return Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, MATERIAL),
        [Support("y0", "y")],
        LOADS,
        contacts if len(tagged_mesh.volumes) > 1 else [],
        degree=degree,
    )


def curve_error(problem: Problem) -> tuple[float, int]:
    """Return the largest relative error of ζ(α) for half a shell, and linear solves. Collective."""
    exact = exact_points(RADII)
    solver = WorkNewton(problem)
    levels = list(load_path(solver, [4 * alpha for alpha, _ in exact]))  # four octants
    if not all(level.report.converged for level in levels):
        return math.nan, solver.linear.solves
    zetas = [zeta for _, zeta in exact]
    errors = [abs(lv.state.zeta / zeta - 1) for lv, zeta in zip(levels, zetas, strict=True)]
    return max(errors), solver.linear.solves


def spheres(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the curves and limit loads of whole and divided shells. Collective."""
    rows = []
    for case, interface in (("sphere's section", None), ("sphere's section, divided", INTERFACE)):
        limits = []
        for size in (0.3,) if coarse else (0.3, 0.15, 0.075):
            tagged_mesh = mesh(
                folder, write_thick_tube, outer=OUTER, interface=interface, size=size, order=2
            )
            problem = shell(tagged_mesh.turned(), degree=2)
            began = time.perf_counter()
            error, solves = curve_error(problem)
            rows.append(
                Row(
                    case=case,
                    quantity="largest error of ζ(α)",
                    element="P2, curved",
                    size=size,
                    dofs=problem.num_dofs,
                    computed=error,
                    exact=0.0,
                    allowed=ALLOWED,
                    solves=solves,
                    seconds=time.perf_counter() - began,
                )
            )
            limits.append(collapse(problem).row(case, size, thick_sphere.EXACT, ALLOWED))
        rows += limits
    return rows


def tubes(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads of a tube between smooth planes. Collective."""
    rows = []
    for degree in (1, 2):
        for size in (0.2,) if coarse else (0.2, 0.1, 0.05):
            tagged_mesh = mesh(folder, write_ring, outer=OUTER, height=0.4, size=size).turned()
            supports = [Support("bottom", "y"), Support("top", "y")]
            problem = Problem(tagged_mesh, {"ring": MATERIAL}, supports, LOADS, degree=degree)
            found = collapse(problem)
            rows.append(found.row("tube's section", size, TUBE, ALLOWED if degree == 2 else None))
    return rows


# %% [markdown]
# ## The footing


# %%
def footings(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit pressures, over σ_y, for uniform pressure and for a punch. Collective."""
    rows = []
    soil, stiff = strip_footing.SOIL, strip_footing.STIFF
    contacts = [Contact("ground_footing", "punch_footing")]
    for punch in (False, True):
        loads = [Pressure("top" if punch else "footing", soil.yield_stress)]
        name = "punch" if punch else "pressure"
        for size in (0.4,) if coarse else (0.4, 0.2, 0.1):
            tagged_mesh = mesh(folder, write_strip_footing, size=size, punch=punch).turned()
            problem = Problem(
                tagged_mesh,
                {"ground": soil} | ({"punch": stiff} if punch else {}),
                [Support("side", "x"), Support("bottom")],
                loads,
                contacts if punch else [],
                degree=2,
            )
            found = collapse(problem)
            exact = SMOOTH * MIDDLE
            rows.append(found.row(f"circular footing, {name}", size, exact, WIDTH))
    pictures = subfolder(folder, "footing")
    scene = Scene("Circular footing, smooth", loads, contacts, axisymmetric=True)
    found.write(pictures, scene)
    draw(pictures)
    return rows


def rough(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the reactions of a footing that is tied to the ground and moves down. Collective."""
    rows, soil = [], strip_footing.SOIL
    for size in (0.4,) if coarse else (0.4, 0.2, 0.1):
        ground = mesh(folder, write_strip_footing, size=size).turned()
        supports = [
            *(Support("side", "x"), Support("bottom"), Support("footing", "x")),
            Support("footing", "y", value=-1.0, constant=False),
        ]
        problem = Problem(ground, {"ground": soil}, supports, degree=2)
        began = time.perf_counter()
        solver = Newton(problem)
        *_, last = load_path(solver, WAY)
        down = -last.report.reactions["support footing"][1] / math.pi
        rows.append(
            Row(
                case="circular footing, rough",
                quantity="reaction over area and σ_y",
                element="P2",
                size=size,
                dofs=problem.num_dofs,
                computed=down / soil.yield_stress if last.report.converged else math.nan,
                exact=ROUGH * MIDDLE,
                allowed=WIDTH,
                solves=solver.linear.solves,
                seconds=time.perf_counter() - began,
            )
        )
    return rows


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of all cases. Collective."""
    parts = (spheres, tubes, footings, rough)
    return [row for part in parts for row in part(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
