"""Faces at which bodies touch since gaps between them were closed."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.geometry.seams import Seam


def straighten(seams: Sequence[Seam]) -> None:
    """Move nodes of the mesh to the surfaces on which the faces lie.

    Closing a gap makes the edges of one body those of the other one's face, from which they are as
    far as the gap was wide. Contact on a face that is bent by that pushes bodies aside.

    Args:
        seams: Of bodies in space.
    """
    faces = sorted({face for seam in seams for side in seam.faces for face in side})
    sweeps = 3  # nodes of several faces come to where these meet
    for _ in range(sweeps):
        for face in faces:
            nodes, points, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            closest, _ = gmsh.model.getClosestPoint(2, face, points)
            for node, point in zip(nodes, np.reshape(closest, (-1, 3)), strict=True):
                gmsh.model.mesh.setNode(int(node), point, [])
