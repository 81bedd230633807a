"""Compute marks around the bodies in the view: arrows of loads, and ticks along supports."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.annotations import load_arrows, spread
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.problem.declared.supports import AXES
from perfplast_fenicsx.report.packing import pack_integers, pack_numbers

HEAD, TICK = 0.25, 0.015
"""Length of an arrow's head relative to its shaft, and half-length of a tick relative to the
bodies."""


def view_marks(reader: ResultReader) -> list[dict[str, Any]]:
    """Return lines that move with points of the skin, by kind.

    Returns:
        Each kind has a ``colour``, ``anchors`` (a point for each end of a line), and ``offsets``
        from them, one axis after the other.
    """
    surface = reader.skin.surface
    found = []
    # Colours of lines: red, green and blue.
    colours = {"loads": (0.72, 0.05, 0.05), "supports": (0.05, 0.3, 0.75)}
    for kind, (ends, held) in {"loads": _arrows(reader), "supports": _ticks(reader)}.items():
        if len(ends):
            anchors = cKDTree(surface.points).query(held)[1]
            offsets = ends - surface.points[anchors]
            found.append(
                {
                    "kind": kind,
                    "colour": colours[kind],
                    "anchors": pack_integers(anchors),
                    "offsets": [pack_numbers(axis) for axis in offsets.T],
                }
            )
    return found


def _arrows(reader: ResultReader) -> tuple[Floats, Floats]:
    """Return ends of lines, shape (2 n, 3), and their anchor points on the skin."""
    surface = reader.skin.surface
    arrows = load_arrows(surface, surface.points, reader.scene.on_surfaces)
    tails, tips = arrows.starts, arrows.starts + arrows.vectors
    across = np.cross(arrows.vectors, [0.0, 0.0, 1.0])
    steep = np.linalg.norm(across, axis=1) < 1e-6 * np.linalg.norm(arrows.vectors, axis=1)
    across[steep] = np.cross(arrows.vectors[steep], [0.0, 1.0, 0.0])
    backs = [tips - HEAD * arrows.vectors + side * HEAD / 2 * across for side in (-1, 1)]
    ends = np.stack([tails, tips, backs[0], tips, backs[1], tips], axis=1)
    tree = cKDTree(surface.points)
    nearer = tree.query(tips)[0] <= tree.query(tails)[0]
    touched = np.where(nearer[:, None], tips, tails)
    return ends.reshape(-1, 3), np.repeat(touched, 6, axis=0)


def _ticks(reader: ResultReader) -> tuple[Floats, Floats]:
    """Return ticks of supports in the same form: a line along each held axis."""
    surface, tags = reader.skin.surface, reader.skin.tags
    ends, held = [np.zeros((0, 3))], [np.zeros((0, 3))]
    half = TICK * surface.size
    most_marks = 20  # approximate number of points that show a support
    for support in reader.summary.given.get("supports", []):
        chosen = np.flatnonzero(np.isin(tags, reader.named.surfaces.get(support["on"], [])))
        if not len(chosen):
            continue
        facets = surface.facets[chosen]
        total = np.linalg.norm(surface.normals[chosen], axis=1).sum()
        weights, facet = spread(
            surface.points[facets], (total / most_marks) ** (1 / (facets.shape[1] - 1))
        )
        places = np.einsum("nc,nci->ni", weights, surface.points[facets[facet]])
        letters = set(support.get("components", AXES)) & set(AXES)
        axes = [np.eye(3)[AXES.index(one)] for one in letters if not surface.plane or one != "z"]
        if support.get("components") == "normal":
            normal = surface.normals[chosen].sum(axis=0)
            axes = [normal / np.linalg.norm(normal)]
        for along in half * np.array(axes):
            ends.append(np.stack([places - along, places + along], axis=1).reshape(-1, 3))
            held.append(np.repeat(places, 2, axis=0))
    return np.concatenate(ends), np.concatenate(held)
