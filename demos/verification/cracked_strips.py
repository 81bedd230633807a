# %% [markdown]
# # Cracked strips in tension, in plane strain
#
# A strip of width 2W is pulled at its ends; by symmetry the mesh is a quarter of the strip. In the
# following formulas k = σ_y/√3, and ζ is the load per area of the whole section.
#
# **A slit of width 2a in the middle.** Each ligament slips freely along one line at 45° from the
# crack tip to the side:
#
#     ζ = 2k (1 − a/W).
#
# **Two notches from the sides**, with a ligament of width 2a between their tips. If the notches are
# deep, the ligament behaves like a footing with the opposite sign of load: it has Prandtl's slip
# lines, and the limit load is given by
#
#     ζ W/a = (2 + π) k.
#
# This solution requires a wide and long strip. The notches must be deeper than 0.884 W (D. J. F.
# Ewing, R. Hill, J. Mech. Phys. Solids 15 (1967) 115); here they are 0.9 W deep, so W = 10 a. The
# length of the strip is 40 a. A strip of half this length fails in a different way: the tension at
# the ends and the force in the ligament bend both halves of the strip, which fail at x = 0 at 4.8
# k.
#
# Near the crack tips, elements are sixteen times smaller than elsewhere.
#
# The mechanism of the first strip is difficult to represent. Its velocity jumps across a single
# slip line, which crosses elements irregularly, whereas Prandtl's fans extend over many elements.
# With ten elements on the ligament the error is still 1.7 %, and it decreases slowly. The demo uses
# a mesh with five elements on the ligament, and does not check the error on this mesh.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/cracked_strips.py

# %%
import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

from demos.verification.slip import Line, draw_slip, prandtl_lines, subfolder
from demos.verification.study import Collapse, Row, collapse, mesh, run
from meshes.cracked_strip import write_cracked_strip
from perfplast_fenicsx import Problem, Support, Traction, VonMises
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Cracked strips, plane strain"
MATERIAL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
K = MATERIAL.yield_stress / math.sqrt(3)
LOADS = [Traction("top", (0.0, 1.0))]
ALLOWED = 0.02


# %%
@dataclass(frozen=True)
class Strip:
    """A cracked strip.

    Attributes:
        name: Name in the table and the pictures.
        width, length: Half width and half length of the strip.
        tip: x of the crack tip.
        held: The surface of the ligament, at y = 0.
        exact: ζ of an infinitely long strip.
        lines: Slip lines of the exact solution.
    """

    name: str
    width: float
    length: float
    tip: float
    held: str
    exact: float
    lines: Sequence[Line]

    def problem(self, folder: ResultFolder, size: float) -> Problem:
        """Return the problem with quadratic elements. Collective."""
        shape = {"width": self.width, "length": self.length, "tip": self.tip}
        tagged_mesh = mesh(folder, write_cracked_strip, size=size, **shape)
        supports = [Support("x0", "x"), Support(self.held, "y")]
        return Problem(tagged_mesh, {"strip": MATERIAL}, supports, LOADS, degree=2)


SLIT = Strip("slit", 1.0, 2.0, 0.5, "outer", 2 * K * (1 - 0.5), [[(0.5, 0.0), (1.0, 0.5)]])
NOTCHED = Strip(
    "two notches", 10.0, 20.0, 1.0, "inner", (2 + math.pi) * K / 10, prandtl_lines(down=False)
)
SHORT = Strip("two notches, short", 10.0, 10.0, 1.0, "inner", NOTCHED.exact, NOTCHED.lines)


# %% [markdown]
# Each mesh has two bounds that are certain: the largest ζ with equilibrium, and the dissipation of
# a mechanism. The first bound must not exceed the second.


# %%
def bounds(strip: Strip, problem: Problem, size: float, found: Collapse) -> list[Row]:
    """Return rows that compare the lower bound for the mesh with an upper bound, if any."""
    lower, upper = found.limit.lower, found.limit.upper
    if upper is None:
        return []
    return [
        Row(
            case=strip.name,
            quantity="lower <= upper bound",
            element="P2",
            size=size,
            dofs=problem.num_dofs,
            computed=lower,
            exact=upper,
            allowed=0.0,
            solves=0,
            seconds=0.0,
            bound=True,
        )
    ]


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads for a strip with a slit and for strips with two notches. Collective."""
    rows = []
    for strip, sizes in ((SLIT, (0.1, 0.05, 0.025)), (NOTCHED, (0.4, 0.2, 0.1))):
        certain = []
        for size in sizes[:2] if coarse else sizes:
            problem = strip.problem(folder, size)
            found = collapse(problem)
            elements = min(strip.tip, strip.width - strip.tip) / size
            judged = strip is NOTCHED or elements >= 10 * (1 - 1e-9)
            allowed = ALLOWED if judged else None
            rows.append(found.row(strip.name, size, strip.exact, allowed))
            certain += bounds(strip, problem, size, found)
        rows += certain
        pictures = subfolder(folder, strip.name.replace(" ", "_"))
        title = f"Strip with {strip.name}"
        found.write(pictures, Scene(title, LOADS))
        if strip is NOTCHED or not coarse:
            draw(pictures)
        draw_slip(pictures, title, strip.lines)
    if not coarse:
        problem = SHORT.problem(folder, 0.2)
        rows.append(collapse(problem).row(SHORT.name, 0.2, SHORT.exact, None))
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
