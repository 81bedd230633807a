"""Read the bodies of a geometry file into gmsh's current model, with names."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.geometry_file import IMPORTED, STEP, is_script
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.geometry.sewing import sewn

NO_NAME = re.compile(
    r"^the product name$|open cascade step translator|^=>|^\[?\d+[:.\d\]]*$", re.IGNORECASE
)
"""Names that writers of STEP files give to unnamed parts."""

ENTITY = ("point", "curve", "surface", "volume")
"""Gmsh's words for entities, by their dimension."""


@dataclass(frozen=True)
class Part:
    """A body of gmsh's model.

    Attributes:
        name: Name in the mesh.
        label: Name in the file.
        tags: Its entities.
    """

    name: str
    label: str
    tags: tuple[int, ...]


@dataclass(frozen=True)
class Drawing:
    """Bodies, remarks and names of a geometry file.

    Attributes:
        dim: 3 for solids or 2 for faces of a plane model.
        parts: The bodies.
        remarks: Remarks for the user, one sentence each.
        named: Faces (in the plane curves) by the names of a script's physical groups.
    """

    dim: int
    parts: list[Part]
    remarks: list[str] = field(default_factory=list)
    named: dict[str, tuple[int, ...]] = field(default_factory=dict)


def read_parts(path: Path) -> Drawing:
    """Read a geometry file, checked by :func:`~geometry_file.check_file`, into gmsh's model.

    Raises:
        InputError: If the file cannot be read, or if it contains no solid.
    """
    if is_script(path):
        return _read_script(path)
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    if (
        IMPORTED[path.suffix.lower()].pattern == STEP
    ):  # other formats have no units, or gmsh does not read them
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    try:
        found = gmsh.model.occ.importShapes(str(path), highestDimOnly=True)
        gmsh.model.occ.synchronize()
    except Exception as error:  # gmsh raises no more specific exception
        reason = str(error).rstrip(".") or "OpenCASCADE gives no reason"
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
    return Drawing(3, parts, remarks)


def _leaf(label: str) -> str:
    """Return the part's own name in a path of names."""
    last = label.rpartition("/")[2].strip()
    return "part" if NO_NAME.search(last) else last


def _read_script(path: Path) -> Drawing:
    """Read gmsh's own geometry: physical groups are bodies, if there are any."""
    try:
        gmsh.merge(str(path))
        gmsh.model.geo.synchronize()
        gmsh.model.occ.synchronize()
    except Exception as error:  # gmsh raises no more specific exception
        raise InputError(f"'{path}' cannot be read: {error}") from error
    dim = gmsh.model.getDimension()
    if dim < 2:
        raise InputError(f"'{path}' has no volume and no surface; make the bodies in it.")
    groups = _physical_groups(dim)
    grouped: dict[int, str] = {}
    for label, tags in groups.items():
        for tag in tags:
            if tag in grouped:
                raise InputError(
                    f"{ENTITY[dim]} {tag} of '{path}' is in the physical groups "
                    f"'{grouped[tag]}' and '{label}'; a body can have only one name."
                )
            grouped[tag] = label
    alone = [tag for _, tag in gmsh.model.getEntities(dim) if tag not in grouped]
    labels = [*groups, *("part" for _ in alone)]
    entities = [*groups.values(), *((tag,) for tag in alone)]
    named = _physical_groups(dim - 1)
    remarks = [
        f"the physical {ENTITY[of]} {', '.join(map(repr, left))} of '{path.name}' is left out:"
        f" supports and loads act on {ENTITY[dim - 1]}s"
        for of in range(dim - 1)
        if (left := _physical_groups(of))
    ]
    given = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()]
    numbers = {str(tag) for _, tag in gmsh.model.getPhysicalGroups(dim)} - {*given}
    gmsh.model.removePhysicalGroups()
    for name in given:  # gmsh keeps such a name and gives it to no other group
        gmsh.model.removePhysicalName(name)
    names = unique_names(labels)
    names = [lab if lab in numbers else name for lab, name in zip(labels, names, strict=True)]
    remarks += [
        f"the physical {ENTITY[dim]} '{label}' of '{path.name}' is called '{name}'"
        for label, name in zip(labels, names, strict=True)
        if label in groups and label != name
    ]
    parts = [Part(*both) for both in zip(names, labels, entities, strict=True)]
    return Drawing(dim, parts, remarks, named)


def _physical_groups(dim: int) -> dict[str, tuple[int, ...]]:
    """Return the entities of each physical group, by its name or otherwise its number."""
    found: dict[str, tuple[int, ...]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, group) or str(group)
        entities = gmsh.model.getEntitiesForPhysicalGroup(dim, group)
        found[name] = (*found.get(name, ()), *(int(tag) for tag in entities))
    return found
