# %% [markdown]
# # Total FETI: iterations over the number of subdomains
#
# Two steel blocks lie on each other. Both are clamped at one end, and a pressure ζ presses the
# upper block down. `contact_solver = "tfeti"` divides the blocks into cubes with equal small
# meshes, and forces between the cubes replace the contact and the continuity conditions. A coarse
# problem, the balance of all cubes, couples all cubes at once. So the number of products with the
# dual operator hardly depends on the number of cubes, if each cube has the same number of cells
# (H/h).
#
# Each rank gets whole cubes, so the number of products does not depend on the number of ranks.
#
# In plastic flow the number of products does depend on the number of cubes. In addition to rigid
# motions, the tangent stiffness of a cube in plastic flow has motions with almost no energy, and
# the coarse problem does not contain these motions.
#
# **Limits.** The elements are linear, and the cubes are small. The demo counts products, and does
# not measure times.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/tfeti_scaling.py

# %%
import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx import (
    Contact,
    Level,
    Newton,
    NewtonOptions,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh

STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
CUBES = {2: (1, 1, 1), 4: (2, 1, 1), 8: (2, 2, 1), 16: (2, 2, 2), 32: (4, 2, 2)}
"""Numbers of cubes of each body along its edges, by the number of subdomains."""

TITLE = "Total FETI: iterations against subdomains"

ELASTIC, PLASTIC = 1.0, 0.3
"""ζ below first yield, and the plastic fraction of the volume at the other load."""

GROWTH = 1.3
"""Largest factor by which the products at the elastic level may grow from 8 subdomains on."""


def blocks(comm: MPI.Intracomm, cubes: tuple[int, int, int], n: int) -> TaggedMesh:
    """Return a mesh of two bodies of unit cubes with n cells per edge; ranks get whole cubes."""
    each = math.prod(cubes)
    steps = np.array([1, cubes[0], cubes[0] * cubes[1]])  # body by body, upwards in z

    def rank_of(middles: np.ndarray) -> np.ndarray:
        return (np.floor(middles).astype(np.int32) @ steps) * comm.size // (2 * each)

    length, width, height = (float(number) for number in cubes)
    counts = (cubes[0] * n, cubes[1] * n, cubes[2] * n)
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (length, width, height), counts),
            Box("upper", (0.0, 0.0, height), (length, width, 2 * height), counts),
        ],
        [
            Surface("left", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("top", ("upper",), lambda x: x[2] == 2 * height),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == height),
            Surface("lower_top", ("lower",), lambda x: x[2] == height),
        ],
        rank_of,
    )


def problem(comm: MPI.Intracomm, subdomains: int, n: int) -> Problem:
    return Problem(
        blocks(comm, CUBES[subdomains], n),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
    )


def solved(declared: Problem, subdomains: int, zeta: float) -> Level:
    options = NewtonOptions(contact_solver="tfeti", subdomains=subdomains)
    level = Newton(declared, options).solve(zeta)
    assert level.report.converged, level.report.reason
    return level


def plastic_load(declared: Problem) -> float:
    """Return the ζ at which the fraction ``PLASTIC`` of the volume has yielded."""
    newton = Newton(declared)
    level = newton.solve(ELASTIC)
    while level.report.plastic_fraction < PLASTIC:
        level = newton.solve(1.15 * level.state.zeta, level.state)
    return level.state.zeta


# %%
@dataclass(frozen=True)
class Row:
    """Products with the dual operator on one mesh, at the elastic and at the plastic level."""

    subdomains: int
    unknowns: int
    elastic: int
    flowing: int
    share: float


def row(comm: MPI.Intracomm, subdomains: int, n: int) -> Row:
    declared = problem(comm, subdomains, n)
    elastic = solved(declared, subdomains, ELASTIC).report
    zeta = plastic_load(declared)
    flowing = solved(declared, subdomains, zeta).report
    assert elastic.plastic_cells == 0
    assert flowing.plastic_fraction >= PLASTIC
    counts = (elastic.linear_iterations, flowing.linear_iterations)
    return Row(subdomains, declared.num_dofs, *counts, flowing.plastic_fraction)


def draw(rows: Sequence[Row], n: int, path: Path) -> None:
    """Draw the counts. Not collective."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    numbers = [one.subdomains for one in rows]
    axes.plot(numbers, [one.elastic for one in rows], "o-", label="elastic")
    axes.plot(numbers, [one.flowing for one in rows], "s-", label=f"{PLASTIC:.0%} plastic")
    axes.set(
        title=f"Total FETI: products with the dual operator in a level, H/h = {n}",
        xlabel="subdomains",
        xscale="log",
        ylim=(0, None),
    )
    axes.set_xticks(numbers, [str(number) for number in numbers])
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path)


# %% [markdown]
# ## Run it, and is it right?
#
# From 8 to 32 subdomains, the number of products at the elastic level may grow by a factor of 1.3.


# %%
def main(argv: Sequence[str] | None = None) -> None:
    """Count the products, print and draw them, and check them. Collective."""
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("-o", "--output", default="results/tfeti_scaling")
    parser.add_argument("-n", type=int, default=4, help="cells along the edge of a cube (4)")
    parser.add_argument("--coarse", action="store_true", help="n = 2, up to 8 subdomains")
    arguments = parser.parse_args(argv)
    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, arguments.output, force=True)
    folder.on_root(lambda: folder.path.mkdir(parents=True, exist_ok=True))
    n = 2 if arguments.coarse else arguments.n
    rows = []
    for subdomains in CUBES:
        if arguments.coarse and subdomains > 8:
            break
        rows.append(row(comm, subdomains, n))
        if comm.rank == 0:
            last = rows[-1]
            print(
                f"{last.subdomains:3d} subdomains, {last.unknowns:6d} unknowns: {last.elastic:5d}"
                f" products elastic, {last.flowing:5d} with {last.share:.0%} plastic",
                flush=True,
            )
    eight = next(one for one in rows if one.subdomains == 8)
    assert rows[-1].elastic <= GROWTH * eight.elastic
    picture = folder.file("tfeti_scaling.png")
    folder.on_root(lambda: draw(rows, n, picture))
    if comm.rank == 0:
        print(f"in {folder.path}")


if __name__ == "__main__":
    main()
