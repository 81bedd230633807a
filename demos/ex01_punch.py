"""The limit load of a square punch, and how it collapses.

A square punch rests without friction on a base of the same metal; the mesh is a quarter of both
bodies. The interior point method computes the limit load of the mesh together with the collapse
mechanism, without load steps.

Exact: the punch yields first, in uniform compression, at the yield stress 400 √(3/2) MPa.
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
    VonMises,
    draw,
    limit_load,
    punch,
)
from perfplast_fenicsx.problem import Prescribed

comm = MPI.COMM_WORLD
EXACT = 400 * math.sqrt(1.5)  # MPa

metal = VonMises(young=2e5, poisson=0.3, yield_stress=EXACT)
loads = [Pressure("top", 1.0)]
contacts = [Contact("punch_bottom", "base_top")]
problem = Problem(
    punch(comm, n=4),
    {"base": metal, "punch": metal},
    [
        Support("x0", "x"),
        Support("y0", "y"),
        Support("bottom"),
    ],  # two planes of symmetry, and the floor
    loads,
    contacts,
)

limit = limit_load(problem, rtol=1e-5)

# Both values hold for the mesh. They agree with the exact load, because the stress is uniform.
assert limit.levelled_off, limit.reason
assert limit.estimate is not None
assert math.isclose(limit.estimate, EXACT, rel_tol=1e-5)

if __name__ == "__main__":
    if comm.rank == 0:
        print(f"limit load {limit.estimate:.6g}, exact {EXACT:.6g}; {limit.iterations} steps")
    folder = ResultFolder(comm, "results/ex01", force=True)
    folder.create()
    scene = Scene("Square punch: collapse mechanism", loads, contacts)
    writer = ResultWriter(folder, problem, scene, limit.method, prescribed=Prescribed.WORK)
    writer.write_limit(limit)
    draw(folder)  # results/ex01/mechanism.png
