"""Straighten faces at which bodies touch after gaps between them were closed."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.measured import qualities
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.seams import Seam


def straighten(parts: Sequence[Part], seams: Sequence[Seam]) -> None:
    """Move nodes of the mesh to the original surfaces of the faces.

    Closing a gap replaces the edges of one body by those of the other body's face, at a distance of
    the gap width. Contact on a face that this bends pushes bodies aside.

    Args:
        parts: Bodies in space.
        seams: Places where they touch.

    Raises:
        InputError: If this folds elements.
    """
    faces = sorted({face for seam in seams for side in seam.faces for face in side})
    sweeps = 3  # nodes shared by several faces move to the intersection
    for _ in range(sweeps):
        for face in faces:
            nodes, points, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            closest, _ = gmsh.model.getClosestPoint(2, face, points)
            for node, point in zip(nodes, np.reshape(closest, (-1, 3)), strict=True):
                gmsh.model.mesh.setNode(int(node), point, [])
    for part in parts:
        if qualities(3, part).min() <= 0:
            raise InputError(
                f"closing gaps folds elements of '{part.name}'; give a larger size, a "
                "smaller close_gaps, or repair the geometry in the CAD system."
            )
