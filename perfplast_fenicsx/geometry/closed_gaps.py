"""Faces at which bodies touch since gaps between them were closed."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.measured import qualities
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.seams import Seam


def straighten(parts: Sequence[Part], seams: Sequence[Seam]) -> None:
    """Move nodes of the mesh to the surfaces on which the faces lie.

    Closing a gap makes the edges of one body those of the other one's face, from which they are as
    far as the gap was wide. Contact on a face that is bent by that pushes bodies aside.

    Args:
        parts: Bodies in space.
        seams: Places where they touch.

    Raises:
        InputError: If elements are folded by that.
    """
    faces = sorted({face for seam in seams for side in seam.faces for face in side})
    sweeps = 3  # nodes of several faces come to where these meet
    for _ in range(sweeps):
        for face in faces:
            nodes, points, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            closest, _ = gmsh.model.getClosestPoint(2, face, points)
            for node, point in zip(nodes, np.reshape(closest, (-1, 3)), strict=True):
                gmsh.model.mesh.setNode(int(node), point, [])
    for part in parts:
        if qualities(3, part).min() <= 0:
            raise InputError(
                f"closing gaps folds elements of '{part.name}'; give a larger size, a smaller"
                " close_gaps, or mend the geometry in the CAD system."
            )
