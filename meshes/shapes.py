"""Add 2D and 3D shapes to gmsh's current model."""

from collections.abc import Sequence

import gmsh


def add_box(corner: Sequence[float], extent: Sequence[float]) -> tuple[int, int]:
    """Add a rectangle in the plane z = 0, or a box.

    Args:
        corner: Corner with the smallest coordinates, (x, y) or (x, y, z).
        extent: Lengths along the axes.

    Returns:
        Dimension and tag.
    """
    if len(corner) == 2:
        return 2, gmsh.model.occ.addRectangle(*corner, 0.0, *extent)
    return 3, gmsh.model.occ.addBox(*corner, *extent)


def add_polygon(curves: Sequence[int]) -> int:
    """Add the plane surface inside a closed chain of curves.

    Args:
        curves: Tags of the curves; the first one is anticlockwise.

    Returns:
        Tag of the surface.
    """
    return gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(curves)])


def add_outline(corners: Sequence[tuple[float, float]]) -> list[int]:
    """Add the lines from each corner of a polygon in the plane z = 0 to the next corner.

    Args:
        corners: Corners (x, y) in anticlockwise order.

    Returns:
        Tags of the lines; the first one starts at the first corner.
    """
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in corners]
    following = points[1:] + points[:1]
    return [gmsh.model.occ.addLine(a, b) for a, b in zip(points, following, strict=True)]


def add_block(corner: Sequence[float], extent: Sequence[float], half: bool) -> tuple[int, int]:
    """Add a box, or the half of it to the right of the diagonal from its corner, seen from z.

    Args:
        corner: Corner with the smallest coordinates, (x, y, z).
        extent: Lengths along the axes.
        half: Whether to add half of a box.

    Returns:
        Dimension and tag.
    """
    if not half:
        return add_box(corner, extent)
    (x, y, z), (length, width, height) = corner, extent
    base = add_polygon(add_outline([(x, y), (x + length, y), (x + length, y + width)]))
    gmsh.model.occ.translate([(2, base)], 0.0, 0.0, z)
    found: tuple[int, int] = gmsh.model.occ.extrude([(2, base)], 0.0, 0.0, height)[1]
    return found
