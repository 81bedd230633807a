# %% [markdown]
# # Nested tubes and spheres with separate meshes
#
# The nodes of the two bodies do not match at the seam, so contact uses mortar rows. The shear
# stress at the seam is zero by symmetry, so the closed forms for undivided bodies also hold for
# frictionless contact (R. Hill, The Mathematical Theory of Plasticity, Oxford 1950, chapter V):
#
# - A tube in a tube under inner pressure, in plane strain, collapses at p = 2k ln(b/a), k = σ_y/√3.
# - A shell in a shell collapses at p = 2[σ₁ ln(c/a) + σ₂ ln(b/c)], where c is the radius of the
#   seam. The yield stresses are equal in one case; in another case the yield stress of the outer
#   shell is a quarter larger.
# - A tube whose outer radius is larger by δ than the hole of the surrounding tube exerts the
#   pressure p = Eδ(c² − a²)(b² − c²) / (2(1 − ν²) c³ (b² − a²)) (S. Timoshenko, J. N. Goodier,
#   Theory of Elasticity, 1970, § 28) without any load. The model of this press fit is a negative
#   gap.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/meshed_apart.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

import numpy as np

from demos.verification.study import Row, collapse, mesh, run
from meshes.thick_sphere import INNER as CORE
from meshes.thick_sphere import OUTER as SHELL
from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import Contact, Newton, Pressure, Problem, Support, TaggedMesh, VonMises
from perfplast_fenicsx.io import OutputFields, ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Meshed apart"
FINER = 1.5
"""Ratio of the numbers of edges of the outer and the inner body at the seam."""
TUBE = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)
STEEL = VonMises(young=210e3, poisson=0.3, yield_stress=240.0)
SUPPORTS = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]
LOADS = [Pressure("inner", 1.0)]
SHELLS = Contact("inner_shell_seam", "outer_shell_seam")
SPHERE_SEAM, TUBE_SEAM = 1.4, 1.15
FIT = {"interface": 1.5, "outer": 2.5}
FIT_STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=1e3)
OVERLAP = 1.5e-3


# %% [markdown]
# ## Limit loads


# %%
def nested(tagged_mesh: TaggedMesh, inner: VonMises, outer: VonMises) -> Problem:
    """Return one body in another, under inner pressure. Collective."""
    kind = "tube" if "inner_tube" in tagged_mesh.volumes else "shell"
    return Problem(
        tagged_mesh,
        {f"inner_{kind}": inner, f"outer_{kind}": outer},
        SUPPORTS[: tagged_mesh.mesh.geometry.dim],
        LOADS,
        [Contact(f"inner_{kind}_seam", f"outer_{kind}_seam")],
        degree=2,
    )


def limits(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads for tubes, shells, and shells with two yield stresses. Collective."""
    rows = []
    exact = 2 / math.sqrt(3) * TUBE.yield_stress * math.log(OUTER)
    for size in (0.1,) if coarse else (0.1, 0.05):
        shape = {"interface": TUBE_SEAM, "size": size, "order": 2, "finer": FINER}
        found = collapse(nested(mesh(folder, write_thick_tube, **shape), TUBE, TUBE))
        rows.append(found.row("tubes meshed apart", size, exact, 1e-3))
    stronger = replace(STEEL, yield_stress=1.25 * STEEL.yield_stress)
    sizes = {0.5: 2.5e-2} if coarse else {0.35: 1e-2, 0.2: 2.5e-3, 0.13: 1e-3}
    cases = [("shells meshed apart", STEEL), ("in a stronger shell, apart", stronger)]
    for case, outer in cases[1:] if coarse else cases:
        exact = STEEL.yield_stress * math.log(SPHERE_SEAM / CORE)
        exact = 2 * (exact + outer.yield_stress * math.log(SHELL / SPHERE_SEAM))
        for size, allowed in sizes.items():
            shape = {"interface": SPHERE_SEAM, "size": size, "order": 2, "finer": FINER}
            found = collapse(nested(mesh(folder, write_thick_sphere, **shape), STEEL, outer), 1e-3)
            rows.append(found.row(case, size, exact, allowed))
    found.write(folder, Scene(TITLE, LOADS, [SHELLS]))
    draw(folder)
    return rows


# %% [markdown]
# ## The press fit
#
# The mean pressure p follows from the contact force, whose components along x and y are p c.


# %%
def press_fit(folder: ResultFolder, size: float) -> Row:
    """Return the pressure in a press fit of two tubes without loads. Collective."""
    began = time.perf_counter()
    tagged_mesh = mesh(folder, write_thick_tube, size=size, order=2, finer=FINER, **FIT)
    problem = Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, FIT_STEEL),
        SUPPORTS[:2],
        LOADS,
        [Contact("inner_tube_seam", "outer_tube_seam", gap=-OVERLAP, interference=True)],
        degree=2,
    )
    level = Newton(problem).solve(0.0)
    fields = OutputFields(problem)
    fields.update(level)
    b, c, material = FIT["outer"], FIT["interface"], FIT_STEEL
    exact = material.young * OVERLAP * (c**2 - 1) * (b**2 - c**2)
    exact /= 2 * (1 - material.poisson**2) * c**3 * (b**2 - 1)
    return Row(
        case="press fit",
        quantity="mean seam pressure",
        element="P2, curved",
        size=size,
        dofs=problem.num_dofs,
        computed=float(np.linalg.norm(fields.resultants[0])) / (math.sqrt(2) * c),
        exact=exact,
        allowed=2e-3,
        solves=level.report.linear_solves,
        seconds=time.perf_counter() - began,
    )


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the limit loads and the press fit. Collective."""
    return limits(folder, coarse) + [
        press_fit(folder, size) for size in ((0.2,) if coarse else (0.2, 0.1))
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
