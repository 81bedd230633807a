"""Cut bodies of gmsh's current model along each other, and find the faces between them."""

from collections.abc import Iterable, Mapping, Sequence

import gmsh

from meshes.naming import interface

Solid = tuple[int, int]
"""Dimension (3) and tag of a solid."""


def fragment(parts: Mapping[str, Sequence[Solid]]) -> dict[str, list[int]]:
    """Cut bodies along each other; where two overlap, the later one gets the common part.

    Args:
        parts: The solids of each body.

    Returns:
        Tags of the volumes by name.
    """
    occ = gmsh.model.occ
    solids = [solid for own in parts.values() for solid in own]
    _, images = occ.fragment(solids, [])
    occ.synchronize()
    owner: dict[int, str] = {}
    places = iter(images)
    for label, own in parts.items():
        for _ in own:
            owner.update({tag: label for _, tag in next(places)})
    return {label: [tag for tag, body in owner.items() if body == label] for label in parts}


def joints(bodies: Mapping[str, Sequence[int]]) -> dict[str, list[int]]:
    """Return the faces that two bodies share, numbered by pair of bodies.

    Args:
        bodies: Tags of the volumes by name.

    Returns:
        Tags of faces by name: ``joint_1`` and so on.
    """
    owner = {tag: body for body, tags in bodies.items() for tag in tags}
    found: dict[tuple[str, ...], list[int]] = {}
    for tag in interface(2):
        both = tuple(sorted({owner[solid] for solid in gmsh.model.getAdjacencies(2, tag)[0]}))
        if len(both) == 2:
            found.setdefault(both, []).append(tag)
    return {f"joint_{k}": tags for k, tags in enumerate(found.values(), start=1)}


def sides(surfaces: Iterable[str]) -> list[tuple[str, str]]:
    """Return the two surfaces of each joint, which ``write_split`` has named after their bodies.

    Args:
        surfaces: All names of a mesh, such as ``plate_joint_1``.
    """
    found: dict[str, list[str]] = {}
    for surface in sorted(surfaces):
        if "_joint_" in surface:
            found.setdefault(surface.split("_joint_")[1], []).append(surface)
    return [(one, other) for one, other in found.values()]
