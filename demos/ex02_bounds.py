"""Strict bounds on the limit load of a plate, with a proof.

A square plate with a square hole is pulled in plane strain; the mesh is a quarter of the plate.
`adaptive_bounds` computes a lower and an upper bound on the limit load of the plate, not only of
the mesh, and refines the mesh where the bounds differ. A separate program checks the proof.

Known: a mechanism with a plastic hinge in each arm gives the upper bound 0.77846 σ_y / √3.
"""

import math

from mpi4py import MPI

from meshes.plate_with_hole import write_plate_with_hole
from perfplast_fenicsx import (
    Adaptation,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Support,
    Traction,
    VonMises,
    adaptive_bounds,
    draw,
    read_gmsh,
)
from perfplast_fenicsx.problem import Prescribed
from perfplast_fenicsx.proof import check

comm = MPI.COMM_WORLD
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)  # MPa
HINGES = 0.77846 * STEEL.yield_stress / math.sqrt(3)

folder = ResultFolder(comm, "results/ex02", force=True)
folder.create()
file = folder.file("plate.msh")
folder.on_root(lambda: write_plate_with_hole(file, size=1.0))

loads = [Traction("top", (0.0, 1.0))]
rollers = [Support("x0", "x"), Support("y0", "y")]
problem = Problem(read_gmsh(comm, file), {"plate": STEEL}, rollers, loads, degree=2)

found = adaptive_bounds(problem, Adaptation(until=0.05, cells=800))

lower, upper = found.body.lower.value, found.body.upper.value
assert lower is not None
assert upper is not None
assert found.body.strict
assert lower < HINGES
assert lower < upper < 1.05 * lower

# The proof file contains the stress and the velocity as numbers. The checker shares no code with
# the program that computed these numbers: it imports only NumPy and h5py.
scene = Scene("Plate with a hole: collapse mechanism", loads)
writer = ResultWriter(folder, problem, scene, "interior-point", prescribed=Prescribed.WORK)
writer.write_limit(found.best.mesh, found.body, found)
if comm.rank == 0:
    proven = check(folder.file("bounds.h5"))
    for half, bound in (("lower", lower), ("upper", upper)):
        assert proven[half].faults == ()
        assert math.isclose(proven[half].proven or 0.0, bound, rel_tol=1e-9)

if __name__ == "__main__":
    if comm.rank == 0:
        print(f"{found.body.in_words()} A hand calculation gives at most {HINGES:.6g}.")
    draw(folder)  # results/ex02/mechanism.png
