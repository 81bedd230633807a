"""Find where bodies of gmsh's current model touch, with their faces on both sides."""

from collections.abc import Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.joints import shared
from perfplast_fenicsx.geometry.parts import Part


@dataclass(frozen=True)
class Seam:
    """Faces at which two bodies touch.

    Attributes:
        bodies: Indices of the bodies.
        faces: Faces of each body; the same faces if they are meshed together.
    """

    bodies: tuple[int, int]
    faces: tuple[tuple[int, ...], tuple[int, ...]]


def find_seams(dim: int, parts: Sequence[Part]) -> list[Seam]:
    """Return the seams of pairs of bodies, sorted by bodies."""
    pairs: dict[tuple[int, ...], list[int]] = {}
    for face, bodies in shared(dim, owners(parts)).items():
        if len(bodies) == 2:
            pairs.setdefault(bodies, []).append(face)
    return [
        Seam((one, other), (tuple(faces), tuple(faces)))
        for (one, other), faces in sorted(pairs.items())
    ]


def owners(parts: Sequence[Part]) -> dict[int, int]:
    """Return the body of each entity."""
    return {tag: number for number, part in enumerate(parts) for tag in part.tags}


def faces_of_bodies(dim: int, parts: Sequence[Part]) -> dict[int, int]:
    """Return all outer faces, and a body of each."""
    return {face: bodies[0] for face, bodies in shared(dim, owners(parts)).items()}


def free_faces(dim: int, parts: Sequence[Part], seams: Sequence[Seam]) -> dict[int, int]:
    """Return the faces at which bodies touch nothing, and their bodies."""
    touching = {face for seam in seams for side in seam.faces for face in side}
    own = shared(dim, owners(parts))
    return {
        face: bodies[0] for face, bodies in own.items() if len(bodies) == 1 and face not in touching
    }


def take_apart(
    dim: int, parts: Sequence[Part], seams: Sequence[Seam]
) -> tuple[list[Part], list[Seam]]:
    """Give each body separate faces where it touches others, for separate meshing.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies, already cut along each other; they get new entities.
        seams: Places where they touch.

    Returns:
        The bodies, and their seams.

    Raises:
        InputError: If the bodies are gmsh's own geometry, which gmsh cannot copy in this way.
    """
    occ = gmsh.model.occ
    if {(dim, t) for part in parts for t in part.tags} - set(occ.getEntities(dim)):
        raise InputError(
            "meshed = 'apart': bodies of gmsh's built-in kernel cannot be separated; "
            'begin the file with SetFactory("OpenCASCADE"), or mesh them together.'
        )
    before = {face: _measures(dim - 1, [face])[0] for s in seams for face in s.faces[0]}
    copies = []
    for part in parts:
        new = [occ.copy([(dim, tag)])[0] for tag in part.tags]
        if len(new) > 1:  # pieces of one body remain connected
            new = occ.fragment(new, [])[0]
        copies.append(Part(part.name, part.label, tuple(t for of, t in new if of == dim)))
    occ.remove([(dim, tag) for part in parts for tag in part.tags], recursive=True)
    occ.synchronize()
    faces = [
        sorted({int(f) for t in part.tags for f in gmsh.model.getAdjacencies(dim, t)[1]})
        for part in copies
    ]
    after = [_measures(dim - 1, own) for own in faces]

    # Areas and centres of faces with a smaller difference, relative to their size, identify copies.
    rounding = 1e-6

    def copied(body: int, old: Sequence[int]) -> tuple[int, ...]:
        wanted = np.array([before[face] for face in old])
        distance = np.abs(after[body][:, None] - wanted[None]).max(axis=2)
        scale = float(np.abs(after[body]).max())
        if distance.min(axis=0).max() > rounding * scale:
            raise RuntimeError(f"a face of '{parts[body].name}' is lost in its copy")
        return tuple(faces[body][k] for k in np.argmin(distance, axis=0))

    return copies, [
        Seam(seam.bodies, (copied(seam.bodies[0], old), copied(seam.bodies[1], old)))
        for seam in seams
        for old in [seam.faces[0]]
    ]


def _measures(dim: int, tags: Sequence[int]) -> Floats:
    """Return square root of area (in the plane length) and centre of faces, shape (n, 4)."""
    occ = gmsh.model.occ
    return np.array(
        [[occ.getMass(dim, tag) ** (1 / dim), *occ.getCenterOfMass(dim, tag)] for tag in tags]
    ).reshape(-1, 4)
