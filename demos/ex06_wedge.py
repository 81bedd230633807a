"""Contact on an inclined plane, with an unstructured mesh.

A steel block lies on an aluminium block. They touch on an inclined plane without friction. A
pressure on top pushes the upper block down the incline, against a wall at x = 0. Gmsh generates the
mesh. Only the contact supports the upper block in z.

Exact: the contact force acts along the normal of the incline; its vertical component is the load.
"""

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from meshes.wedge import LENGTH, SEAM, WIDTH, write_wedge
from perfplast_fenicsx import (
    Contact,
    Newton,
    OutputFields,
    Pressure,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Support,
    VonMises,
    draw,
    load_path,
    read_gmsh,
)

comm = MPI.COMM_WORLD
steel = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
aluminium = VonMises(young=70000.0, poisson=0.33, yield_stress=200.0)
loads = [Pressure("top", 1.0)]
contacts = [Contact("upper_seam", "lower_seam")]

folder = ResultFolder(comm, "results/ex06", force=True)
folder.create()
file = folder.file("wedge.msh")
folder.on_root(lambda: write_wedge(file, size=0.4))
tagged = read_gmsh(comm, file)
supports = [Support("bottom"), Support("x0", "x"), Support("y0", "y")]
problem = Problem(tagged, {"lower": aluminium, "upper": steel}, supports, loads, contacts)

newton, fields = Newton(problem), OutputFields(problem)
scene = Scene("A block pressed down an incline", loads, contacts)
writer = ResultWriter(folder, problem, scene, newton.method, prescribed=newton.prescribes)

# The force of the lower block on the upper block is −∫ p n over the incline.
ds = ufl.Measure("ds", domain=tagged.mesh, subdomain_data=tagged.facet_tags)
seam = ds(tagged.surfaces["upper_seam"])
n = ufl.FacetNormal(tagged.mesh)
rise = (SEAM[1] - SEAM[0]) / LENGTH
for level in load_path(newton, [100.0, 180.0]):
    assert level.report.converged, level.report.reason
    p = fields.update(level)["contact_pressure"]
    parts = [fem.assemble_scalar(fem.form(-p * n[i] * seam)) for i in range(3)]
    force = np.array(comm.allreduce(np.array(parts)))
    load = level.report.zeta * LENGTH * WIDTH
    assert np.allclose(force, load * np.array([-rise, 0.0, 1.0]), rtol=0, atol=1e-8 * load)
    if comm.rank == 0:
        print(f"zeta = {level.report.zeta:g}: contact force {force.round(6)}")
    writer.write(level)
assert level.report.plastic_cells > 0

if __name__ == "__main__":
    writer.results.write()
    draw(folder)  # results/ex06/fields.png
