"""A sliding block with Coulomb friction.

A constant pressure of 10 acts on a block that lies on another block, and a traction pushes the
upper block sideways. The coefficient of friction is 0.3, so the block slides at a traction of 3,
long before it yields.

With Coulomb friction, no limit theorem holds, because slip is not normal to the friction cone. The
result is therefore the load at which this path loses equilibrium. It does not bound the limit loads
of other paths.
"""

import math

from mpi4py import MPI

from perfplast_fenicsx import (
    Contact,
    Pressure,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Support,
    Traction,
    VonMises,
    draw,
    limit_load,
    stacked_blocks,
)
from perfplast_fenicsx.problem import Prescribed

comm = MPI.COMM_WORLD
PRESSURE, FRICTION = 10.0, 0.3

steel = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
loads = [Pressure("top", PRESSURE, constant=True), Traction("top", (1.0, 0.0, 0.0))]
contacts = [Contact("upper_bottom", "lower_top", coulomb=FRICTION)]
problem = Problem(
    stacked_blocks(comm, n=2, heights=(0.5, 0.5)),
    {"lower": steel, "upper": steel},
    [Support("bottom"), Support("y0", "y")],
    loads,
    contacts,
)

limit = limit_load(problem, rtol=1e-3)

assert not limit.theorem
assert math.isclose(limit.lower, FRICTION * PRESSURE, rel_tol=2e-3), limit

if __name__ == "__main__":
    if comm.rank == 0:
        print(f"slides at {limit.lower:.6g}, exact {FRICTION * PRESSURE:.6g}")
    folder = ResultFolder(comm, "results/ex07", force=True)
    folder.create()
    scene = Scene("A block that slides", loads, contacts)
    writer = ResultWriter(folder, problem, scene, limit.method, prescribed=Prescribed.WORK)
    for level in limit.levels:
        writer.write(level)
    writer.write_limit(limit)
    draw(folder)  # results/ex07/mechanism.png
