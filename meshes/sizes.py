"""Set edge lengths of the elements in gmsh's current model: uniform, or finer at some places."""

import math
from collections.abc import Callable, Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError

SizeLaw = Callable[[float, float, float], float]
"""Function that returns the edge length at a place (x, y, z)."""


def generate(dim: int, law: SizeLaw, order: int) -> None:
    """Mesh gmsh's current model with elements of the given sizes.

    Args:
        dim: Dimension of the bodies.
        law: Edge length as a function of the place; nothing else determines it.
        order: Degree of the geometry, 1 or 2.

    Raises:
        InputError: If the elements are too large for the curves of the bodies.
    """
    for option in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e22)
    gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: law(x, y, z))
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(order)
    # Large elements on a curved surface can be so strongly curved that they fold over.
    if order == 2 and _worst_quality(dim) < 0.2:
        gmsh.model.mesh.optimize("HighOrderElastic")
        if _worst_quality(dim) <= 0.0:
            raise InputError("the curved elements of this mesh fold over; give a smaller size")


def finer_at(
    point: Sequence[float],
    near: float,
    size: float,
    *,
    flat: float = 0.0,
    reach: float = math.inf,
    growth: float = 0.25,
) -> SizeLaw:
    """Return edge lengths that depend on the distance from one point.

    Args:
        point: Place of the smallest elements, (x, y) or (x, y, z).
        near: Edge length from this point up to the distance ``flat``.
        size: Edge length to which it grows.
        flat: Radius of the finest part.
        reach: Distance beyond which it grows above ``size``.
        growth: Growth of the edge length per distance.
    """
    centre = (*point, 0.0)[:3]

    def law(x: float, y: float, z: float) -> float:
        distance = math.dist((x, y, z), centre)
        inside = min(size, near + growth * max(0.0, distance - flat))
        return inside + growth * max(0.0, distance - reach)

    return law


def _worst_quality(dim: int) -> float:
    """Return the least signed inverse condition number of elements: 1 at best, < 0 if folded."""
    tags = np.concatenate(gmsh.model.mesh.getElements(dim)[1])
    return float(gmsh.model.mesh.getElementQualities(tags, "minSICN").min())
