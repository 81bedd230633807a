"""Read ground from a DXF file: closed lines are regions, and other lines are named lines."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.geometry.drawn_ground import DrawnLine, Region
from perfplast_fenicsx.geometry.part_names import unique_names

CHORD = 1e-3
"""Largest distance between a curve and its chords, relative to the size of the drawing."""

TOGETHER = 1e-9
"""Distance up to which two ends count as one point, relative to the size of the drawing."""

LINES = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"}
"""Types of entities that are lines."""

IGNORED = {"TEXT", "MTEXT", "DIMENSION", "HATCH", "LEADER", "MULTILEADER", "POINT", "IMAGE"}
"""Types of entities that only annotate a drawing."""


@dataclass(frozen=True)
class DxfDrawing:
    """The regions and lines in a DXF file.

    Attributes:
        regions: The regions, one for each closed line.
        lines: The other lines.
        remarks: Remarks for the user, one sentence each.
    """

    regions: list[Region]
    lines: list[DrawnLine]
    remarks: list[str] = field(default_factory=list)


def read_dxf(path: Path) -> DxfDrawing:
    """Return the regions and lines in a DXF file, named after their layers. Not collective.

    Segments in one layer that share ends form one line. Layers that are off or frozen are ignored.
    The name of a line is the name of its layer in lower-case letters; several lines in one layer
    are numbered.

    Args:
        path: The file, in the coordinates x and y of the case.

    Raises:
        InputError: If the package ezdxf is missing, if the file cannot be read or has no line, if
            points of a line differ in z, or if lines in one layer branch.
    """
    if path.exists() and not path.is_file():  # reading from a pipe might never end
        raise InputError(f"'{path.name}' is not a regular file; give a DXF file.")
    try:
        ezdxf, paths = import_module("ezdxf"), import_module("ezdxf.path")
    except ImportError as missing:
        raise InputError(
            f"'{path.name}' needs the package ezdxf, which is not installed; install it (pip "
            "install ezdxf), or draw the ground with [[region]]."
        ) from missing
    try:
        drawing = ezdxf.readfile(path)
    except (OSError, UnicodeDecodeError, ezdxf.DXFError) as error:
        raise InputError(
            f"'{path.name}' cannot be read as DXF ({error}); export it again."
        ) from error
    curves, left_out = _curves(drawing, paths)
    if not curves:
        raise InputError(
            f"'{path.name}' contains no line in a layer that is switched on; draw each region as a "
            "closed line in a layer with the name of the region."
        )
    size = max(np.ptp(np.concatenate([p.control_vertices() for _, p in curves]), axis=0).tolist())
    of_layers: dict[str, list[Floats]] = {}
    bent = False
    for layer, curve in curves:
        points = np.array(list(curve.flattening(CHORD * size)), dtype=np.float64).reshape(-1, 3)
        if np.ptp(points[:, 2]) > TOGETHER * size:
            where = place_of(points[int(np.argmax(points[:, 2]))])
            raise InputError(
                f"'{path.name}': the layer '{layer}' has a line that is not in a plane z = const, "
                f"at {where}; project the drawing to z = 0."
            )
        bent |= curve.has_curves
        of_layers.setdefault(layer, []).append(points[:, :2])
    chains = [
        (layer, chain)
        for layer, parts in of_layers.items()
        for chain in _joined(parts, TOGETHER * size, f"'{path.name}': the layer '{layer}'")
    ]
    names = unique_names(layer for layer, _ in chains)
    regions, lines = [], []
    for name, (_, (chain, closed)) in zip(names, chains, strict=True):
        given = [[float(value) for value in point] for point in chain]
        if closed:
            regions.append(Region(name, given))
        else:
            lines.append(DrawnLine(name, given))
    remarks = []
    if bent:
        remarks.append(
            f"'{path.name}': curves are replaced by chords at most {CHORD * size:.3g} away"
        )
    if left_out:
        kinds = ", ".join(sorted(left_out))
        remarks.append(f"'{path.name}': entities that are not lines are ignored: {kinds}")
    return DxfDrawing(regions, lines, remarks)


def _curves(drawing: Any, paths: Any) -> tuple[list[tuple[str, Any]], set[str]]:
    """Return the lines in layers that are on, with their layers, and types of ignored entities."""
    found, left_out = list[tuple[str, Any]](), set[str]()
    for entity in _entities(drawing.modelspace()):
        layer = entity.dxf.layer
        if drawing.layers.has_entry(layer):
            shown = drawing.layers.get(layer)
            if shown.is_off() or shown.is_frozen():
                continue
        if entity.dxftype() in LINES:
            found.append((layer, paths.make_path(entity)))
        else:
            left_out.add(entity.dxftype())
    return [(layer, path) for layer, path in found if len(path)], left_out - IGNORED


def _entities(space: Iterable[Any]) -> Iterable[Any]:
    """Yield all entities, including those in blocks, at the positions of the blocks."""
    for entity in space:
        if entity.dxftype() == "INSERT":
            yield from _entities(entity.virtual_entities())
        else:
            yield entity


def _joined(parts: Sequence[Floats], little: float, what: str) -> list[tuple[Floats, bool]]:
    """Return the lines after joining lines that share ends, and whether each is closed.

    Args:
        parts: Points of each line, shape (n, 2).
        little: Distance up to which two ends count as one point.
        what: Name of the object to which the lines belong, for messages.

    Raises:
        InputError: If more than two ends coincide.
    """
    found, open_ones = list[tuple[Floats, bool]](), list[Floats]()
    for part in parts:
        if np.linalg.norm(part[0] - part[-1]) <= little:
            found.append((part[:-1], True))
        else:
            open_ones.append(part)
    ends = np.array([end for part in open_ones for end in (part[0], part[-1])]).reshape(-1, 2)
    near = np.linalg.norm(ends[:, None] - ends, axis=2) <= little
    if (near.sum(axis=1) > 2).any():
        where = place_of(ends[int(np.argmax(near.sum(axis=1)))])
        raise InputError(
            f"{what} has lines that branch at {where}; draw each region as one closed line, or put "
            "each line in a separate layer."
        )
    while open_ones:
        chain = open_ones.pop(0)
        while (found_next := _next(chain, open_ones, little)) is not None:
            chain = np.concatenate([chain, found_next[1:]])
        while (found_next := _next(chain[::-1], open_ones, little)) is not None:
            chain = np.concatenate([found_next[:0:-1], chain])
        closed = bool(np.linalg.norm(chain[0] - chain[-1]) <= little)
        found.append((chain[:-1] if closed else chain, closed))
    return found


def _next(chain: Floats, others: list[Floats], little: float) -> Floats | None:
    """Remove from ``others`` a line that continues ``chain``, and return it; None if none does."""
    if np.linalg.norm(chain[0] - chain[-1]) <= little:
        return None
    for number, other in enumerate(others):
        for turned in (other, other[::-1]):
            if np.linalg.norm(turned[0] - chain[-1]) <= little:
                del others[number]
                return turned
    return None
