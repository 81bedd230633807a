"""The curve of load over work, up to the plateau.

If the load is prescribed, no solution exists above the limit load. If the work α of the loads is
prescribed (ALG3 of Čermák, Haslinger and Sysala), every α has a solution. The load ζ(α) is linear
up to first yield, then increases more slowly, and levels off at the limit load.

Exact: a thick tube in plane strain carries the inner pressure (2/√3) σ_y ln(b/a).
"""

import math
from itertools import pairwise

from mpi4py import MPI

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    WorkNewton,
    limit_load,
    load_path,
    read_gmsh,
)

comm = MPI.COMM_WORLD
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)  # MPa
EXACT = 2 / math.sqrt(3) * STEEL.yield_stress * math.log(2.0)

folder = ResultFolder(comm, "results/ex04", force=True)
folder.create()
file = folder.file("tube.msh")
folder.on_root(lambda: write_thick_tube(file, outer=2.0, size=0.2, order=2))
supports = [Support("x0", "x"), Support("y0", "y")]
loads = [Pressure("inner", 1.0)]
problem = Problem(read_gmsh(comm, file), {"tube": STEEL}, supports, loads, degree=2)

solver = WorkNewton(problem)
limit = limit_load(problem, rtol=1e-4, solver=solver)  # chooses its own steps in α
assert limit.levelled_off, limit.reason
assert limit.estimate is not None
assert math.isclose(limit.estimate, EXACT, rel_tol=1e-3)

# Levels at prescribed works show where the curve bends.
first = limit.levels[0].report
stiffness = first.zeta / first.alpha  # stiffness of the elastic tube
works = [factor * EXACT / stiffness for factor in (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0)]
reports = [level.report for level in load_path(solver, works)]
assert all(report.converged for report in reports)
assert all(one.zeta < other.zeta for one, other in pairwise(reports))
assert all(report.zeta <= stiffness * report.alpha * (1 + 1e-6) for report in reports)
assert reports[-1].zeta < EXACT * (1 + 1e-3)

if __name__ == "__main__" and comm.rank == 0:
    from matplotlib import pyplot

    print(f"limit load {limit.estimate:.6g}, exact {EXACT:.6g}")
    figure, axes = pyplot.subplots(figsize=(7, 4), layout="constrained")
    alphas, zetas = zip(*[(r.alpha, r.zeta) for r in reports], strict=True)
    axes.plot((0, *alphas), (0, *zetas), "o-", label="levels, work prescribed")
    axes.axhline(EXACT, color="red", label="exact limit load")
    axes.axline((0, 0), slope=stiffness, color="grey", linestyle="--", label="elastic")
    axes.set(xlabel="work of the loads α", ylabel="pressure ζ (MPa)", ylim=(0, 1.15 * EXACT))
    axes.legend(loc="lower right")
    figure.savefig("results/ex04/curve.png", dpi=110)
