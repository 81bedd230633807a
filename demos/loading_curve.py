# %% [markdown]
# # How much does it carry, and how does it collapse?
#
# The load ζ on a perfectly plastic body over the work α that it has done: proportional at first,
# bending from first yield on, and level at the limit load, beyond which there is no equilibrium. A
# computation that prescribes ζ fails there without telling how near it was. One that prescribes α
# (ALG3: Čermák, Haslinger, Sysala, COMPLAS XII, 2013) goes on along the plateau, and its last
# increments show the mechanism of the collapse.
#
# Two problems whose limit loads are known exactly:
#
# - **Punch**, in contact: a square punch is pressed on a block of the same material. ζ is the
#   pressure on it. The punch itself gives way, in uniform compression, at its yield stress.
# - **Plate**, without contact: an L-shaped plate in plane strain, pulled at its upper end with
#   200 ζ. Its legs, half as wide as the loaded edge, flow in two triangles beside a rigid part that
#   turns: 2000 ζ = (2/√3) σ_y · 5.
#
# **Limits.** Small strains, no friction, one rising load. The lower bound is a load that was
# reached, and so holds for this mesh: the continuum may carry less. The upper bound is that of a
# velocity which keeps the volume of each element; it holds for both. Linear tetrahedra lock where a
# collapse bends. That these two problems come out exactly is due to their mechanisms, in which
# strains are constant in pieces.
#
#     ./fenicsx mpirun -n 2 python3 demos/loading_curve.py -o results/loading_curve

# %%
import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx import (
    Contact,
    Level,
    NewtonOptions,
    Pressure,
    Problem,
    State,
    Support,
    Traction,
    VonMises,
    l_plate,
    load_path,
    punch,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.limit_analysis import LimitLoad, limit_load
from perfplast_fenicsx.pictures import ResultReader, Surface
from perfplast_fenicsx.problem import Load, Prescribed
from perfplast_fenicsx.solvers import WorkNewton

TITLE = "Loading curves and collapse mechanisms"

# %% [markdown]
# ## The problems
#
# The punch is that of the package's other demos, a quarter of the whole; the plate is from the
# literature on limit analysis (lengths in mm, stresses in MPa).

# %%
PUNCH_LIMIT = 400 * math.sqrt(1.5)
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
PUNCH_LOADS, PUNCH_CONTACTS = [Pressure("top", 1.0)], [Contact("punch_bottom", "base_top")]
PLATE_LIMIT = 2 / math.sqrt(3) * 450.0 / 200.0 * 5 / 10
PLATE_LOADS = [Traction("top", (0, 200.0, 0))]


def punch_problem(comm: MPI.Intracomm, n: int) -> Problem:
    """A quarter of the punch and its base. Collective."""
    material = VonMises(young=2e5, poisson=0.3, yield_stress=PUNCH_LIMIT)
    return Problem(
        punch(comm, n),
        {"base": material, "punch": material},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
        PUNCH_LOADS,
        PUNCH_CONTACTS,
    )


def plate_problem(comm: MPI.Intracomm, n: int) -> Problem:
    """The plate, held in its plane by rollers. Collective."""
    supports = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z")]
    return Problem(l_plate(comm, n), {"plate": STEEL}, supports, PLATE_LOADS)


@dataclass(frozen=True)
class Example:
    """A problem, what is known of it, and how to look at it.

    Attributes:
        title: Heading.
        name: Of the folder with its results.
        loads, contacts: Of the problem, for the pictures.
        build: Makes the problem from a communicator and the fineness of the mesh.
        fine, coarse: Cubes per unit length.
        limit: The exact limit load.
        load: What ζ is.
        view: Direction from the body to the eye, and the upward one in the picture.
        pull: Direction of the load arrows.
        logarithmic: Whether α needs a logarithmic axis.
    """

    title: str
    name: str
    loads: Sequence[Load]
    contacts: Sequence[Contact]
    build: Callable[[MPI.Intracomm, int], Problem]
    fine: int
    coarse: int
    limit: float
    load: str
    view: tuple[tuple[float, float, float], tuple[float, float, float]]
    pull: tuple[float, float, float]
    logarithmic: bool


EXAMPLES = (
    Example(
        "Punch on a block (a quarter of it)",
        "punch",
        PUNCH_LOADS,
        PUNCH_CONTACTS,
        punch_problem,
        *(8, 4),
        PUNCH_LIMIT,
        "load factor ζ: pressure on the punch",
        ((-1.1, -1.9, 0.9), (0.0, 0.0, 1.0)),
        (0.0, 0.0, -1.0),
        logarithmic=False,
    ),
    Example(
        "L-shaped plate in plane strain",
        "plate",
        PLATE_LOADS,
        (),
        plate_problem,
        *(2, 1),
        PLATE_LIMIT,
        "load factor ζ: traction at the top / 200",
        ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
        (0.0, 1.0, 0.0),
        logarithmic=True,
    ),
)

# %% [markdown]
# ## Solve
#
# First the limit load, for which steps in α grow geometrically; then the bend of the curve, at as
# many works as make it smooth.

# %%
RTOL = 1e-4
POINTS = 24


@dataclass(frozen=True)
class Solved:
    """An example, solved.

    Attributes:
        first: The state at first yield.
        bend: Levels from zero to well on the plateau.
        limit: Limit load, bounds, mechanism.
        folder: The mechanism on file.
    """

    example: Example
    first: State
    bend: list[Level]
    limit: LimitLoad
    folder: Path


def solve(example: Example, problem: Problem, folder: ResultFolder) -> Solved:
    """Find the limit load, which is written, then the curve. Collective."""
    limit = limit_load(problem, RTOL, method="path")
    scene = Scene(example.title, example.loads, example.contacts)
    writer = ResultWriter(folder, problem, scene, WorkNewton.method, prescribed=Prescribed.WORK)
    for level in limit.levels:
        writer.write(level)
    writer.write_limit(limit)
    solver = WorkNewton(problem, NewtonOptions(tolerance=1e-8))
    first = solver.first_yield()
    nearly = next(lv.state.alpha for lv in limit.levels if lv.state.zeta > 0.995 * limit.lower)
    if example.logarithmic:
        growth = (20 * nearly / first.alpha) ** (1 / (POINTS - 1))
        works = [first.alpha / 4 * growth**i for i in range(POINTS)]
    else:
        works = [1.2 * nearly * i / POINTS for i in range(1, POINTS + 1)]
    bend = list(load_path(solver, works))
    return Solved(example, first, bend, limit, folder.path)


def mechanism(folder: Path) -> Surface:
    """The skin of the bodies with the velocity of collapse and its plastic work."""
    reader = ResultReader(folder)
    found = reader.mechanism(reader.surface(reader.levels[-1]))
    assert found is not None, f"there is no mechanism in {folder}"
    return found[0]


# %% [markdown]
# ## The picture
#
# Left the curve, right the mechanism: the bodies as they move at collapse (exaggerated; dashed:
# their outline before), in colours that tell the rate of plastic work.

# %%
BLUE, RED, GREY = "#3b6ea5", "#d62020", "#707070"
SHOWN = 0.12
"""The largest velocity is drawn so large, relative to the size of the bodies."""


def draw(solved: Sequence[Solved], path: Path) -> None:
    """Draw curve and mechanism of each example. Not collective."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.2 * len(solved)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(TITLE, fontsize=16, fontweight="bold")
    grid = figure.subplots(len(solved), 2, squeeze=False, width_ratios=(1.15, 1))
    for (left, right), case in zip(grid, solved, strict=True):
        draw_curve(left, case)
        draw_mechanism(right, case)
    figure.savefig(path)


def draw_curve(axes: Any, case: Solved) -> None:
    """ζ over α with elastic slope, first yield and plateau."""
    limit, first = case.limit, case.first
    alphas = np.array([level.state.alpha for level in case.bend])
    zetas = np.array([level.state.zeta for level in case.bend])
    plateau = limit.lower if limit.estimate is None else limit.estimate
    axis = "work of the loads α"
    begin, end, top = 0.0, 1.04 * alphas[-1], 1.25 * plateau
    if case.example.logarithmic:
        begin, end = 0.8 * alphas[0], 1.3 * alphas[-1]
        axis += " (logarithmic)"
        axes.set_xscale("log")
    else:
        alphas, zetas = np.append(0.0, alphas), np.append(0.0, zetas)
    axes.axhspan(plateau, top, color=RED, alpha=0.06, linewidth=0)
    axes.text(
        0.75, 1.17 * plateau, "no equilibrium", color=RED, ha="center", va="center", fontsize=12,
        transform=axes.get_yaxis_transform(),
    )  # fmt: skip
    reach = np.linspace(begin, 1.25 * plateau * first.alpha / first.zeta, 200)
    slope = first.zeta / first.alpha
    axes.plot(reach, slope * reach, "--", color=GREY, label="elastic slope")
    axes.plot(alphas, zetas, "o-", color=BLUE, markersize=4, label="solved levels (α given)")
    axes.plot(
        first.alpha, first.zeta, "D", color="#e0a020", markersize=10, markeredgecolor="black",
        label=f"first yield, ζ = {first.zeta:.4g}", zorder=5,
    )  # fmt: skip
    axes.axhline(plateau, color=RED, linewidth=1.5, label=f"limit load, estimate {plateau:.7g}")
    upper = "none found" if limit.upper is None else f"{limit.upper:.7g}"
    axes.plot([], [], " ", label=f"lower bound {limit.lower:.7g} (at α = {limit.alpha:.3g})")
    axes.plot([], [], " ", label=f"upper bound {upper}")
    axes.plot([], [], " ", label=f"exact {case.example.limit:.7g}")
    axes.set(xlim=(begin, end), ylim=(0, top), xlabel=axis, ylabel=case.example.load)
    axes.set_title(case.example.title, fontsize=13)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=10)


def draw_mechanism(axes: Any, case: Solved) -> None:
    """The bodies, moved with the velocity of collapse; farther triangles first."""
    from matplotlib.collections import LineCollection, PolyCollection

    surface, (towards, up) = mechanism(case.folder), case.example.view
    eye = np.array(towards) / np.linalg.norm(towards)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    plane = np.array([right, np.cross(eye, right)]).T

    velocity = surface.at_points["displacement"]
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    largest = float(np.linalg.norm(velocity, axis=1).max())
    moved = surface.points + SHOWN * size / largest * velocity
    corners = moved[surface.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    depth = (corners @ eye).mean(axis=1)
    rate = surface.at_cells["dissipation"] / surface.at_cells["dissipation"].max()
    names = range(len(surface.names))
    for body in sorted(names, key=lambda k: float(depth[surface.body == k].mean())):
        seen = np.flatnonzero(
            (normals @ eye > 1e-3) & (surface.body == body) & ~surface.marks["contact"]
        )
        seen = seen[np.argsort(depth[seen])]
        faces = PolyCollection(
            list(corners[seen] @ plane), array=rate[seen], cmap="YlOrRd", clim=(0, 1),
            edgecolor=(0, 0, 0, 0.3), linewidth=0.3, zorder=2,
        )  # fmt: skip
        axes.add_collection(faces)
        edges = sharp_edges(surface, surface.body == body, moved, eye)
        axes.add_collection(LineCollection(list(moved[edges] @ plane), colors="black", zorder=2))
    everywhere = np.ones(len(rate), dtype=bool)
    edges = sharp_edges(surface, everywhere, surface.points, eye)
    before = list(surface.points[edges] @ plane)
    axes.add_collection(LineCollection(before, colors=BLUE, linestyles="--", zorder=3))

    on = surface.triangles[surface.marks["load 0"]]
    centres = moved[on].mean(axis=1)
    pull = np.array(case.example.pull)
    length = 0.09 * size
    outward = float(np.sign(normals[surface.marks["load 0"]].mean(axis=0) @ pull))
    for centre in centres[:: max(1, len(centres) // 12)]:
        tail = centre if outward > 0 else centre - length * pull
        (x, y), (dx, dy) = tail @ plane, length * pull @ plane
        axes.annotate(
            "", (x + dx, y + dy), (x, y), arrowprops={"arrowstyle": "-|>", "color": "black"}
        )
    everything = np.concatenate([moved, surface.points, centres + outward * length * pull]) @ plane
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.03 * size
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("Collapse mechanism (exaggerated; dashed: before)", fontsize=13)
    axes.figure.colorbar(
        faces, ax=axes, shrink=0.7, label="rate of plastic work, relative to the largest"
    )


def sharp_edges(
    surface: Surface,
    chosen: npt.NDArray[np.bool_],
    points: npt.NDArray[np.float64],
    eye: npt.NDArray[np.float64],
) -> npt.NDArray[np.int64]:
    """Edges between chosen triangles that the eye may see, as pairs of points, shape (n, 2)."""
    triangles: Any = surface.triangles[chosen]
    corners = surface.points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    here = points[triangles]
    facing = np.cross(here[:, 1] - here[:, 0], here[:, 2] - here[:, 0]) @ eye > 0
    beside: dict[tuple[int, int], list[int]] = {}
    for t, (a, b, c) in enumerate(triangles.tolist()):
        for edge in ((a, b), (b, c), (c, a)):
            beside.setdefault((min(edge), max(edge)), []).append(t)
    found = [
        edge
        for edge, sides in beside.items()
        if len(sides) == 2 and normals[sides[0]] @ normals[sides[1]] < 0.8 and facing[sides].any()
    ]
    return np.array(found, dtype=np.int64)


# %% [markdown]
# ## Is it right?
#
# The bounds enclose the exact limit loads, and the curve is as the theory has it: proportional up
# to first yield, rising, below the limit.


# %%
def check(case: Solved) -> None:
    """Assert what is known."""
    limit, first, exact = case.limit, case.first, case.example.limit
    assert limit.levelled_off, limit.reason
    assert exact * (1 - RTOL) < limit.lower < exact * (1 + 1e-9), limit.lower
    assert limit.estimate is not None and math.isclose(limit.estimate, exact, rel_tol=RTOL)
    assert limit.upper is None or limit.upper > exact * (1 - 1e-9), limit.upper
    zetas = [level.state.zeta for level in case.bend]
    assert all(level.report.converged for level in case.bend)
    assert all(a < b for a, b in pairwise(zetas))
    assert zetas[-1] < exact
    for level in case.bend:
        elastic = level.state.alpha * first.zeta / first.alpha
        if level.report.plastic_cells == 0:
            assert math.isclose(level.state.zeta, elastic, rel_tol=1e-7)
        else:
            assert level.state.zeta < elastic * (1 + 1e-7)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve, draw, check. Collective."""
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("-o", "--output", default="results/loading_curve")
    parser.add_argument("--coarse", action="store_true", help="coarser meshes")
    arguments = parser.parse_args(argv)

    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, arguments.output, force=True)
    folder.on_root(lambda: folder.path.mkdir(parents=True, exist_ok=True))

    def say(text: str) -> None:
        if comm.rank == 0:
            print(text, flush=True)

    cases = []
    for example in EXAMPLES:
        problem = example.build(comm, example.coarse if arguments.coarse else example.fine)
        results = ResultFolder(comm, folder.file(example.name), force=True)
        results.create()
        case = solve(example, problem, results)
        cases.append(case)
        limit, first = case.limit, case.first
        say(f"{example.title}: {problem.num_dofs} dofs, {problem.num_pairs} contact pairs")
        say(f"  first yield at ζ = {first.zeta:.6g}, α = {first.alpha:.6g}")
        upper = "none found" if limit.upper is None else f"{limit.upper:.8g}"
        say(
            f"  limit load: lower bound {limit.lower:.8g}, estimate {limit.estimate:.8g}, upper"
            f" bound {upper}, exact {example.limit:.8g}\n"
            f"  after {len(limit.levels)} levels and {limit.linear_solves} linear solves, at"
            f" {limit.levels[-1].state.alpha / first.alpha:.3g} times the work of first yield:"
            f" {limit.reason}"
        )

    picture = folder.file("loading_curve.png")
    folder.on_root(lambda: draw(cases, picture))
    for case in cases:
        check(case)
    say(f"All checks passed. Look at {picture}.")


# %%
if __name__ == "__main__":
    main()
