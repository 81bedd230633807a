# %% [markdown]
# # Total FETI: iterations against subdomains
#
# Two steel blocks on each other, clamped at one end, the upper one pressed down with ζ. With
# `contact_solver = "tfeti"` they are cut into cubes, each of them the same small mesh, and contact
# and glue become forces between them. A coarse problem, the balance of all cubes, tells every cube
# of every other at once: so the number of products with the dual operator hardly depends on how many
# there are, as long as each has as many cells (H/h).
#
# In plastic flow it does depend: the tangent of a cube that flows has, besides its rigid motions,
# others that cost next to nothing, and the coarse problem knows nothing of them.
#
# **Limits.** Linear elements, and small cubes; products, not times.
#
#     ./fenicsx mpirun -n 2 python3 demos/tfeti_scaling.py -o results/tfeti_scaling

# %%
import argparse
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

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
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh

STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
CUBES = {2: (1, 1, 1), 4: (2, 1, 1), 8: (2, 2, 1), 16: (2, 2, 2), 32: (4, 2, 2)}
"""Of each of the two bodies, by the number of subdomains."""

ELASTIC, PLASTIC = 1.0, 0.3
"""ζ at which nothing yields, and the share of plastic cells of the other table."""


def blocks(comm: MPI.Intracomm, cubes: tuple[int, int, int], n: int) -> TaggedMesh:
    """Two bodies of unit cubes, each with n cells along its edge."""
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
    """ζ at which a share of the bodies has yielded."""
    newton = Newton(declared)
    level = newton.solve(ELASTIC)
    while level.report.plastic_fraction < PLASTIC:
        level = newton.solve(1.15 * level.state.zeta, level.state)
    return level.state.zeta


# %%
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Total FETI: iterations against subdomains")
    parser.add_argument("-n", type=int, default=4, help="cells along the edge of a cube (4)")
    parser.add_argument("--coarse", action="store_true", help="n = 2, up to 8 subdomains")
    parser.add_argument("-o", "--output", type=Path, help="folder for the table")
    given = parser.parse_args(arguments)
    comm = MPI.COMM_WORLD
    n = 2 if given.coarse else given.n
    rows = []
    for subdomains in CUBES:
        if given.coarse and subdomains > 8:
            break
        declared = problem(comm, subdomains, n)
        elastic = solved(declared, subdomains, ELASTIC)
        flowing = solved(declared, subdomains, plastic_load(declared))
        assert elastic.report.plastic_fraction == 0 < flowing.report.plastic_fraction
        counts = [
            level.report.linear_iterations / level.report.newton_iterations
            for level in (elastic, flowing)
        ]
        share = flowing.report.plastic_fraction
        rows.append((subdomains, declared.num_dofs, *counts, share))
        if comm.rank == 0:
            print(
                f"{subdomains:3d} subdomains, {declared.num_dofs:6d} unknowns: {counts[0]:6.1f}"
                f" products a step, elastic; {counts[1]:6.1f} with {share:.0%} plastic"
            )
    last, eight = rows[-1], next(row for row in rows if row[0] == 8)
    assert last[2] <= 1.3 * eight[2]
    if given.output and comm.rank == 0:
        given.output.mkdir(parents=True, exist_ok=True)
        lines = ["| subdomains | unknowns | elastic | plastic | share |", "|---|---|---|---|---|"]
        lines += [f"| {a} | {b} | {c:.1f} | {d:.1f} | {e:.2f} |" for a, b, c, d, e in rows]
        (given.output / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
