"""Pictures that a run makes: ``fields.png``, the deformed bodies, and ``path.png``, ζ over α.

Where nothing can be drawn, a warning says why, and the run goes on.
"""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.curve import Bounds, save_curve
from perfplast_fenicsx.graphics import DrawingError
from perfplast_fenicsx.loads import Load
from perfplast_fenicsx.materials import strain
from perfplast_fenicsx.model import Model, Units
from perfplast_fenicsx.obstacles import Obstacle
from perfplast_fenicsx.pictures import draw_surface
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.spaces import by_cell
from perfplast_fenicsx.state import LevelReport
from perfplast_fenicsx.surface import gather_surface

log = logging.getLogger(__name__)

NODAL, CELLWISE = ("displacement", "contact_pressure"), ("yield_ratio", "dissipation")


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
    units: Units = Units(),  # noqa: B008 (frozen)
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
        units: For the legends.

    Returns:
        Whether there is a picture, on every rank alike.
    """
    gdim, comm = assembly.mesh.geometry.dim, assembly.mesh.comm
    for obstacle in obstacles:
        obstacle.towards(np.zeros((0, gdim)))  # one that does not fit raises on every rank
    largest = None
    if "dissipation" in fields:
        own = float(fields["dissipation"].x.array.max(initial=0))
        largest = comm.allreduce(own, MPI.MAX)
    model = Model(title, loads, contacts, obstacles, units)
    nodal = {name: fields[name] for name in NODAL}
    cellwise = {name: fields[name] for name in CELLWISE if name in fields}
    surface = gather_surface(assembly, nodal, cellwise, model.marks)
    drawn = False
    if surface is not None:
        caption = caption or level_caption(report.zeta, report.alpha, units.of_work(gdim))
        try:
            draw_surface(surface, model, caption, path, largest)
            drawn = True
        except Exception as error:  # the other ranks wait, and a picture is no reason to stop
            log.warning("%s was not drawn: %s", path.name, error)
    return bool(comm.bcast(drawn))


def level_caption(zeta: float, alpha: float, unit: str) -> str:
    """A level in words."""
    return f"load factor ζ = {zeta:.6g},   work of the loads α = {alpha:.5g} {unit}".rstrip()


def mechanism_caption(zeta: float) -> str:
    """A collapse mechanism in words."""
    return f"collapse mechanism at ζ = {zeta:.6g}, velocity of unit work"


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


def draw_path(
    reports: Sequence[LevelReport],
    title: str,
    path: Path,
    limit: Bounds | None = None,
    unit: str = "",
) -> None:
    """Draw the load factor ζ over the work α of the converged levels. Not collective.

    Without matplotlib a warning is logged, and nothing is drawn.

    Args:
        reports: Of all levels; a last one that failed is drawn as the load without a solution.
        title: Heading.
        path: The png file.
        limit: Limit load, to be marked with its bounds.
        unit: Of the work.
    """
    try:
        save_curve(reports, title, path, limit, unit)
    except DrawingError as error:
        log.warning("%s was not drawn: %s", path.name, error)
