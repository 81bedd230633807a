"""Four algorithms for the same level.

Čermák, Haslinger and Sysala (COMPLAS XII, 2013) describe four methods. ALG1 and ALG2 prescribe the
load ζ and compute the work α; ALG3 and ALG4 prescribe α and compute ζ. All four find the same
state.

| | prescribed | each iteration solves |
|---|---|---|
| ALG1, `Newton` | load ζ | a contact problem with a new tangent; damped |
| ALG2, `AugmentedLagrangian` | load ζ | a contact problem, always with the elastic operator |
| ALG3, `WorkNewton` | work α | like ALG1, with prescribed work; damped |
| ALG4, `BorderedNewton` | work α | like ALG3, without damping |
"""

import math

from mpi4py import MPI

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BorderedNewton,
    Contact,
    Level,
    Newton,
    Problem,
    Support,
    Traction,
    VonMises,
    WorkNewton,
    load_path,
    two_blocks,
)

comm = MPI.COMM_WORLD
ZETA = 200.0  # linear elements lock: the limit load of this mesh is larger than that of the blocks
steel = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)  # MPa
problem = Problem(
    two_blocks(comm, n=2),
    {"lower": steel, "upper": steel},
    [Support("left")],
    [Traction("top", (0.0, 0.0, -1.0))],
    [Contact("upper_bottom", "lower_top")],
)

levels: dict[str, Level] = {}
levels["ALG1"] = Newton(problem).solve(ZETA)
alpha = levels["ALG1"].report.alpha
uzawa = AugmentedLagrangian(problem, AugmentedLagrangianOptions(tolerance=1e-6))
levels["ALG2"] = uzawa.solve(ZETA)
levels["ALG3"] = list(load_path(WorkNewton(problem), [alpha / 2, alpha]))[-1]
levels["ALG4"] = list(load_path(BorderedNewton(problem), [alpha / 2, alpha]))[-1]

for name, level in levels.items():
    assert level.report.converged, (name, level.report.reason)
    assert math.isclose(level.report.zeta, ZETA, rel_tol=1e-4), (name, level.report.zeta)
    assert math.isclose(level.report.alpha, alpha, rel_tol=1e-4), (name, level.report.alpha)
assert levels["ALG1"].report.plastic_cells > 0

if __name__ == "__main__" and comm.rank == 0:
    from pathlib import Path

    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4), layout="constrained")
    for (name, level), mark in zip(levels.items(), ("o-", "s-", "D-", ".--"), strict=True):
        print(f"{name}: {level}")
        steps = level.iterations
        axes.semilogy([s.number for s in steps], [s.increment for s in steps], mark, label=name)
    axes.set(xlabel="iteration", ylabel="increment, relative", xscale="log")
    axes.set_title("Two blocks: convergence at the same load")
    axes.legend()
    Path("results/ex10").mkdir(parents=True, exist_ok=True)
    figure.savefig("results/ex10/convergence.png", dpi=110)
