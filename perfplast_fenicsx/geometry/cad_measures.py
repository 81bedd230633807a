"""Compute areas and volumes in the CAD system and in the mesh, with centroids."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.parts import Part


def cad_measure(dim: int, tags: Sequence[int]) -> float | None:
    """Return volume, area or length of entities; None for gmsh's built-in kernel."""
    known = {tag for of, tag in gmsh.model.occ.getEntities(dim) if of == dim}
    if not known.issuperset(tags):
        return None
    return float(sum(gmsh.model.occ.getMass(dim, tag) for tag in tags))


def mesh_measure(dim: int, tag: int) -> float:
    """Return volume, area or length of the elements of an entity, including curved ones."""
    return float(_quadrature(dim, tag)[1].sum())


def mesh_centre(dim: int, tags: Sequence[int]) -> Floats:
    """Return the centroid of the elements of entities, shape (3,), including curved ones."""
    found = [_quadrature(dim, tag) for tag in tags]
    points, weights = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return np.asarray(weights @ points / weights.sum())


def _quadrature(dim: int, tag: int) -> tuple[Floats, Floats]:
    """Return points of an entity's elements, shape (n, 3), and weights that sum to its measure."""
    points, weights = [np.empty((0, 3))], [np.empty(0)]
    gauss = "Gauss4"  # rule that is exact for volumes of curved elements
    for kind in gmsh.model.mesh.getElementTypes(dim, tag):
        local, of_rule = gmsh.model.mesh.getIntegrationPoints(kind, gauss)
        _, determinants, places = gmsh.model.mesh.getJacobians(kind, local, tag)
        points.append(places.reshape(-1, 3))
        weights.append((determinants.reshape(-1, of_rule.size) * of_rule).ravel())
    return np.concatenate(points), np.concatenate(weights)


def missed_areas(dim: int, parts: Sequence[Part]) -> dict[int, float]:
    """Return the relative area error of each face of the mesh that matters.

    In the plane, these are lengths of curves. Faces with an unknown area are omitted.
    """
    tags = [tag for part in parts for tag in part.tags]
    faces = sorted({int(f) for tag in tags for f in gmsh.model.getAdjacencies(dim, tag)[1]})
    meant = [(face, cad_measure(dim - 1, [face])) for face in faces]
    known = {face: area for face, area in meant if area}
    # Least share of the total area of a face whose area should be accurate.
    matters = 0.01
    least = matters * sum(known.values())
    return {
        face: abs(mesh_measure(dim - 1, face) / area - 1)
        for face, area in known.items()
        if area > least
    }
