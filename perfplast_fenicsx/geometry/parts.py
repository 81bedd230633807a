"""The bodies of a geometry file, read into gmsh's current model, with names."""

import re
from dataclasses import dataclass
from pathlib import Path

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.geometry_file import IMPORTED, STEP, is_script
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.geometry.sewing import sewn

NO_NAME = re.compile(
    r"^the product name$|open cascade step translator|^=>|^\[?\d+[:.\d\]]*$", re.IGNORECASE
)
"""What writers of STEP files put where a part has no name."""


@dataclass(frozen=True)
class Part:
    """A body of gmsh's model.

    Attributes:
        name: For the mesh.
        label: In the file.
        tags: Its entities.
    """

    name: str
    label: str
    tags: tuple[int, ...]


def read_parts(path: Path) -> tuple[int, list[Part], list[str]]:
    """Read a geometry file, which :func:`~geometry_file.check_file` has seen, into gmsh's model.

    Returns:
        3 for solids or 2 for faces of a plane model, the bodies, and what a user should know.

    Raises:
        InputError: If the file cannot be read, or there is no solid in it.
    """
    if is_script(path):
        return *_read_script(path), []
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    if (
        IMPORTED[path.suffix.lower()].pattern == STEP
    ):  # the others have no units, or gmsh reads none
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    try:
        found = gmsh.model.occ.importShapes(str(path), highestDimOnly=True)
        gmsh.model.occ.synchronize()
    except Exception as error:  # gmsh raises nothing more specific
        reason = str(error).rstrip(".") or "OpenCASCADE does not say why"
        raise InputError(f"'{path}' cannot be read: {reason}; export it again.") from error
    tags = [tag for dim, tag in found if dim == 3]
    if not tags and not found:
        raise InputError(f"'{path}' is empty; export the parts as solids.")
    remarks = list[str]()
    if not tags:
        tags, remarks = sewn(path, len(found))
    labels = [gmsh.model.getEntityName(3, tag) for tag in tags]
    names = unique_names(_leaf(label) for label in labels)
    parts = [
        Part(name, label.removeprefix("Shapes/"), (tag,))
        for name, label, tag in zip(names, labels, tags, strict=True)
    ]
    return 3, parts, remarks


def _leaf(label: str) -> str:
    """The part's own name in a path of names."""
    last = label.rpartition("/")[2].strip()
    return "part" if NO_NAME.search(last) else last


def _read_script(path: Path) -> tuple[int, list[Part]]:
    """Gmsh's own geometry: physical groups are bodies where there are any."""
    try:
        gmsh.merge(str(path))
        gmsh.model.geo.synchronize()
        gmsh.model.occ.synchronize()
    except Exception as error:  # gmsh raises nothing more specific
        raise InputError(f"'{path}' cannot be read: {error}") from error
    dim = gmsh.model.getDimension()
    if dim < 2:
        raise InputError(f"'{path}' has no volume and no surface; make the bodies in it.")
    groups = gmsh.model.getPhysicalGroups(dim)
    given = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()]
    labels, entities = [], []
    for _, group in groups:
        labels.append(gmsh.model.getPhysicalName(dim, group) or f"group {group}")
        entities.append(tuple(int(t) for t in gmsh.model.getEntitiesForPhysicalGroup(dim, group)))
    grouped: dict[int, str] = {}
    for label, tags in zip(labels, entities, strict=True):
        for tag in tags:
            if tag in grouped:
                what = {2: "surface", 3: "volume"}[dim]
                raise InputError(
                    f"{what} {tag} of '{path}' is in the physical groups '{grouped[tag]}' and"
                    f" '{label}'; an entity can have one name only."
                )
            grouped[tag] = label
    for _, tag in gmsh.model.getEntities(dim):
        if tag not in grouped:
            labels.append("part")
            entities.append((tag,))
    gmsh.model.removePhysicalGroups()
    for name in given:  # which gmsh keeps, and gives to no other group then
        gmsh.model.removePhysicalName(name)
    names = unique_names(labels)
    return dim, [Part(*both) for both in zip(names, labels, entities, strict=True)]
