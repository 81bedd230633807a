"""Pictures that a run makes: ``fields.png``, the deformed bodies, and ``path.png``, ζ over α.

Where nothing can be drawn, a warning says why, and the run goes on.
"""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.contact.contact import Contact
from perfplast_fenicsx.contact.obstacles import Obstacle
from perfplast_fenicsx.io.case.scene import Scene, Units
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.pictures.boundary_surface import gather_surface
from perfplast_fenicsx.pictures.field_figure import draw_surface
from perfplast_fenicsx.pictures.loading_curve import Bounds, save_curve
from perfplast_fenicsx.pictures.render_process import DrawingError
from perfplast_fenicsx.problem.loads import Load
from perfplast_fenicsx.problem.report import LevelReport

log = logging.getLogger(__name__)

NODAL, CELLWISE = ("displacement", "contact_pressure"), ("yield_ratio", "dissipation")


def draw_fields(
    assembly: TaggedMesh,
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
    model = Scene(title, loads, contacts, obstacles, units)
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
