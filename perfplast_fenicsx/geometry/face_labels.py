"""Assign the labels of faces in a STEP file, which gmsh does not read, to gmsh's faces.

Gmsh lists the faces of a solid in the file's order. The module verifies this for each body: the
corners of its faces in the file, after a rigid motion, must coincide with gmsh's.
"""

from collections.abc import Sequence
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.geometry_file import IMPORTED, STEP
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.step_faces import StepSolid, names_in, read_solids


def labels_of(path: Path, parts: Sequence[Part]) -> tuple[dict[int, str], list[str]]:
    """Return the labels of faces as read, before any cut.

    Args:
        path: The geometry file.
        parts: Its bodies in gmsh's current model.

    Returns:
        The labels of labelled faces, and a sentence if some are omitted.
    """
    kind = IMPORTED.get(path.suffix.lower())
    if kind is None or kind.pattern != STEP:
        return {}, []
    solids, in_place = read_solids(path)
    found: dict[int, str] = {}
    lost: set[str] = set()
    for part in parts if solids else ():
        labels, unsure = _of_body(part, solids, in_place)
        found.update(labels)
        lost |= unsure
    lost |= set().union(*(names_in(solid.labels) for solid in solids)) - set(found.values())
    if not lost:
        return found, []
    # Largest number of named labels.
    first = sorted(lost)[:5]
    more = f" and {len(lost) - len(first)} more" if len(lost) > len(first) else ""
    which = ", ".join(map(repr, first)) + more
    return found, [f"labels of faces are left out because their faces are not certain: {which}"]


def _of_body(
    part: Part, solids: Sequence[StepSolid], in_place: bool
) -> tuple[dict[int, str], set[str]]:
    """Return the labels of a body's faces, and the labels whose face is not certain."""
    faces = [int(face) for tag in part.tags for face in gmsh.model.getAdjacencies(3, tag)[1]]
    alike = [solid for solid in solids if len(solid.labels) == len(faces)]
    if not alike:
        return {}, set()
    corners = [_corners(face) for face in faces]
    counts = np.array([len(c) for c in corners])
    means = np.array([c.mean(axis=0) if len(c) else np.full(3, np.nan) for c in corners])
    possible: set[tuple[str, ...]] = set()
    lost: set[str] = set()
    for solid in alike:
        sure = (counts == np.array(solid.counts)) & (counts > 0)
        if 2 * sure.sum() < len(faces) or not _is_same(solid.corners[sure], means[sure], in_place):
            continue
        names = names_in(solid.labels)
        labels = [label if label in names else "" for label in solid.labels]
        pairs = list(zip(labels, sure, strict=True))
        lost.update(label for label, certain in pairs if not certain)
        possible.add(tuple(label if certain else "" for label, certain in pairs))
    if len(possible) != 1:
        return {}, lost.union(*possible) - {""}
    (known,) = possible
    return {face: label for face, label in zip(faces, known, strict=True) if label}, lost - {""}


def _is_same(drawn: Floats, read: Floats, in_place: bool) -> bool:
    """Return whether two point sets are equal after scaling by units and a rigid motion."""
    # Allowed deviation of corners as shares of the body's size: STEP has fewer digits.
    close = 1e-5
    one, other = drawn - drawn.mean(axis=0), read - read.mean(axis=0)
    size, wanted = np.linalg.norm(one), np.linalg.norm(other)
    if not size or not wanted:
        return False
    scale = wanted / size
    if in_place:
        return bool(np.abs(scale * drawn - read).max() <= close * max(wanted, np.abs(read).max()))
    left, _, right = np.linalg.svd(one.T @ other)
    turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return bool(np.abs(scale * one @ turn - other).max() <= close * wanted)


def _corners(face: int) -> Floats:
    around = gmsh.model.getBoundary([(2, face)], oriented=False, recursive=True)
    places = [gmsh.model.getValue(0, tag, []) for dim, tag in around if dim == 0]
    return np.array(places).reshape(-1, 3)
