# %% [markdown]
# # Bounds for ground in plane strain
#
# The demo computes strict bounds for associated Mohr–Coulomb ground in plane strain, on adapted
# meshes.
#
# - Weightless ground with cohesion 1 carries the pressure N_c under a smooth strip footing.
#   Weightless ground without cohesion carries N_q, with a surcharge of 1 next to the footing. Here
#   N_q = e^(π tan φ) N with N = tan²(45° + φ/2), and N_c = (N_q − 1) cot φ (L. Prandtl 1920, H.
#   Reissner 1924).
# - Ground without cohesion, with unit weight 1 and φ = 30°, carries N_γ = 7.6532 under a smooth
#   stiff footing of half-width 1, and 14.7543 under a rough footing (C. M. Martin 2005, by the
#   method of characteristics).
# - Log spirals through the toe give values of γH/c at which a vertical cut and a slope of 60°
#   collapse. Log spirals are mechanisms, so the proven lower bound must not exceed these values.
# - A vertical cut in ground without tensile strength is stable up to γH/c = 2 tan(45° + φ/2) (D. C.
#   Drucker, W. Prager 1952). With a small tensile strength it is stable up to a larger value.
#
#     ./fenicsx python3 demos/verification/ground_bounds.py

# %%
import math
import time
from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.slope import write_slope
from meshes.strip_footing import write_strip_footing
from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Contact,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Tie,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import AdaptiveBounds

TITLE = "Ground from both sides"
FOOTING = {"width": 12.0, "depth": 8.0, "size": 3.0, "grading": 1.0}
"""A coarse uniform mesh; the first fans have the size of its cells."""
CELLS, FEW = 4000, 300
SUPPORTS = [Support("x0", "x"), Support("side", "x"), Support("bottom")]


def surcharge_factor(degrees: float) -> float:
    """Return N_q for a friction angle (degrees)."""
    phi = math.radians(degrees)
    return math.exp(math.pi * math.tan(phi)) * math.tan(math.pi / 4 + phi / 2) ** 2


def cohesion_factor(degrees: float) -> float:
    """Return N_c for a friction angle (degrees)."""
    return (surcharge_factor(degrees) - 1) / math.tan(math.radians(degrees))


# %%
def footing(
    ground: TaggedMesh, degrees: float, cohesion: float, cells: int, until: float
) -> AdaptiveBounds:
    """Return bounds for a smooth footing on weightless ground; surcharge 1 if c = 0. Collective."""
    loads = [Pressure("footing", 1.0)]
    if not cohesion:
        loads.append(Pressure("free", 1.0, constant=True))
    problem = Problem(
        ground, {"ground": MohrCoulomb(1e4, 0.3, cohesion, degrees)}, SUPPORTS, loads, degree=2
    )
    return adaptive_bounds(problem, Adaptation(until, cells))


def on_sand(ground: TaggedMesh, rough: bool, cells: int, until: float) -> AdaptiveBounds:
    """Return bounds for a stiff footing on ground with φ = 30°, weight 1 and c = 0. Collective."""
    touches = ("ground_footing", "punch_footing")
    problem = Problem(
        ground,
        {"ground": MohrCoulomb(1e4, 0.3, 0.0, 30.0), "punch": Elastic(1e6, 0.3)},
        SUPPORTS,
        [Pressure("top", 1.0), BodyForce("ground", (0.0, -1.0), constant=True)],
        [Tie(*touches) if rough else Contact(*touches)],
        degree=2,
    )
    return adaptive_bounds(problem, Adaptation(until, cells))


def falling(
    ground: TaggedMesh, supports: list[Support], degrees: float, cells: int, tension: float | None
) -> AdaptiveBounds:
    """Return bounds on the unit weight for ground of cohesion 1 and height 1. Collective."""
    material = MohrCoulomb(1e4, 0.3, 1.0, degrees, tensile_strength=tension)
    name = next(iter(ground.volumes))
    loads = [BodyForce(name, (0.0, -1.0))]
    problem = Problem(ground, {name: material}, supports, loads, degree=2)
    return adaptive_bounds(problem, Adaptation(1e-3, cells))


def draw_factors(folder: ResultFolder, found: dict[str, dict[float, tuple[float, float]]]) -> None:
    """Draw the curves of N_c and N_q, and the brackets. Not collective."""
    figure = Figure(figsize=(6, 4.5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    angles = np.linspace(1.0, 35.0, 100)
    for name, factor in (("N_c", cohesion_factor), ("N_q", surcharge_factor)):
        (line,) = axes.semilogy(angles, [factor(it) for it in angles], label=f"${name}$, exact")
        for angle, (low, high) in found[name].items():
            axes.plot([angle, angle], [low, high], "_-", color=line.get_color(), markersize=10)
    axes.set(xlabel="angle of friction (degrees)", ylabel="bearing capacity factor")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(folder.file("factors.png"))


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return brackets with the exact or published values. Collective."""
    rows: list[Row] = []
    cells = FEW if coarse else CELLS
    brackets: dict[str, dict[float, tuple[float, float]]] = {"N_c": {}, "N_q": {}}
    widths = {"N_c": {10.0: 1.0, 20.0: 1.5, 30.0: 2.0}, "N_q": {20.0: 3.0, 30.0: 3.0}}
    for name, asked in widths.items():
        factor, cohesion = {"N_c": (cohesion_factor, 1.0), "N_q": (surcharge_factor, 0.0)}[name]
        for degrees, percent in asked.items():
            if coarse and degrees != 20.0:
                continue
            began = time.perf_counter()
            ground = mesh(folder, write_strip_footing, **FOOTING)
            found = footing(ground, degrees, cohesion, cells, percent / 100)
            low, high = ends(found)
            brackets[name][degrees] = low, high
            exact = factor(degrees)
            told = [("below, exact", low, exact), ("exact, above", exact, high)]
            told += [] if coarse else [("gap in %", 100 * (high / low - 1), percent)]
            rows += at_most(f"{name}, φ {degrees:g}°", found, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "footing"), "Smooth strip footing", found)
    sands = {
        "smooth": (7.6532, 3.0, {"width": 4.0, "depth": 2.0, "size": 1.0}),
        "rough": (14.7543, 6.0, {"width": 5.0, "depth": 2.5, "size": 1.5}),
    }
    for name, (exact, percent, shape) in sands.items() if not coarse else ():
        began = time.perf_counter()
        ground = mesh(folder, write_strip_footing, punch=True, grading=1.0, **shape)
        found = on_sand(ground, name == "rough", cells, percent / 100)
        low, high = ends(found)
        told = [("below, exact", low, exact), ("exact, above", exact, high)]
        told += [("gap in %", 100 * (high / low - 1), percent)]
        rows += at_most(f"N_γ, φ 30°, {name}", found, time.perf_counter() - began, told)
    if comm.rank == 0:
        draw_factors(folder, brackets)
    cut, steep = {"size": 0.5}, {"run": math.tan(math.radians(30.0)), "depth": 0.5, "size": 0.3}
    sides = [Support("bottom"), Support("sides", "x")]
    around = [Support("bottom"), Support("left", "x"), Support("right", "x")]
    spirals = {10.0: 4.5828, 20.0: 5.5049, 30.0: 6.6870}
    for degrees, most in spirals.items():
        if coarse and degrees != 20.0:
            continue
        began = time.perf_counter()
        found = falling(mesh(folder, write_vertical_cut, **cut), sides, degrees, cells, None)
        low, high = ends(found)
        told = [("below, log spiral", low, most)]
        told += [] if coarse else [("gap in %", 100 * (high / low - 1), 0.5)]
        rows += at_most(f"cut, φ {degrees:g}°", found, time.perf_counter() - began, told)
    if coarse:
        return rows
    began = time.perf_counter()
    found = falling(mesh(folder, write_slope, **steep), around, 20.0, cells, None)
    told = [("below, log spiral", ends(found)[0], 10.3909)]
    rows += at_most("slope of 60°, φ 20°", found, time.perf_counter() - began, told)
    began = time.perf_counter()
    few = 1000  # with a tensile strength, each cell takes more time
    found = falling(mesh(folder, write_vertical_cut, **cut), sides, 20.0, few, 1e-3)
    exact = 2 * math.tan(math.radians(55.0))
    told = [("without tension, above", exact, ends(found)[1])]
    rows += at_most("cut, φ 20°, f = c/1000", found, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "cut"), "Vertical cut that bears little tension", found)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
