"""Areas and volumes as the CAD system has them, beside those of the mesh and its centroids."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.parts import Part


def cad_measure(dim: int, tags: Sequence[int]) -> float | None:
    """Volume, area or length of entities; None where gmsh's built-in kernel has made them."""
    known = {tag for of, tag in gmsh.model.occ.getEntities(dim) if of == dim}
    if not known.issuperset(tags):
        return None
    return float(sum(gmsh.model.occ.getMass(dim, tag) for tag in tags))


def mesh_measure(dim: int, tag: int) -> float:
    """Volume, area or length of the elements of an entity, curved ones too."""
    return float(_quadrature(dim, tag)[1].sum())


def mesh_centre(dim: int, tags: Sequence[int]) -> Floats:
    """Return the centroid of the elements of entities, shape (3,); curved ones too."""
    found = [_quadrature(dim, tag) for tag in tags]
    points, weights = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return np.asarray(weights @ points / weights.sum())


def _quadrature(dim: int, tag: int) -> tuple[Floats, Floats]:
    """Points of the elements of an entity, shape (n, 3), and weights, whose sum is its measure."""
    points, weights = [np.empty((0, 3))], [np.empty(0)]
    gauss = "Gauss4"  # rule that volumes of curved elements are exact with
    for kind in gmsh.model.mesh.getElementTypes(dim, tag):
        local, of_rule = gmsh.model.mesh.getIntegrationPoints(kind, gauss)
        _, determinants, places = gmsh.model.mesh.getJacobians(kind, local, tag)
        points.append(places.reshape(-1, 3))
        weights.append((determinants.reshape(-1, of_rule.size) * of_rule).ravel())
    return np.concatenate(points), np.concatenate(weights)


def missed_areas(dim: int, parts: Sequence[Part]) -> dict[int, float]:
    """By what share each face of the mesh misses its area, of those that matter.

    In the plane lengths of curves are meant. Faces whose area is not known are left out.
    """
    tags = [tag for part in parts for tag in part.tags]
    faces = sorted({int(f) for tag in tags for f in gmsh.model.getAdjacencies(dim, tag)[1]})
    meant = [(face, cad_measure(dim - 1, [face])) for face in faces]
    known = {face: area for face, area in meant if area}
    # Share of the area of all faces that a face has which is to have its area in the mesh.
    matters = 0.01
    least = matters * sum(known.values())
    return {
        face: abs(mesh_measure(dim - 1, face) / area - 1)
        for face, area in known.items()
        if area > least
    }
