# %% [markdown]
# # A rough rigid footing under inclined and eccentric loads
#
# The footing is a rough plate: a surface of the ground that moves as a rigid body. Under a central
# load V, the exact limit is Prandtl's pressure (2 + π) k on the width 2, as for the strip footing;
# the computed values are larger. With a horizontal load H, a footing of width B carries
#
#     V = kB (1 + π − arcsin(H/kB) + √(1 − (H/kB)²))
#
# (A. P. Green, The plastic yielding of metal junctions due to combined shear and pressure, J. Mech.
# Phys. Solids 2, 1954). Each finer mesh almost halves the error of the values. With a moment M, the
# central limit load is an upper bound on V. The signs of H and M have no effect, because the mesh
# is symmetric. The table has a row for each sign, and compares the second row with the first row.
# Each value is accurate to the tolerance of the search; if both searches take the same number of
# steps, the two values agree apart from rounding.
#
# Strict bounds on adapted meshes of 4 000 cells bracket the limit load of the body. The model is
# half of the footing under the central load, and the whole footing under inclined and eccentric
# loads. Known values must lie between the bounds. Two polygons enclose the boundary of the pairs of
# V and H that the ground carries. After at most twelve directions the polygons are at most 1 %
# apart along any ray, and Green's curve lies between them. The same holds for pairs of V and M, for
# which no exact curve is known. Reflection changes the signs of H and M, and the limit loads do not
# change if all signs change. So positive pairs represent all pairs.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/rigid_footing.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Collapse, Row, mesh, run
from meshes.footing import write_footing
from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    Adaptation,
    Force,
    Problem,
    RigidSurface,
    Support,
    VonMises,
    adaptive_bounds,
    envelope,
    limit_load,
)
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.limit_analysis import Envelope
from perfplast_fenicsx.pictures import draw

TITLE = "Rough rigid footing, plane strain"
SOIL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
SHEAR = SOIL.yield_stress / math.sqrt(3)
SUPPORTS = [Support("bottom"), Support("sides", "x")]
LOADS = {
    "central": (0.0, 0.0),
    "inclined": (0.3, 0.0),
    "eccentric": (0.0, 0.3),
    "both": (0.2, 0.2),
}
"""H and M of loads with V = 1."""
PRANDTL = (2 + math.pi) * SHEAR
ALLOWED = {"central": (0.2, 0.015), "half": (0.1, 0.015), "inclined": (0.1, 0.025)}
"""Largest relative error against known values, and the edge length for which this limit holds."""
BOUNDED, TOLERANCE = 0.015, 1e-4

WIDTHS, QUICK = {"central": 0.006, "inclined": 0.015, "eccentric": 0.015}, 0.2
"""Widths of strict brackets by load, and the width for a quick run."""
CELLS = 4000
APART, FOR_POLYGONS = 0.01, Adaptation(until=0.004, cells=25000)
"""Largest distance of the polygons for V and H, and the adaptation of the mesh in each
direction."""
UNIT = 5 * SHEAR
"""Unit of V/B. It is close to the limit load, so the directions are evenly spaced."""


def green(lean: float) -> float:
    """Return Green's V/B under a load with H = ``lean`` V, by bisection."""
    low, high = 0.0, min(2 + math.pi, 1 / lean)
    while high - low > 1e-12:
        middle = (low + high) / 2
        h = lean * middle
        carries = middle < 1 + math.pi - math.asin(h) + math.sqrt(1 - h**2)
        low, high = (middle, high) if carries else (low, middle)
    return low * SHEAR


# %%
def half(folder: ResultFolder, size: float) -> Row:
    """Return a row for the central load, from half of the footing. Collective."""
    began = time.perf_counter()
    problem = Problem(
        mesh(folder, write_strip_footing, size=size, punch=False),
        {"ground": SOIL},
        [
            Support("x0", "x"),
            Support("side", "x"),
            Support("bottom"),
            RigidSurface("footing", held="x"),
        ],
        [Force("footing", (0.0, -1.0))],
        degree=2,
    )
    limit = limit_load(problem, TOLERANCE)
    finest, allowed = ALLOWED["half"]
    return Row(
        case="footing, central, half",
        quantity="limit load",
        element="P2",
        size=size,
        dofs=problem.num_dofs,
        computed=limit.estimate or math.nan,
        exact=PRANDTL,
        allowed=allowed if size <= finest else None,
        solves=limit.linear_solves,
        seconds=time.perf_counter() - began,
        factorisations=limit.factorisations,
    )


# %%
def bracket(folder: ResultFolder, case: str, coarse: bool) -> list[Row]:
    """Return rows for strict bounds for the bodies, compared with the known values. Collective."""
    began = time.perf_counter()
    across, moment = LOADS[case]
    central = case == "central"
    if central:
        ground, held = mesh(folder, write_strip_footing, size=0.8, punch=False), "x"
        supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    else:
        ground, held, supports = mesh(folder, write_footing, size=0.8), "", SUPPORTS
    problem = Problem(
        ground,
        {"ground": SOIL},
        [*supports, RigidSurface("footing", held=held)],
        [Force("footing", (across, -1.0), moment)],
        degree=2,
    )
    gap = QUICK if coarse else WIDTHS[case]
    found = adaptive_bounds(problem, Adaptation(gap, CELLS))
    lower, upper = found.low.lower, found.high.upper
    assert lower.strict and upper.strict, f"{lower!r}, {upper!r}"
    assert lower.value is not None and upper.value is not None
    width = 1.0 if central else 2.0
    low, high = lower.value / width, upper.value / width

    def at_most(quantity: str, small: float, large: float) -> Row:
        return Row(
            case=f"footing, {case}, strict",
            quantity=quantity,
            element="P1 and P2",
            size=0.8,
            dofs=found.problem.num_dofs,
            computed=small,
            exact=large,
            allowed=0.0,
            solves=0,
            seconds=time.perf_counter() - began,
            bound=True,
            bracket=f"{low:.6g} ... {high:.6g}",
        )

    rows = [at_most("gap in %", 100 * (high / low - 1), 100 * gap)]
    if case in ALLOWED:
        known = green(across) if across else PRANDTL
        rows += [at_most("below", low, known), at_most("above", known, high)]
    return rows


def interaction(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for polygons around and inside Green's curve, and for V and M. Collective."""
    began = time.perf_counter()
    push, shove = Force("footing", (0.0, -2 * UNIT)), Force("footing", (2 * SHEAR, 0.0))
    turn = Force("footing", (), 6 * SHEAR)
    problem = Problem(
        mesh(folder, write_footing, size=0.8),
        {"ground": SOIL},
        [*SUPPORTS, RigidSurface("footing")],
        [push],
        degree=2,
    )
    adaptation = Adaptation(QUICK, CELLS) if coarse else FOR_POLYGONS
    most = 3 if coarse else 12
    found = envelope(problem, [[push], [shove]], most, APART, adaptation=adaptation)
    within, beyond = 0.0, 0.0
    for angle in range(91):
        v, h = math.cos(math.radians(angle)) * UNIT / SHEAR, math.sin(math.radians(angle))
        if angle == 0:
            known = (2 + math.pi) / v
        elif v <= (1 + math.pi / 2) * h:  # at H = kB the curve is a vertical line
            known = 1 / h
        else:
            known = green(h / v) / SHEAR / v
        within = max(within, found.inner(angle) / known)
        beyond = max(beyond, known / found.outer(angle))
    turned = envelope(problem, [[push], [turn]], most, APART, adaptation=adaptation)

    def at_most(
        quantity: str, small: float, large: float, wanted: bool = True, of: Envelope = found
    ) -> Row:
        return Row(
            case=f"footing, V and {'H' if of is found else 'M'}, strict",
            quantity=quantity,
            element="P1 and P2",
            size=0.8,
            dofs=of.last.problem.num_dofs,
            computed=small,
            exact=large,
            allowed=1e-9 if wanted else None,
            solves=0,
            seconds=time.perf_counter() - began,
            bound=True,
            bracket=f"{len(of.directions)} directions",
        )

    central = (2 + math.pi) * SHEAR / UNIT
    return [
        at_most("gap in %", 100 * found.gap, 100 * APART, wanted=not coarse),
        at_most("inner polygon/exact", within, 1.0),
        at_most("exact/outer polygon", beyond, 1.0),
        at_most("gap in %", 100 * turned.gap, 100 * APART, not coarse, turned),
        at_most("below, M = 0", turned.inner(0.0), central, of=turned),
        at_most("above, M = 0", central, turned.outer(0.0), of=turned),
    ]


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for limit loads over the width, for central and other loads. Collective."""
    rows = [row for case in WIDTHS for row in bracket(folder, case, coarse)]
    rows += interaction(folder, coarse)
    for size in (0.8, 0.2) if coarse else (0.8, 0.4, 0.2, 0.1):
        if size < 0.8:
            rows.append(half(folder, size))
        ground = mesh(folder, write_footing, size=size)
        for case, (across, moment) in LOADS.items():
            found = None
            central, known = not (across or moment), case in ALLOWED
            exact = green(across) if across and known else PRANDTL
            if coarse and size < 0.8 and not central:
                continue
            for sign in (1,) if central else (1, -1):
                began = time.perf_counter()
                load = Force("footing", (sign * across, -1.0), sign * moment)
                problem = Problem(
                    ground,
                    {"ground": SOIL},
                    [*SUPPORTS, RigidSurface("footing")],
                    [load],
                    degree=2,
                )
                limit = limit_load(problem, TOLERANCE)
                seconds = time.perf_counter() - began
                mean = (limit.estimate or math.nan) / 2
                finest, allowed = ALLOWED.get(case, (size, BOUNDED))
                fine = size <= finest
                rows.append(
                    Row(
                        case=f"footing, {case}",
                        quantity=f"limit load, sign {sign:+d}",
                        element="P2",
                        size=size,
                        dofs=problem.num_dofs,
                        computed=mean,
                        exact=exact if found is None else found,
                        allowed=TOLERANCE if found is not None else allowed if fine else None,
                        solves=limit.linear_solves,
                        seconds=seconds,
                        bound=found is None and not known,
                        factorisations=limit.factorisations,
                    )
                )
                found = mean
            if not coarse or case == "both":
                pictures = subfolder(folder, case)
                Collapse(problem, limit, "", seconds).write(pictures, Scene(TITLE, [load]))
                draw(pictures)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
