"""Pictures of a run: ``fields.png``, the deformed bodies, and ``path.png``, ζ over α."""

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.graphics import images
from perfplast_fenicsx.limit_load import LimitLoad
from perfplast_fenicsx.loads import Load, Pressure, Traction
from perfplast_fenicsx.materials import strain
from perfplast_fenicsx.obstacles import Obstacle
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.scenery import best_view, load_arrows, sample_obstacles
from perfplast_fenicsx.spaces import by_cell
from perfplast_fenicsx.state import LevelReport
from perfplast_fenicsx.surface import Surface, gather_surface

log = logging.getLogger(__name__)

SHOWN_DEFORMATION, SHOWN_MECHANISM = 0.1, 0.04
"""The largest displacement is drawn about so large, relative to the size of the assembly."""


def draw_fields(
    assembly: Assembly,
    fields: Mapping[str, fem.Function],
    report: LevelReport,
    title: str,
    loads: Sequence[Load],
    contacts: Sequence[Contact],
    path: Path,
    caption: str | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> bool:
    """Draw the deformed bodies with plastic zone, displacement and contact pressure. Collective.

    Of a mechanism the dissipation is shown instead of the displacement.

    Without a graphics system a warning is logged on rank 0, and nothing is drawn.

    Args:
        assembly: Mesh with names.
        fields: ``displacement``, ``yield_ratio`` and ``contact_pressure`` of the level, and for a
            mechanism its ``dissipation`` (:func:`dissipation`).
        report: The level.
        title: Heading of the picture.
        loads: Shown as arrows where they act on surfaces.
        contacts: Shown with the contact pressure.
        path: The png file.
        caption: Second line of the heading; by default load factor and work.
        obstacles: Shown where they are near, and with the contact pressure.

    Returns:
        Whether there is a picture, on every rank alike.
    """
    gdim, comm = assembly.mesh.geometry.dim, assembly.mesh.comm
    for obstacle in obstacles:
        obstacle.towards(np.zeros((0, gdim)))  # one that does not fit raises on every rank
    nodal = {name: fields[name] for name in ("displacement", "contact_pressure")}
    cellwise = {name: fields[name] for name in ("yield_ratio", "dissipation") if name in fields}
    largest = float(cellwise["dissipation"].x.array.max(initial=0)) if len(cellwise) > 1 else 0.0
    largest = comm.allreduce(largest, MPI.MAX)
    on_surfaces = [load for load in loads if isinstance(load, Traction | Pressure)]
    marks = {f"load {i}": [load.on] for i, load in enumerate(on_surfaces)}
    marks["contact"] = [contact.secondary for contact in contacts]
    marks["contact"] += [obstacle.on for obstacle in obstacles]
    surface = gather_surface(assembly, nodal, cellwise, marks)
    drawn = False
    if surface is not None:
        scale = deformation_scale(
            surface, SHOWN_MECHANISM if "dissipation" in cellwise else SHOWN_DEFORMATION
        )
        enlarged = "to scale" if scale == 1 else f"drawn {scale:g} times as large"
        level = f"load factor ζ = {report.zeta:.6g},   work of the loads α = {report.alpha:.5g}"
        words = (title, f"{caption or level},   deformation {enlarged}")
        points = surface.points + scale * surface.at_points["displacement"]
        try:
            drawn = _draw(surface, points, largest, on_surfaces, obstacles, words, path)
        except Exception as error:  # the other ranks wait, and a picture is no reason to stop
            log.warning("%s was not drawn (%s).", path.name, error)
    return bool(comm.bcast(drawn))


def dissipation(problem: Problem, v: fem.Function) -> fem.Function:
    """γ‖dev ε(v)‖, the mean of each cell: the plastic work of a velocity; 0 in elastic bodies.

    Args:
        problem: The bodies.
        v: The velocity, its ghosts up to date.
    """
    rate = problem.moduli.dissipation(strain(v))
    at_points = fem.Function(problem.Q)
    at_points.interpolate(fem.Expression(rate, interpolation_points(problem.Q.element)))
    cells = fem.functionspace(problem.assembly.mesh, ("DG", 0))
    mean = fem.Function(cells, name="dissipation")
    mean.x.array[:] = by_cell(at_points).mean(axis=1)
    return mean


def deformation_scale(surface: Surface, shown: float = SHOWN_DEFORMATION) -> float:
    """A round number (1, 2 or 5 times a power of ten) that makes the deformation visible."""
    largest = float(np.linalg.norm(surface.at_points["displacement"], axis=1).max(initial=0))
    wanted = shown * surface.size / largest if largest > 0 else 1.0
    if not (math.isfinite(wanted) and wanted > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= wanted * (1 + 1e-9)))


def draw_path(
    reports: Sequence[LevelReport], title: str, path: Path, limit: LimitLoad | None = None
) -> None:
    """Draw the load factor ζ over the work α of the converged levels. Not collective.

    Without matplotlib a warning is logged, and nothing is drawn.

    Args:
        reports: Of all levels; a last one that failed is drawn as the load without a solution.
        title: Heading.
        path: The png file.
        limit: Limit load, to be marked with its bounds.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        log.warning("%s was not drawn: matplotlib is not installed.", path.name)
        return
    solved = [report for report in reports if report.converged]
    figure = Figure(figsize=(7, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    alphas = [0.0, *(report.alpha for report in solved)]
    zetas = [0.0, *(report.zeta for report in solved)]
    axes.plot(alphas, zetas, "o-", color="#3b6ea5", markersize=5, label="solved load levels")
    if solved and solved[0].plastic_cells == 0 and solved[0].zeta > 0:
        slope = solved[0].alpha / solved[0].zeta
        top = max(zetas) * 1.05
        straight = np.linspace(0, top, 200)  # curved where the axis is logarithmic
        axes.plot(slope * straight, straight, ":", color="#707070", label="elastic")
    for report in reports:
        if not report.converged:
            label = f"no solution found at ζ = {report.zeta:.6g}"
            axes.axhline(report.zeta, color="#d62020", linestyle="--", label=label)
    if limit is not None and limit.estimate is not None:
        label = f"limit load, estimated {limit.estimate:.6g}"
        axes.axhline(limit.estimate, color="#d62020", linewidth=1, label=label)
        if limit.upper is not None:
            label = f"bounds {limit.lower:.6g} to {limit.upper:.6g}"
            axes.axhspan(limit.lower, limit.upper, color="#d62020", alpha=0.15, label=label)
        axes.set_xscale("symlog", linthresh=solved[0].alpha)
    axes.set(xlabel="work of the loads α", ylabel="load factor ζ")
    axes.set_title(title, parse_math=False)
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path)


def _draw(
    surface: Surface,
    points: npt.NDArray[np.float64],
    largest_dissipation: float,
    loads: Sequence[Traction | Pressure],
    obstacles: Sequence[Obstacle],
    words: tuple[str, str],
    path: Path,
) -> bool:
    """Draw a surface, its points moved, under two lines of words. Not collective."""
    from perfplast_fenicsx.panels import compose, hue, panels

    shown = panels(surface, largest_dissipation)
    arrows = load_arrows(surface, points, loads)
    near = sample_obstacles(surface, points, obstacles)
    arrays = {
        "undeformed": surface.points,
        "points": points,
        "triangles": surface.triangles,
        "facets": surface.facets,
        "body": surface.body,
        "arrow_starts": arrows.starts,
        "arrows": arrows.vectors,
        **{f"colours {i}": panel.colours for i, panel in enumerate(shown)},
        **{f"facets {i}": p.facets for i, p in enumerate(shown) if p.facets is not None},
        **{f"obstacle {i}": distance for i, distance in enumerate(near.distances)},
    }
    about = {
        "hues": [hue(body) for body in range(len(surface.names))],
        "view": best_view(surface),
        "loads": [panel.loads for panel in shown],
        "corner": near.corner.tolist(),
        "spacing": near.spacing.tolist(),
        "num_obstacles": len(obstacles),
    }
    drawn = images(arrays, about, path.name)
    if drawn is None:
        return False
    compose(shown, drawn, *words, path)
    return True
