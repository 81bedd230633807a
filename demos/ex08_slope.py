"""The factor of safety of a slope, with a proof of each bound.

The program divides all strengths of the soil by a factor F, and computes two values of F. At the
smaller value the slope is certainly stable; at the larger value it certainly collapses.

This is the first slope of Griffiths and Lane (Géotechnique 49 (1999), 387): 2:1, friction angle
20°, c/γH = 0.05. Their finite elements gave 1.4, and log spirals prove that F is at most 1.3978.
"""

from mpi4py import MPI

from meshes.slope import write_slope
from perfplast_fenicsx import (
    BodyForce,
    DruckerPrager,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Support,
    draw,
    factor_of_safety,
    read_gmsh,
)
from perfplast_fenicsx.problem import Prescribed

comm = MPI.COMM_WORLD
folder = ResultFolder(comm, "results/ex08", force=True)
folder.create()
file = folder.file("slope.msh")
folder.on_root(lambda: write_slope(file, size=0.2))

soil = DruckerPrager(
    young=1e4, poisson=0.3, cohesion=0.05, friction_angle=20.0, match="plane-strain"
)
loads = [BodyForce("soil", (0.0, -1.0), constant=True)]  # unit weight and height of the slope are 1
supports = [Support("bottom"), Support("left", "x")]
problem = Problem(read_gmsh(comm, file), {"soil": soil}, supports, loads, degree=2)

found = factor_of_safety(problem, tolerance=1e-2)  # an Adaptation would narrow the bracket

SPIRAL = 1.3978
assert found.lower is not None
assert found.upper is not None
assert found.lower < SPIRAL
assert found.lower < found.upper < 1.25 * found.lower

if __name__ == "__main__":
    if comm.rank == 0:
        print(found.in_words())
    scene = Scene("Slope 2:1, mechanism at the larger F", loads)
    writer = ResultWriter(folder, problem, scene, "interior-point", prescribed=Prescribed.WORK)
    writer.write_safety(writer.judged_safety(found))  # stands.h5 and falls.h5 are the proofs
    draw(folder)  # results/ex08/mechanism.png
