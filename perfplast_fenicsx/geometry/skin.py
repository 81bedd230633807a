"""Create the skins of meshed bodies for a picture, with the numbers of free faces."""

from collections.abc import Sequence
from typing import Any

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.geometry.free_faces import FreeFace
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.seams import Seam
from perfplast_fenicsx.geometry.survey import Face


def skin_of(
    dim: int,
    parts: Sequence[Part],
    free: Sequence[FreeFace],
    faces: Sequence[Face],
    seams: Sequence[Seam],
) -> dict[str, Any]:
    """Return the visible triangles of the bodies in gmsh's current mesh.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies.
        free: Free faces.
        faces: The same faces, measured.
        seams: Faces at which bodies touch.

    Returns:
        ``points``, shape (n, 3); ``triangles``, shape (m, 3), with the index ``body`` of each and
        that of its free face from 1, ``face`` (0 for plane bodies, whose faces are curves);
        ``names`` of the bodies; ``places`` on free faces, shape (k, 3), and their ``numbers``;
        ``outlines`` of seams, shape (s, 2), with the index ``seam`` of each line. Plane bodies have
        also lines of free faces, ``segments``, shape (t, 2), with the ``segment_face`` of each.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], coordinates.reshape(-1, 3)[order]
    shown: list[tuple[int, int, tuple[int, ...]]] = [
        (face.body, face.number, (face.tag,)) for face in free
    ]
    if dim == 2:
        shown = [(number, 0, part.tags) for number, part in enumerate(parts)]
    triangles, owners, faces_of, places = [], [], [], []
    for number, face_number, entities in shown:
        corners = np.searchsorted(tags, _corners(entities, 2))
        triangles.append(corners)
        owners.append(np.full(len(corners), number))
        faces_of.append(np.full(len(corners), face_number))
    for one, face in zip(free, faces, strict=True):
        middles = points[np.searchsorted(tags, _corners([one.tag], dim - 1))].mean(axis=1)
        distance = np.linalg.norm(middles - face.centre, axis=1)
        places.append(middles[np.argmin(distance)])
    ends = {number: _ends(tags, dim, seam.faces[0]) for number, seam in enumerate(seams)}
    free_ends = {face.number: _ends(tags, dim, [face.tag]) for face in free if dim == 2}
    return {
        **_numbered(ends, "outlines", "seam"),
        **_numbered(free_ends, "segments", "segment_face"),
        "points": points,
        "triangles": np.concatenate(triangles),
        "body": np.concatenate(owners),
        "face": np.concatenate(faces_of),
        "names": np.array([part.name for part in parts]),
        "places": np.array(places).reshape(-1, 3),
        "numbers": np.array([face.number for face in faces]),
    }


def _ends(tags: npt.NDArray[np.uint64], dim: int, faces: Sequence[int]) -> npt.NDArray[np.int64]:
    """Return the ends of the outline of faces, shape (n, 2); in the plane of all their lines."""
    corners = np.searchsorted(tags, _corners(faces, dim - 1)).astype(np.int64)
    if dim == 2:
        return corners
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(once[counts == 1], dtype=np.int64)


def _numbered(
    ends: dict[int, npt.NDArray[np.int64]], lines: str, numbers: str
) -> dict[str, npt.NDArray[np.int64]]:
    """Return lines and the number of each as arrays with these names."""
    counts = [len(one) for one in ends.values()]
    return {
        lines: np.concatenate([np.zeros((0, 2), dtype=np.int64), *ends.values()]),
        numbers: np.repeat(np.array(list(ends), dtype=np.int64), counts),
    }


def _corners(entities: Sequence[int], dim: int) -> npt.NDArray[np.uint64]:
    """Return vertices of the elements of entities, shape (num_elements, dim + 1)."""
    found = []
    for entity in entities:
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, array in zip(kinds, nodes, strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            found.append(array.reshape(-1, size)[:, : dim + 1])
    return np.concatenate(found)
