# %% [markdown]
# # A thick tube under inner pressure, in plane strain
#
# A long tube of inner radius a and outer radius b yields first at the inner surface. The tube
# collapses when the plastic zone reaches the outer surface. Then σ_θ − σ_r = 2k everywhere, with k
# = σ_y/√3, and
#
#     p = 2k ln(b/a),
#
# for any elastic constants. With b/a = 1.3 and σ_y = 250, p = 75.74 (R. Hill, The Mathematical
# Theory of Plasticity, Oxford 1950, chapter V).
#
# In another case the tube consists of two tubes, one in the other, without friction. By symmetry
# the shear stress at the interface is zero, and the pressure keeps the interface closed, so the
# solution is the same. This case tests contact on curved surfaces.
#
# Linear triangles lock. Each triangle must preserve its area in plastic flow, but a mesh has about
# two triangles for each node, which has two unknowns. The limit load is therefore too large, by an
# amount that depends on the mesh.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/thick_tube.py

# %%
import math
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, collapse, mesh, run
from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import Contact, Pressure, Problem, Support, VonMises
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Thick tube, plane strain"
MATERIAL = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)
EXACT = 2 / math.sqrt(3) * MATERIAL.yield_stress * math.log(OUTER)
LOADS = [Pressure("inner", 1.0)]
SUPPORTS = [Support("x0", "x"), Support("y0", "y")]
CONTACTS = [Contact("inner_tube_seam", "outer_tube_seam")]


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for burst pressures of undivided and divided tubes. Collective."""
    sizes = (0.1, 0.05) if coarse else (0.1, 0.05, 0.025)
    rows = []
    for interface, degree, order in ((None, 1, 1), (None, 2, 2), (1.15, 2, 2)):
        for size in sizes:
            tagged_mesh = mesh(
                folder, write_thick_tube, size=size, order=order, interface=interface
            )
            materials = dict.fromkeys(tagged_mesh.volumes, MATERIAL)
            contacts = CONTACTS if interface else []
            problem = Problem(tagged_mesh, materials, SUPPORTS, LOADS, contacts, degree=degree)
            found = collapse(problem)
            case = "thick tube" if interface is None else "tube in a tube"
            rows.append(found.row(case, size, EXACT, 2e-3 if degree == 2 else None))
    found.write(folder, Scene(TITLE, LOADS, contacts))
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
