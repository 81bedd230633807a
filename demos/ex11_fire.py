"""Steel beside a fire: the strength follows the temperature.

DOLFINx solves the heat equation in a bar, whose yield stress decreases with temperature. Plates
that do not rotate pull the bar.

Exact: the bar slips along a line at 45°, and carries the integral of 2/√3 times its yield stress.
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from matplotlib.figure import Figure

import perfplast_fenicsx as pp

comm = MPI.COMM_WORLD
LENGTH, HEIGHT, HOT, COLD = 3.0, 1.0, 600.0, 20.0  # m, m, degrees

bar = mesh.create_rectangle(comm, [(0.0, 0.0), (LENGTH, HEIGHT)], [24, 8])
V = fem.functionspace(bar, ("Lagrange", 1))
fixed = []
for y, value in ((0.0, HOT), (HEIGHT, COLD)):
    edge = fem.locate_dofs_geometrical(V, lambda x, y=y: np.isclose(x[1], y))
    fixed.append(fem.dirichletbc(np.array(value), edge, V))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
conduction = fem.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
A = petsc.assemble_matrix(conduction, bcs=fixed)
A.assemble()
b = petsc.assemble_vector(fem.form(fem.Constant(bar, np.float64(0.0)) * v * ufl.dx))
petsc.apply_lifting(b, [conduction], [fixed])
b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
petsc.set_bc(b, fixed)
solver = PETSc.KSP().create(comm)
solver.setOperators(A)
solver.setType("preonly")
solver.pc.setType("lu")
temperature = fem.Function(V, name="temperature")
solver.solve(b, temperature.x.petsc_vec)
temperature.x.scatter_forward()

strength = fem.Function(V, name="yield stress")
strength.x.array[:] = 450.0 - 0.5 * (temperature.x.array - COLD)  # MPa

cells = np.arange(bar.topology.index_map(2).size_local, dtype=np.int32)
of_cells = mesh.meshtags(bar, 2, cells, np.ones_like(cells))
ends = mesh.locate_entities_boundary(bar, 1, lambda x: (x[0] < 1e-9) | (x[0] > LENGTH - 1e-9))
right = mesh.compute_midpoints(bar, 1, ends)[:, 0] > LENGTH / 2
of_facets = mesh.meshtags(bar, 1, ends, np.where(right, 2, 1).astype(np.int32))
tagged = pp.TaggedMesh.from_tags(bar, of_cells, of_facets, {"bar": 1}, {"left": 1, "right": 2})

build = pp.ProblemBuilder(tagged)
on = build.surfaces
build.material(pp.VonMises(206900.0, 0.29, pp.field_of(strength)), build.bodies.bar)
build.add(pp.Support(on.left, "x"), pp.RigidSurface(on.right, held="y"))
build.add(pp.Force(on.right, (1.0, 0.0)))  # MN for each metre of depth
bounds = pp.limit_bounds(build.problem(degree=2))

exact = 2 / np.sqrt(3) * (450.0 - 0.25 * (HOT - COLD)) * HEIGHT
low, high = bounds.lower.value, bounds.upper.value
assert bounds.lower.strict and bounds.upper.strict
assert low is not None and high is not None
assert low <= exact * (1 + 1e-8) and high >= exact * (1 - 1e-8)
assert high - low < 0.02 * exact

if __name__ == "__main__":
    folder = pp.ResultFolder(comm, "results/ex11", force=True)
    folder.create()
    if comm.rank == 0:
        print(f"{low:.4f} <= {exact:.4f} <= {high:.4f}")
    figure = Figure(layout="constrained")
    bounds.plot(figure.subplots())
    if comm.rank == 0:
        figure.savefig("results/ex11/bounds.png")
