"""Two blocks on a rigid floor: load levels with contact.

The floor carries the lower block, and the lower block carries the upper block, without friction.
The load increases in steps. Newton's method computes displacements, stresses and contact forces at
each load factor, and a duality gap certifies each level.

Exact: the stress is uniform, so the weaker block yields at its yield stress, 200. The top moves
like the end of two springs in series.
"""

import math

from mpi4py import MPI

from perfplast_fenicsx import (
    Contact,
    Newton,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Support,
    VonMises,
    draw,
    load_path,
    stacked_blocks,
)

comm = MPI.COMM_WORLD
HEIGHTS = (0.7, 1.2)
steel = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
aluminium = VonMises(young=70000.0, poisson=0.33, yield_stress=200.0)

loads = [Pressure("top", 1.0)]
contacts = [Contact("lower_top", "upper_bottom")]
floor = [Plane("bottom", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))]
problem = Problem(
    stacked_blocks(comm, n=2, heights=HEIGHTS),
    {"lower": steel, "upper": aluminium},
    [Support("x0", "x"), Support("y0", "y")],
    loads,
    contacts,
    floor,
)

newton = Newton(problem)
levels = list(load_path(newton, [50.0, 100.0, 150.0, 199.0]))

shortening = HEIGHTS[0] / steel.young + HEIGHTS[1] / aluminium.young  # under a unit pressure
for level in levels:
    report = level.report
    assert report.converged, report.reason
    assert abs(report.duality_gap) < 1e-10
    assert report.max_penetration < 1e-12
    # The work of the unit pressure on the unit top is the displacement of the top.
    assert math.isclose(report.alpha, shortening * report.zeta, rel_tol=1e-8)

# Above the limit load there is no equilibrium, and the solver reports this.
assert not newton.solve(201.0, levels[-1].state).report.converged

if __name__ == "__main__":
    folder = ResultFolder(comm, "results/ex03", force=True)
    folder.create()
    scene = Scene("Two blocks on a rigid floor", loads, contacts, floor)
    writer = ResultWriter(folder, problem, scene, newton.method, prescribed=newton.prescribes)
    for level in levels:
        if comm.rank == 0:
            print(level)
        writer.write(level)
    writer.results.write()
    draw(folder)  # results/ex03/fields.png
