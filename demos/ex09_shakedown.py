"""Shakedown of a thick tube under a varying pressure.

A pressure varies between 0 and λ p. Below the shakedown load the tube yields a few times and then
responds elastically. Above this load the tube yields in every cycle. Melan's theorem gives the
largest λ for the mesh.

Exact: alternating yield at the inner radius limits thick tubes, at twice the elastic limit.
Collapse limits thin tubes, at (2/√3) σ_y ln(b/a). Both limits are equal at b/a = 2.2.
"""

import math
from functools import partial

from mpi4py import MPI

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    LoadDomain,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    read_gmsh,
    shakedown_load,
)

comm = MPI.COMM_WORLD
steel = VonMises(young=2e5, poisson=0.3, yield_stress=1.0)
folder = ResultFolder(comm, "results/ex09", force=True)
folder.create()


def elastic_limit(ratio: float) -> float:
    """Return the pressure of first yield by Lamé's stresses, in plane strain."""
    share = 1 / (ratio**2 - 1)
    radial, hoop = -1.0, share * (1 + ratio**2)
    axial = steel.poisson * (radial + hoop)
    mean = (radial + hoop + axial) / 3
    return 1 / math.sqrt(1.5 * sum((s - mean) ** 2 for s in (radial, hoop, axial)))


rows = []
for ratio in (1.5, 2.0, 3.0):
    file = folder.file(f"tube_{ratio:g}.msh")
    folder.on_root(partial(write_thick_tube, file, outer=ratio, size=0.1))
    supports = [Support("x0", "x"), Support("y0", "y")]
    loads = [Pressure("inner", 1.0, name="p")]
    problem = Problem(read_gmsh(comm, file), {"tube": steel}, supports, loads, degree=2)

    found = shakedown_load(problem, LoadDomain.of_ranges({"p": (0.0, 1.0)}))

    collapse, alternating = 2 / math.sqrt(3) * math.log(ratio), 2 * elastic_limit(ratio)
    assert found.load is not None
    assert math.isclose(found.load, min(collapse, alternating), rel_tol=0.02), (ratio, found.load)
    rows.append((ratio, found.load, collapse, alternating))

if __name__ == "__main__" and comm.rank == 0:
    from matplotlib import pyplot

    for row in rows:
        print("b/a = {:g}: {:.5g}; collapse {:.5g}, alternating yield {:.5g}".format(*row))
    figure, axes = pyplot.subplots(figsize=(7, 4), layout="constrained")
    ratios = [1.3 + 0.02 * i for i in range(96)]
    axes.plot(ratios, [2 / math.sqrt(3) * math.log(r) for r in ratios], label="collapse")
    axes.plot(ratios, [2 * elastic_limit(r) for r in ratios], label="twice the elastic limit")
    axes.plot(*list(zip(*rows, strict=True))[:2], "ko", label="computed")
    axes.set(xlabel="b/a", ylabel="pressure / yield stress", title="Shakedown of a thick tube")
    axes.legend()
    figure.savefig("results/ex09/shakedown.png", dpi=110)
