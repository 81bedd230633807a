"""Edge lengths of the elements of gmsh's current model: the same everywhere, or finer somewhere."""

import math
from collections.abc import Callable, Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError

SizeLaw = Callable[[float, float, float], float]
"""Edge length as a function of the place (x, y, z)."""


def generate(dim: int, law: SizeLaw, order: int) -> None:
    """Mesh gmsh's current model with elements of the given sizes.

    Args:
        dim: Dimension of the bodies.
        law: Edge length by the place; nothing else sets it.
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
    # Large elements on a curved surface may be bent so much that they fold over.
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
    """Edge lengths that depend on the distance from one point.

    Args:
        point: The place of the smallest elements, (x, y) or (x, y, z).
        near: Edge length from there up to the distance ``flat``.
        size: Edge length that it grows to.
        flat: Radius of the finest part.
        reach: Distance from which on it grows beyond ``size``.
        growth: Growth of the edge length per distance.
    """
    centre = (*point, 0.0)[:3]

    def law(x: float, y: float, z: float) -> float:
        distance = math.dist((x, y, z), centre)
        inside = min(size, near + growth * max(0.0, distance - flat))
        return inside + growth * max(0.0, distance - reach)

    return law


def _worst_quality(dim: int) -> float:
    """Signed inverse condition number of the worst element, 1 at best, below 0 where it folds."""
    tags = np.concatenate(gmsh.model.mesh.getElements(dim)[1])
    return float(gmsh.model.mesh.getElementQualities(tags, "minSICN").min())
