# %% [markdown]
# # Shakedown
#
# - A thick tube in plane strain under a cyclic pressure. The shakedown load is the smaller of two
#   values: twice the pressure at first yield (alternating plasticity), and the limit load p = 2k
#   ln(b/a).
# - A wall under a constant tension x and a cyclic temperature gradient y, both in units of σ_y.
#   Above x + y/4 = 1 the length of the wall increases in each cycle (ratchetting). Above y = 2 the
#   faces of the wall yield alternately in tension and compression (J. Bree, Journal of Strain
#   Analysis 2 (1967), 226). The model is half of a narrow sheet whose middle remains straight. The
#   end of the sheet is elastic, because the stresses at the end differ from those in a long wall.
# - A beam on two supports under a load of length c that moves along the beam. Shakedown is not
#   possible above the limit load with the load in the middle, P (L/4 − c/8) = σ_y h²/4. The beam is
#   slender, because the load spreads over the height of the beam.
# - A round plate with a hole under two independent cyclic tensions. The edge of the hole yields
#   alternately unless K p₁ − K' p₂ ≤ 2σ_y. K and K' follow from Airy's stress functions.
# - A square plate in plane stress with a hole whose diameter is a fifth of the width, a benchmark
#   by T. Belytschko, Int. J. Mech. Sci. 14 (1972), 619. K. Krabbenhøft, A. V. Lyamin, S. W. Sloan,
#   Int. J. Solids Struct. 44 (2007), 1533 found 0.595 for one tension, 0.499 with a second tension
#   of half this size, and 0.430 with a second tension of equal size (as quoted in later papers).
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/shakedown.py

# %%
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from mpi4py import MPI

import numpy as np

from demos.verification.study import Row, mesh, on_rank_0, run
from meshes.loaded_beam import LENGTH, PLACES, WIDTH, write_loaded_beam
from meshes.round_hole import write_round_hole
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Elastic,
    LoadDomain,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
    shakedown_load,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import Direction, Failure, shakedown_diagram
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.pictures import save_shakedown
from perfplast_fenicsx.problem import Temperature

TITLE = "Shakedown"
STEEL = VonMises(2e5, 0.3, 1.0)
PUBLISHED = {0.0: 0.595, 0.5: 0.499, 1.0: 0.430}
"""Published shakedown loads of the square plate over σ_y, by the ratio of the second to the first
tension."""
CLOSE, NEAR, ROUGHLY = 0.005, 0.01, 0.02


def of(case: str, quantity: str, problem: Problem, *numbers: float | int) -> Row:
    """Return a row for a mesh; ``numbers`` are computed, exact, allowed, solves, seconds."""
    computed, exact, allowed, solves, seconds = numbers
    about = (case, quantity, f"P{problem.degree}", 1.0, problem.num_dofs)
    return Row(*about, computed, exact, allowed, int(solves), seconds)


# %% [markdown]
# ## Cyclic loads


# %%
def alternating(problem: Problem, domain: LoadDomain, case: str, exact: float, by: float) -> Row:
    """Return a row for a shakedown load with its exact value. Collective."""
    began = time.perf_counter()
    found = shakedown_load(problem, domain)
    load = math.nan if found.load is None else found.load
    took = (found.linear_solves, time.perf_counter() - began)
    return of(case, f"load, {found.failure}", problem, load, exact, by, *took)


def tubes(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for three tubes in plane strain. Collective."""
    rows = []
    for ratio in (1.5, 2.0, 3.0):
        section = mesh(folder, write_thick_tube, outer=ratio, size=0.1 if coarse else 0.05)
        supports = [Support("x0", "x"), Support("y0", "y")]
        inside = [Pressure("inner", 1.0, name="p")]
        problem = Problem(section, {"tube": STEEL}, supports, inside, degree=2)
        share = 1 / (ratio**2 - 1)
        stress = np.array([-1.0, share * (1 + ratio**2), 0.0])
        stress[2] = STEEL.poisson * stress.sum()
        yields = 1 / math.sqrt(1.5 * float(((stress - stress.mean()) ** 2).sum()))
        exact = min(2 * yields, 2 * math.log(ratio) / math.sqrt(3))
        domain = LoadDomain.of_ranges({"p": (0.0, 1.0)})
        rows.append(alternating(problem, domain, f"tube, b/a = {ratio:g}", exact, CLOSE))
    return rows


def beam(folder: ResultFolder, coarse: bool) -> Row:
    """Return a row for a beam with a moving load. Collective."""
    sheet = mesh(folder, write_loaded_beam, size=0.5 if coarse else 0.25).thin()
    names = [f"at{i}" for i in range(len(PLACES))]
    problem = Problem(
        sheet,
        {"beam": STEEL},
        [Support("left", "y"), Support("right", "y")],
        [Traction(on, (0.0, -1 / WIDTH), name=on) for on in names],
        degree=2,
    )
    domain = LoadDomain.of_corners([{}, *({on: 1.0} for on in names)])
    exact = 0.25 / (LENGTH / 4 - WIDTH / 8)
    return alternating(problem, domain, "load that moves on a beam", exact, ROUGHLY)


# %% [markdown]
# ## Bree's wall


# %%
def wall(comm: MPI.Intracomm) -> tuple[Problem, LoadDomain]:
    """Return the problem of half of the wall, and the domain of the varying loads. Collective."""
    narrow = 0.01
    bodies = ("bar", "end")
    bars = structured_mesh(
        comm,
        [
            Box("bar", (0.0, 0.0, 0.0), (2.0, 1.0, narrow), (8, 8, 1)),
            Box("end", (2.0, 0.0, 0.0), (4.5, 1.0, narrow), (10, 8, 1)),
        ],
        [
            Surface("x0", ("bar",), lambda x: x[0] == 0),
            Surface("x1", ("end",), lambda x: x[0] == 4.5),
            Surface("y0", bodies, lambda x: x[1] == 0),
            Surface("z0", bodies, lambda x: x[2] == 0),
            Surface("bar_end", ("bar",), lambda x: x[0] == 2),
            Surface("end_bar", ("end",), lambda x: x[0] == 2),
        ],
    )
    flows = VonMises(2e5, 0.3, 1.0, expansion=5e-6)
    problem = Problem(
        bars,
        {"bar": flows, "end": Elastic(2e5, 0.3, expansion=5e-6)},
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")],
        [Traction("x1", (1.0, 0.0, 0.0), name="pull")],
        degree=2,
        contacts=[Tie("bar_end", "end_bar")],
        initial=[Temperature(body, "2*y - 1", name="heat") for body in bodies],
    )
    return problem, LoadDomain.of_corners([{"pull": 1.0}, {"pull": 1.0, "heat": 1.0}])


def pair(row: Direction) -> tuple[float, float]:
    """Return the two load factors found in a direction; nan if no load was found."""
    if row.first is None or row.second is None:
        return math.nan, math.nan
    return row.first, row.second


def bree(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for Bree's diagram. Collective."""
    problem, domain = wall(comm)
    rows = []
    began = time.perf_counter()
    found = shakedown_diagram(problem, domain, directions=3 if coarse else 9)
    each = (time.perf_counter() - began) / len(found)
    for row in found:
        x, y = pair(row)
        fails = Failure.ALTERNATING if y / 2 > x + y / 4 else Failure.COLLAPSE
        quantity = f"max(x + y/4, y/2), {row.angle:g}°"
        value = max(x + y / 4, y / 2) if row.failure == fails else math.nan
        rows.append(of("Bree's wall", quantity, problem, value, 1.0, CLOSE, 0, each))
    told = [asdict(row) for row in found]
    path = folder.file("bree.png")
    on_rank_0(comm, lambda: save_shakedown(told, ("pull", "heat"), "Bree's wall", path))
    return rows


# %% [markdown]
# ## Plates with a hole


# %%
def hoop(radius: float) -> tuple[float, float]:
    """Return the extreme hoop stresses at a hole of radius 1 in a round plate under unit tension.

    The solution is the sum of Airy's functions (A r² + B r⁴ + C/r² + D) cos 2θ and of Lamé's
    solution. For an infinite plate the stresses are 3 and −1 (G. Kirsch 1898).
    """
    b = radius**2
    rows = [
        [2, 0, 6, 4],
        [2, 6, -6, -2],
        [2, 0, 6 / b**2, 4 / b],
        [2, 6 * b, -6 / b**2, -2 / b],
    ]
    far, quartic, near, _ = np.linalg.solve(np.array(rows), np.array([0.0, 0.0, -0.5, -0.5]))
    mean, part = b / (b - 1), 2 * far + 12 * quartic + 6 * near
    return float(mean - part), float(mean + part)


def round_plate(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for a round plate under two tensions. Collective."""
    radius = 5.0
    sheet = mesh(folder, write_thick_tube, outer=radius, size=0.15 if coarse else 0.1).thin()
    problem = Problem(
        sheet,
        {"tube": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [
            Traction("outer", (f"x/{radius}", "0*x"), name="one"),
            Traction("outer", ("0*x", f"y/{radius}"), name="other"),
        ],
        degree=2,
    )
    most, least = hoop(radius)
    rows = []
    began = time.perf_counter()
    domain = LoadDomain.of_ranges({"one": (0.0, 1.0), "other": (0.0, 1.0)})
    found = shakedown_diagram(problem, domain, directions=3 if coarse else 7)
    each = (time.perf_counter() - began) / len(found)
    for row in found:
        large, small = max(pair(row)), min(pair(row))
        range_of_stress = most * large - least * small
        value = range_of_stress if row.failure == Failure.ALTERNATING else math.nan
        quantity = f"range of stress, {row.angle:.0f}°"
        rows.append(of("round plate, hole", quantity, problem, value, 2.0, NEAR, 0, each))
    return rows


def square_plate(folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for a square plate under one and two tensions. Collective."""
    sheet = mesh(folder, write_round_hole, size=0.1 if coarse else 0.05).thin()
    rows = []
    for ratio, known in PUBLISHED.items():
        loads = {"side": (1.0, 0.0)} | ({"top": (0.0, ratio)} if ratio else {})
        problem = Problem(
            sheet,
            {"plate": STEEL},
            [Support("x0", "x"), Support("y0", "y")],
            [Traction(on, pulls, name=on) for on, pulls in loads.items()],
            degree=2,
        )
        ranges: Mapping[str, tuple[float, float]] = dict.fromkeys(loads, (0.0, 1.0))
        case = f"square plate, p₂ = {ratio:g} p₁"
        rows.append(alternating(problem, LoadDomain.of_ranges(ranges), case, known, NEAR))
    return rows


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return the rows of all cases. Collective."""
    rows = [*tubes(folder, coarse), beam(folder, coarse), *bree(comm, folder, coarse)]
    return [*rows, *round_plate(folder, coarse), *square_plate(folder, coarse)]


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
