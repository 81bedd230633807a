"""Keep one half of symmetric bodies in gmsh's current model."""

from collections.abc import Mapping, Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.face_choice import AXES
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.parts import Part


def cut_in_half(dim: int, parts: Sequence[Part], planes: Mapping[str, float]) -> list[Part]:
    """Keep the part with larger coordinates of each plane.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies; they get new entities, and those on the other side are removed.
        planes: Position of each plane by coordinate.

    Raises:
        InputError: If the bodies are not symmetric, or are gmsh's own geometry, which cannot be
            cut.
    """
    for axis, value in planes.items():
        if AXES.index(axis) >= dim:
            raise InputError(f"symmetry: a plane model has no {axis}; give x or y.")
        if {(dim, t) for part in parts for t in part.tags} - set(gmsh.model.occ.getEntities(dim)):
            raise InputError(
                "symmetry: bodies of gmsh's built-in kernel cannot be cut; begin the file with"
                ' SetFactory("OpenCASCADE"), or model one half.'
            )
        parts = _half(dim, parts, axis, value)
    return list(parts)


def _half(dim: int, parts: Sequence[Part], axis: str, value: float) -> list[Part]:
    along = AXES.index(axis)
    around = np.array([box(dim, part.tags) for part in parts])
    low, high = around[:, 0].min(axis=0), around[:, 1].max(axis=0)
    size = float(np.linalg.norm(high - low))
    if not low[along] < value < high[along]:
        raise InputError(
            f"symmetry: {axis} = {value:g} lies outside the bodies, which reach from"
            f" {low[along]:.6g} to {high[along]:.6g}; give a plane through them."
        )
    volume, centre = _mass(dim, parts)
    kept = []
    for part in parts:
        tags = tuple(new for tag in part.tags for new in _upper(dim, tag, along, value, size))
        if tags:
            kept.append(Part(part.name, part.label, tags))
    gmsh.model.occ.synchronize()
    half, of_half = _mass(dim, kept)
    beside = np.arange(3) != along
    across = float(abs(centre - of_half)[beside].max())
    # Allowed differences of symmetric bodies: of the volumes of both halves, and of centres
    # relative to the size.
    unequal = 1e-3
    same = abs(2 * half - volume) <= unequal * volume and across <= unequal * size
    if not same or abs(centre[along] - value) > unequal * size:
        raise InputError(
            f"symmetry: the bodies are not symmetric about {axis} = {value:g}: their "
            f"centre is at {axis} = {centre[along]:.6g}, and {half / volume:.1%} of their "
            "volume lies beyond; give another plane, or remove it."
        )
    return kept


def _upper(dim: int, tag: int, along: int, value: float, size: float) -> list[int]:
    """Return the part of a body beyond a plane."""
    occ = gmsh.model.occ
    low, high = box(dim, [tag])
    if high[along] <= value + 1e-6 * size:
        occ.remove([(dim, tag)], recursive=True)
        return []
    if low[along] >= value - 1e-6 * size:
        return [tag]
    corner, edges = low - size, high - low + 2 * size
    corner[along], edges[along] = value, high[along] - value + size
    if dim == 3:
        room = occ.addBox(*corner, *edges)
    else:
        points = gmsh.model.getBoundary([(dim, tag)], combined=False, recursive=True)
        plane = gmsh.model.getValue(0, points[0][1], [])[2]  # bounding boxes are slightly too large
        room = occ.addRectangle(corner[0], corner[1], plane, edges[0], edges[1])
    found, _ = occ.intersect([(dim, tag)], [(dim, room)])
    return [new for of, new in found if of == dim]


def _mass(dim: int, parts: Sequence[Part]) -> tuple[float, Floats]:
    """Return the volume and its centre."""
    occ, tags = gmsh.model.occ, [tag for part in parts for tag in part.tags]
    masses = np.array([occ.getMass(dim, tag) for tag in tags])
    centres = np.array([occ.getCenterOfMass(dim, tag) for tag in tags]).reshape(-1, 3)
    return float(masses.sum()), masses @ centres / masses.sum()
