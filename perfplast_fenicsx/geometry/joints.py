"""Cut the bodies in gmsh's current model along each other, and find where they touch."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.survey import Near


def cut_along_each_other(
    dim: int, parts: Sequence[Part], overlap: float, close_gaps: float = 0.0
) -> list[Part]:
    """Cut bodies so that neighbours share the faces at which they touch; return the bodies.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies; they get new entities.
        overlap: Largest allowed overlap of two bodies, relative to the volume of the smaller body.
        close_gaps: Distance (length) below which two faces become one face.

    Raises:
        InputError: If bodies overlap by more than ``overlap``, if they cannot be cut, or if closing
            gaps changes them too much.
    """
    solids = [(dim, tag) for part in parts for tag in part.tags]
    if len(solids) < 2 or set(solids) - set(gmsh.model.occ.getEntities(dim)):
        return list(
            parts
        )  # one body, or gmsh's built-in kernel, in which neighbours already share faces
    sizes = {tag: gmsh.model.occ.getMass(dim, tag) for _, tag in solids}
    if close_gaps:
        gmsh.option.setNumber("Geometry.ToleranceBoolean", close_gaps)
    try:
        _, images = gmsh.model.occ.fragment(solids, [])
    except Exception as error:  # gmsh raises no more specific exception
        raise InputError(
            f"gmsh cannot divide the bodies at their common faces ({str(error).rstrip(' .')}); "
            f"{'give a smaller close_gaps, or ' if close_gaps else ''}repair the geometry where "
            "bodies touch or overlap."
        ) from error
    gmsh.model.occ.synchronize()
    owner: dict[int, int] = {}
    places = iter(zip(solids, images, strict=True))
    whole = [sum(sizes[tag] for tag in part.tags) for part in parts]
    for number, part in enumerate(parts):
        for _ in part.tags:
            for _, tag in next(places)[1]:
                before = owner.get(tag, number)
                owner[tag] = number
                if before == number:
                    continue
                common, smaller = (
                    gmsh.model.occ.getMass(dim, tag),
                    min(whole[before], whole[number]),
                )
                if common > overlap * smaller:
                    raise InputError(
                        f"bodies '{parts[before].name}' and '{part.name}' overlap by {common:.3g} "
                        f"({common / smaller:.1%} of the smaller one); separate them in the CAD "
                        "system, or increase overlap."
                    )
    cut = [
        Part(part.name, part.label, tuple(tag for tag, own in owner.items() if own == number))
        for number, part in enumerate(parts)
    ]
    if close_gaps:
        _check_kept(dim, cut, whole, close_gaps)
    return cut


def _check_kept(dim: int, parts: Sequence[Part], before: Sequence[float], gaps: float) -> None:
    """Raise an error if closing gaps has changed the volume of a body too much.

    Raises:
        InputError: If the volume of a body changes too much.
    """
    most = 0.05  # allowed relative change of a body's volume
    for part, volume in zip(parts, before, strict=True):
        now = sum(gmsh.model.occ.getMass(dim, tag) for tag in part.tags)
        if not abs(now / volume - 1) <= most:
            raise InputError(
                f"close_gaps = {gaps:g} changes the {'volume' if dim == 3 else 'area'} of "
                f"'{part.name}' by {abs(now / volume - 1):.1%}; give a smaller value, or repair "
                "the geometry in the CAD system."
            )


def near_misses(dim: int, parts: Sequence[Part]) -> list[Near]:
    """Return the pairs of bodies that are close to each other, but share no face."""
    if set(gmsh.model.getEntities(dim)) - set(gmsh.model.occ.getEntities(dim)):
        return []
    boxes = np.array([box(dim, part.tags) for part in parts])
    sizes = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    no_distance = 1e-7  # distance that counts as zero, relative to the size of the assembly
    none = no_distance * float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)))
    first, second = np.triu_indices(len(parts), 1)
    between = np.maximum(boxes[first, 0] - boxes[second, 1], boxes[second, 0] - boxes[first, 1])
    apart = np.linalg.norm(between.clip(min=0), axis=1)
    # bodies nearly touch up to this distance, relative to the size of the smaller body
    nearly = 0.02
    reach = nearly * np.minimum(sizes[first], sizes[second])
    most_distances = 300  # largest number of pairs whose distance is measured
    nearest = np.argsort(apart, kind="stable")[:most_distances]
    owner = {tag: number for number, part in enumerate(parts) for tag in part.tags}
    touching = set(map(frozenset[int], shared(dim, owner).values()))
    faces = [_boxes_of_faces(dim, part) for part in parts]
    found = []
    for pair in nearest[apart[nearest] <= reach[nearest]]:
        one, other = int(first[pair]), int(second[pair])
        if {one, other} in touching or _between(faces[one], faces[other]) > reach[pair]:
            continue
        gap = min(
            gmsh.model.occ.getDistance(dim, a, dim, b)[0]
            for a, b in product(parts[one].tags, parts[other].tags)
        )
        if gap <= reach[pair]:
            distance = float(gap) if gap > none else 0.0
            found.append(Near((parts[one].name, parts[other].name), distance))
    return found


def _boxes_of_faces(dim: int, part: Part) -> Floats:
    """Return the smallest and largest coordinates of each face, shape (n, 2, 3)."""
    found = {int(face) for tag in part.tags for face in gmsh.model.getAdjacencies(dim, tag)[1]}
    return np.array([box(dim - 1, [face]) for face in found]).reshape(-1, 2, 3)


def _between(one: Floats, other: Floats) -> float:
    """Return the smallest distance between boxes, a fast lower bound on the distance of faces."""
    gaps = np.maximum(one[:, None, 0] - other[None, :, 1], other[None, :, 0] - one[:, None, 1])
    return float(np.linalg.norm(gaps.clip(min=0), axis=2).min(initial=np.inf))


def shared(dim: int, owner: dict[int, int]) -> dict[int, tuple[int, ...]]:
    """Return the faces of bodies by tag, each with its one or two bodies.

    Args:
        dim: Dimension of the bodies.
        owner: Index of the body of each entity. Faces inside a body are omitted.
    """
    sides: dict[int, list[int]] = {}
    for tag, body in owner.items():
        for face in gmsh.model.getAdjacencies(dim, tag)[1]:
            sides.setdefault(int(face), []).append(body)
    return {
        face: tuple(sorted(set(bodies)))
        for face, bodies in sides.items()
        if len(bodies) == 1 or len(set(bodies)) > 1
    }


def box(dim: int, tags: Sequence[int]) -> Floats:
    """Return the smallest and largest coordinates of entities, shape (2, 3)."""
    boxes = np.array([gmsh.model.getBoundingBox(dim, tag) for tag in tags]).reshape(-1, 2, 3)
    return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


@dataclass(frozen=True)
class Seam:
    """The faces at which two bodies touch.

    Attributes:
        bodies: Indices of the bodies.
        faces: Tags of the faces of each body; both have the same faces if they are meshed together.
    """

    bodies: tuple[int, int]
    faces: tuple[tuple[int, ...], tuple[int, ...]]


def find_seams(dim: int, parts: Sequence[Part]) -> list[Seam]:
    """Return the seams of all pairs of bodies that touch, sorted by bodies."""
    pairs: dict[tuple[int, ...], list[int]] = {}
    for face, bodies in shared(dim, owners(parts)).items():
        if len(bodies) == 2:
            pairs.setdefault(bodies, []).append(face)
    return [
        Seam((one, other), (tuple(faces), tuple(faces)))
        for (one, other), faces in sorted(pairs.items())
    ]


def owners(parts: Sequence[Part]) -> dict[int, int]:
    """Return the index of the body of each entity, by tag of the entity."""
    return {tag: number for number, part in enumerate(parts) for tag in part.tags}


def faces_of_bodies(dim: int, parts: Sequence[Part]) -> dict[int, int]:
    """Return all faces that bound bodies, each with the index of one of its bodies."""
    return {face: bodies[0] for face, bodies in shared(dim, owners(parts)).items()}


def free_faces(dim: int, parts: Sequence[Part], seams: Sequence[Seam]) -> dict[int, int]:
    """Return the faces at which bodies touch no other body, each with the index of its body."""
    touching = {face for seam in seams for side in seam.faces for face in side}
    own = shared(dim, owners(parts))
    return {
        face: bodies[0] for face, bodies in own.items() if len(bodies) == 1 and face not in touching
    }


def take_apart(
    dim: int, parts: Sequence[Part], seams: Sequence[Seam]
) -> tuple[list[Part], list[Seam]]:
    """Return bodies with separate faces where they touch, and their seams, for separate meshes.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies after they were cut along each other; they get new entities.
        seams: Places where they touch.

    Returns:
        The bodies, and their seams.

    Raises:
        InputError: If the bodies belong to gmsh's built-in kernel, for which such copies are not
            possible.
    """
    occ = gmsh.model.occ
    if {(dim, t) for part in parts for t in part.tags} - set(occ.getEntities(dim)):
        raise InputError(
            "meshed = 'apart': bodies of gmsh's built-in kernel cannot be separated; "
            'begin the file with SetFactory("OpenCASCADE"), or mesh the bodies together.'
        )
    before = {face: _measures(dim - 1, [face])[0] for s in seams for face in s.faces[0]}
    copies = []
    for part in parts:
        new = [occ.copy([(dim, tag)])[0] for tag in part.tags]
        if len(new) > 1:  # keeps the pieces of one body connected
            new = occ.fragment(new, [])[0]
        copies.append(Part(part.name, part.label, tuple(t for of, t in new if of == dim)))
    occ.remove([(dim, tag) for part in parts for tag in part.tags], recursive=True)
    occ.synchronize()
    faces = [
        sorted({int(f) for t in part.tags for f in gmsh.model.getAdjacencies(dim, t)[1]})
        for part in copies
    ]
    after = [_measures(dim - 1, own) for own in faces]

    # relative difference of areas and centres up to which a face counts as a copy
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
    """Return the root of the area (in the plane the length) and the centre of each face."""
    occ = gmsh.model.occ
    return np.array(
        [[occ.getMass(dim, tag) ** (1 / dim), *occ.getCenterOfMass(dim, tag)] for tag in tags]
    ).reshape(-1, 4)
