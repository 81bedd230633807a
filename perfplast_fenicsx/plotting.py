"""Pictures of a run: ``fields.png``, the deformed bodies, and ``path.png``, ζ over α."""

import json
import logging
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.limit_load import LimitLoad
from perfplast_fenicsx.loads import Load, Pressure, Traction
from perfplast_fenicsx.state import LevelReport
from perfplast_fenicsx.surface import Surface, gather_surface

log = logging.getLogger(__name__)

SHOWN_DEFORMATION = 0.1
"""The largest displacement is drawn about so large, relative to the size of the assembly."""

PATIENCE = 300.0
"""Longest time for a picture (s)."""


def draw_fields(
    assembly: Assembly,
    fields: Mapping[str, fem.Function],
    report: LevelReport,
    title: str,
    loads: Sequence[Load],
    contacts: Sequence[Contact],
    path: Path,
    caption: str | None = None,
) -> bool:
    """Draw the deformed bodies with plastic zone, displacement and contact pressure. Collective.

    Without a graphics system a warning is logged on rank 0, and nothing is drawn.

    Args:
        assembly: Mesh with names.
        fields: ``displacement``, ``yield_ratio`` and ``contact_pressure`` of the level.
        report: The level.
        title: Heading of the picture.
        loads: Shown as arrows where they act on surfaces.
        contacts: Shown with the contact pressure.
        path: The png file.
        caption: Second line of the heading; by default load factor and work.

    Returns:
        Whether there is a picture, on every rank alike.
    """
    nodal = {name: fields[name] for name in ("displacement", "contact_pressure")}
    cellwise = {"yield_ratio": fields["yield_ratio"]}
    on_surfaces = [load for load in loads if isinstance(load, Traction | Pressure)]
    marks = {f"load {i}": [load.on] for i, load in enumerate(on_surfaces)}
    marks["contact"] = [contact.secondary for contact in contacts]
    surface = gather_surface(assembly, nodal, cellwise, marks)
    drawn = False
    if surface is not None:
        scale = deformation_scale(surface)
        enlarged = "to scale" if scale == 1 else f"drawn {scale:g} times as large"
        level = f"load factor ζ = {report.zeta:.6g},   work of the loads α = {report.alpha:.5g}"
        about = {
            "title": title,
            "subtitle": f"{caption or level},   deformation {enlarged}",
            "scale": scale,
            "names": surface.names,
            "loads": {f"load {i}": _direction(load) for i, load in enumerate(on_surfaces)},
        }
        drawn = _render(surface, about, path)
    return bool(assembly.mesh.comm.bcast(drawn))


def deformation_scale(surface: Surface) -> float:
    """A round number (1, 2 or 5 times a power of ten) that makes the deformation visible."""
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    largest = float(np.linalg.norm(surface.at_points["displacement"], axis=1).max(initial=0))
    wanted = SHOWN_DEFORMATION * size / largest if largest > 0 else 1.0
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
        axes.plot([0, slope * top], [0, top], ":", color="#707070", label="elastic")
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
    axes.set(xlabel="work of the loads α", ylabel="load factor ζ", title=title)
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path)


def _direction(load: Traction | Pressure) -> list[float] | float:
    """Where the arrows of a load point: a vector, or 1.0 or −1.0 along the outward normal."""
    if isinstance(load, Pressure):
        return math.copysign(1.0, -load.value)
    return [*load.value, 0.0][:3]


def _render(surface: Surface, about: Mapping[str, object], path: Path) -> bool:
    """Draw by :mod:`perfplast_fenicsx.render` in a process of its own."""
    program = Path(__file__).with_name("render.py")
    with tempfile.TemporaryDirectory() as folder, display() as environment:
        source = Path(folder) / "surface.npz"
        arrays: dict[str, Any] = {
            "points": surface.points,
            "triangles": surface.triangles,
            "body": surface.body,
            "about": json.dumps(about),
            **surface.at_points,
            **surface.at_cells,
            **surface.marks,
        }
        np.savez(source, **arrays)
        command = [sys.executable, "-P", str(program), str(source), str(path)]
        try:
            done = subprocess.run(
                command,
                env=environment,
                capture_output=True,
                text=True,
                timeout=PATIENCE,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            log.warning("%s was not drawn (%s).", path.name, error)
            return False
    if done.returncode != 0 or not path.exists():
        log.warning("%s was not drawn: %s", path.name, _cause(environment, done))
        return False
    return True


def _cause(environment: Mapping[str, str], done: subprocess.CompletedProcess[str]) -> str:
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    if "DISPLAY" not in environment and "Error" not in last:
        return "there is no X server; install Xvfb (Debian package xvfb), or set DISPLAY."
    return f"the drawing program failed ({last})."


@contextmanager
def display() -> Iterator[dict[str, str]]:
    """An environment to draw in: with an X server of its own where Xvfb is installed.

    The variables of MPI launchers are left out, so that the child is no rank.
    """
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(hidden)}
    program = shutil.which("Xvfb")
    if program is None:
        yield environment
        return
    reader, writer = os.pipe()
    command = [program, "-displayfd", str(writer), "-screen", "0", "1280x1024x24"]
    with subprocess.Popen(
        [*command, "-nolisten", "tcp"],
        pass_fds=[writer],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    ) as server:
        os.close(writer)
        with os.fdopen(reader) as pipe:
            number = pipe.readline().strip()
        if number:
            environment["DISPLAY"] = f":{number}"
        try:
            yield environment
        finally:
            server.terminate()
