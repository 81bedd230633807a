# %% [markdown]
# # A block pressed down an incline
#
# A steel block stands on an aluminium one. They meet on an inclined plane without friction, so that
# a pressure on top drives the upper one down the incline, against a wall at x = 0, and makes the
# lower one yield. The mesh is unstructured and comes from a gmsh file, as those of users do.
#
#                    ζ
#              ↓ ↓ ↓ ↓ ↓ ↓ ↓
#            ▒┌─────────────┐ z = 2
#            ▒│    upper    │
#            ▒│         ___ ┤ 1.25
#            ▒│ ___ ‾‾‾     │
#       0.75 ▒┤‾   lower    │
#            ▒└─────────────┘
#             ▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒
#             x = 0         2      one unit thick
#
# The wall only stops motion along x, and the wall y = 0 only such along y. So nothing but the
# contact carries the upper block in z, which is what the end of this text checks: the contact
# forces are pushes along the normal of the incline, and their sum F has F_z = ζ A, with A the area
# of the top, on any mesh.
#
# **Limits.** Linear tetrahedra lock in plastic flow, so that the lower block carries somewhat too
# much. The load is applied to the undeformed bodies: the incline stays where it was.
#
#     ./fenicsx mpirun -n 2 python3 demos/wedge.py -o results/wedge

# %%
import argparse
from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from meshes.wedge import LENGTH, SEAM, WIDTH, write_wedge
from perfplast_fenicsx import (
    Contact,
    Newton,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    load_path,
    read_gmsh,
)
from perfplast_fenicsx.cli import Terminal
from perfplast_fenicsx.io import OutputFields, ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "A block pressed down an incline"

# %% [markdown]
# ## The problem
#
# Stresses in MPa. The two bodies share no node: `meshes/wedge.py` meshes both in one go, so that
# the nodes on the incline match, and then cuts them apart.

# %%
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
ALUMINIUM = VonMises(young=70000.0, poisson=0.33, yield_stress=200.0)
SUPPORTS = [Support("bottom"), Support("x0", "x"), Support("y0", "y")]
LOADS = [Pressure("top", 1.0)]
CONTACTS = [Contact("upper_seam", "lower_seam")]
ZETAS = [100.0, 150.0, 180.0, 200.0]

# %% [markdown]
# ## What the contact carries
#
# The nodal pressures p are nodal forces over nodal areas, so the integral of the field over the
# surface gives back their sum.


# %%
def contact_force(tagged_mesh: TaggedMesh, pressure: fem.Function) -> np.ndarray:
    """Force of the lower block on the upper one, −∫ p n over the upper one's seam. Collective."""
    mesh = tagged_mesh.mesh
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged_mesh.facet_tags)
    n = ufl.FacetNormal(mesh)
    seam = ds(tagged_mesh.surfaces["upper_seam"])
    parts = [fem.assemble_scalar(fem.form(-pressure * n[i] * seam)) for i in range(3)]
    return np.asarray(mesh.comm.allreduce(np.array(parts)))


# %% [markdown]
# ## Solve


# %%
def main(argv: Sequence[str] | None = None) -> None:
    """Press the blocks, write results, check the balance of forces. Collective."""
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("-o", "--output", default="results/wedge", help="replaced if there")
    parser.add_argument("--coarse", action="store_true", help="edges of 0.5 instead of 0.15")
    arguments = parser.parse_args(argv)

    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, arguments.output, force=True)
    folder.create()
    file = folder.file("wedge.msh")
    folder.on_root(lambda: write_wedge(file, size=0.5 if arguments.coarse else 0.15))
    tagged_mesh = read_gmsh(comm, file)
    materials = {"lower": ALUMINIUM, "upper": STEEL}
    problem = Problem(tagged_mesh, materials, SUPPORTS, LOADS, CONTACTS)
    newton, recovery = Newton(problem), OutputFields(problem)

    scene = Scene(TITLE, LOADS, CONTACTS)
    writer = ResultWriter(folder, problem, scene, newton.method, prescribed=newton.prescribes)
    terminal = Terminal(comm)
    terminal.header(TITLE, newton.method, problem)
    forces = []
    for level in load_path(newton, ZETAS, terminal.iteration):
        terminal.level(level.report)
        assert level.report.converged, level.report.reason
        pressure = recovery.update(level)["contact_pressure"]
        forces.append(contact_force(tagged_mesh, pressure))
        writer.write(level)

    # %% [markdown]
    # ## Is it right?
    #
    # All forces are along −n, and their vertical part is the load.

    # %%
    terminal.say("\n     zeta  force of the lower block on the upper one (x, y, z)")
    rise = (SEAM[1] - SEAM[0]) / LENGTH
    for zeta, force in zip(ZETAS, forces, strict=True):
        terminal.say(f"{zeta:>9g}  {force[0]:z12.6f}  {force[1]:z12.6f}  {force[2]:z12.6f}")
        expected = zeta * LENGTH * WIDTH * np.array([-rise, 0.0, 1.0])
        assert np.allclose(force, expected, rtol=0, atol=1e-8 * expected[2]), (force, expected)
    assert all(abs(report.duality_gap) < 1e-10 for report in writer.results.reports)

    draw(folder)
    terminal.say("\nAll checks passed.")
    terminal.results(folder)
    terminal.say("Look at fields.png and path.png there; open fields.vtkhdf.series with ParaView.")


# %%
if __name__ == "__main__":
    main()
