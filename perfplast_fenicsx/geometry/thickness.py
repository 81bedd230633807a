"""Bodies through whose thickness one element reaches: too few for bending."""

import gmsh
import numpy as np

from perfplast_fenicsx.geometry.parts import Part

MOST = 0.5
"""Share of a body's elements that may reach from one side to the other without a word."""


def share_through(dim: int, part: Part) -> float:
    """Share of the elements of a body all of whose corners lie on its surface.

    A body with two elements through its thickness has corners in between, so that few elements are
    of this kind; with one through it all are.
    """
    faces = {int(f) for tag in part.tags for f in gmsh.model.getAdjacencies(dim, tag)[1]}
    outer = [gmsh.model.mesh.getNodes(dim - 1, face, includeBoundary=True)[0] for face in faces]
    on_surface = np.unique(np.concatenate(outer))
    through = count = 0
    for tag in part.tags:
        for kind, nodes in zip(*gmsh.model.mesh.getElements(dim, tag)[::2], strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            corners = nodes.reshape(-1, size)[:, : dim + 1]
            through += int(np.isin(corners, on_surface).all(axis=1).sum())
            count += len(corners)
    return through / count if count else 0.0
