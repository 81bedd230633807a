# %% [markdown]
# # A strip footing in plane strain: Prandtl's problem
#
# A long footing of width 2 presses on the ground. At collapse a wedge below the footing moves down,
# two fans rotate about its edges, and a wedge on either side moves up. For a rough or smooth
# footing the collapse pressure is
#
#     p = (2 + π) k,   k = σ_y/√3
#
# (L. Prandtl, Über die Härte plastischer Körper, Nachr. Ges. Wiss. Göttingen 1920). Here the
# pressure acts either directly on the ground or on a punch. The punch is a second body that is a
# thousand times as stiff as the ground and touches it without friction. The punch moves almost as a
# rigid body, whereas the surface under a pressure can move freely. So a mesh has fewer mechanisms
# with a punch, and a larger limit load. In one case the punch has a separate mesh, with elements
# that are 2/3 as large.
#
# The ground is 6 half-widths wide and deep instead of infinite. Its side is held in x; with a free
# side, the ground would split at 4.56 k.
#
# At the edge of the footing the exact velocity jumps, and the stress depends on the direction
# within the fan. Elements near the edge are ten times smaller than elsewhere.
#
# A velocity of quadratic elements that satisfies the incompressibility conditions preserves volume
# everywhere, so its exact plastic work would give an upper bound. But this work is not a
# polynomial, and the program integrates it with three points in each triangle. So the values may
# lie on either side of the exact value. Here they are above the exact value. Linear triangles lock.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/strip_footing.py

# %%
import math
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import draw_slip, prandtl_lines, subfolder
from demos.verification.study import Row, collapse, mesh, run
from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import Contact, Elastic, Pressure, Problem, Support, VonMises
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Strip footing, plane strain"
SOIL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
STIFF = Elastic(young=1000 * SOIL.young, poisson=0.29)
EXACT = (2 + math.pi) * SOIL.yield_stress / math.sqrt(3)
SUPPORTS = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
ALLOWED = 0.015
FALLS = 0.8


# %%
def problem_of(
    folder: ResultFolder, punch: bool, degree: int, size: float, finer: float | None = None
) -> tuple[Problem, list[Pressure], list[Contact]]:
    """Return the problem of the ground, with or without a punch, its loads and contacts.

    Collective.
    """
    tagged_mesh = mesh(folder, write_strip_footing, size=size, punch=punch, finer=finer)
    materials = {"ground": SOIL} | ({"punch": STIFF} if punch else {})
    loads = [Pressure("top" if punch else "footing", 1.0)]
    contacts = [Contact("ground_footing", "punch_footing")] if punch else []
    return (
        Problem(tagged_mesh, materials, SUPPORTS, loads, contacts, degree=degree),
        loads,
        contacts,
    )


# %% [markdown]
# The demo also compares the error on the finest mesh with the error on the coarsest mesh.


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for limit loads under a uniform pressure and under punches. Collective."""
    sizes = (0.4, 0.2) if coarse else (0.4, 0.2, 0.1)
    rows = []
    cases = [("pressure", 1), ("pressure", 2), ("punch", 1), ("punch", 2)]
    if not coarse:
        cases.append(("punch apart", 2))
    for name, degree in cases:
        case, punch = f"footing, {name}", name != "pressure"
        finer = 1.5 if name == "punch apart" else None
        errors = []
        for size in sizes if degree == 2 else sizes[:2]:
            problem, loads, contacts = problem_of(folder, punch, degree, size, finer)
            found = collapse(problem)
            row = found.row(case, size, EXACT, ALLOWED if degree == 2 else None)
            rows.append(row)
            errors.append(abs(row.error))
        if degree == 2:
            rows.append(
                Row(
                    case=case,
                    quantity="error, finest/coarsest",
                    element="P2",
                    size=size,
                    dofs=problem.num_dofs,
                    computed=errors[-1] / errors[0],
                    exact=FALLS,
                    allowed=0.0,
                    solves=0,
                    seconds=0.0,
                    bound=True,
                )
            )
            pictures = subfolder(folder, name.replace(" ", "_"))
            found.write(pictures, Scene(TITLE, loads, contacts))
            if punch or not coarse:
                draw(pictures)
            draw_slip(pictures, TITLE, prandtl_lines(down=True))
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
