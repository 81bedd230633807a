"""What a picture shows of bodies that gmsh has meshed: skins, with the numbers of free faces."""

from collections.abc import Sequence
from typing import Any

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.geometry.survey import Body, Face


def skin_of(dim: int, bodies: Sequence[Body], faces: Sequence[Face]) -> dict[str, Any]:
    """The triangles that are seen of the bodies in gmsh's current model, whose groups have names.

    Args:
        dim: Of the bodies.
        bodies: Each a physical group.
        faces: Free ones, each a physical group.

    Returns:
        ``points``, shape (n, 3); ``triangles``, shape (m, 3), and the number ``body`` of each;
        ``names`` of the bodies; ``places`` on free faces, shape (k, 3), and their ``numbers``.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], coordinates.reshape(-1, 3)[order]
    number = {body.name: k for k, body in enumerate(bodies)}
    shown = faces if dim == 3 else bodies
    triangles, owners, places = [], [], []
    for part in shown:
        corners = np.searchsorted(tags, _corners(part.name, 2))
        triangles.append(corners)
        owners.append(np.full(len(corners), number[getattr(part, "body", part.name)]))
    for face in faces:
        middles = points[np.searchsorted(tags, _corners(face.name, dim - 1))].mean(axis=1)
        distance = np.linalg.norm(middles - face.centre, axis=1)
        places.append(middles[np.argmin(distance)])
    return {
        "points": points,
        "triangles": np.concatenate(triangles),
        "body": np.concatenate(owners),
        "names": np.array([body.name for body in bodies]),
        "places": np.array(places).reshape(-1, 3),
        "numbers": np.array([face.number for face in faces]),
    }


def _corners(name: str, dim: int) -> npt.NDArray[np.uint64]:
    """Vertices of the elements of a physical group, shape (num_elements, dim + 1)."""
    found = []
    for entity_dim, entity in gmsh.model.getEntitiesForPhysicalName(name):
        if entity_dim != dim:
            continue
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, array in zip(kinds, nodes, strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            found.append(array.reshape(-1, size)[:, : dim + 1])
    return np.concatenate(found)
