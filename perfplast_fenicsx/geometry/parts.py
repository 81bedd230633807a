"""Read the bodies of a geometry file, with names, into gmsh's current model; sew loose faces."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.geometry_file import IMPORTED, STEP, is_script
from perfplast_fenicsx.geometry.part_names import unique_names


def closed_shells(faces: Sequence[int], near: float) -> list[list[int]]:
    """Return the faces of each body, for a file that lists faces body by body.

    Where bodies touch, an edge belongs to faces of several bodies, so sewing all faces together
    gives no solid. Therefore the function collects faces in order until each edge belongs to two of
    the collected faces.

    Args:
        faces: Faces in the order of the file.
        near: Edges count as equal if their lengths and centres differ by less than this.

    Returns:
        The closed shells; faces after the last shell belong to no shell.
    """
    edges = [_edges(face) for face in faces]
    numbers = _numbered(np.concatenate([_measures(own) for own in edges]), near)
    ends = np.cumsum([len(own) for own in edges])
    shells, shell, open_edges = list[list[int]](), list[int](), set[int]()
    for face, own in zip(faces, np.split(numbers, ends[:-1]), strict=True):
        shell.append(face)
        for edge in map(int, own):
            open_edges ^= {edge}
        if not open_edges:
            shells.append(shell)
            shell = []
    return shells


def _edges(face: int) -> list[int]:
    """Return the edges of a face, without the seams at which a closed face meets itself."""
    return [tag for _, tag in gmsh.model.getBoundary([(2, face)], combined=True, oriented=False)]


def _measures(edges: Sequence[int]) -> Floats:
    """Return the length and the centre of each edge, shape (n, 4)."""
    occ = gmsh.model.occ
    found = [[occ.getMass(1, tag), *occ.getCenterOfMass(1, tag)] for tag in edges]
    return np.array(found).reshape(-1, 4)


def _numbered(measures: Floats, near: float) -> Longs:
    """Return a number for each edge, the same for equal edges."""
    pairs = cKDTree(measures).query_pairs(near, output_type="ndarray")
    shape = (len(measures), len(measures))
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def sewn(path: Path, count: int) -> tuple[list[int], list[str]]:
    """Sew the faces of gmsh's current model; return the repaired solids, and remarks.

    Args:
        path: Path of the file, for messages.
        count: Number of faces and curves in the file.

    Returns:
        Tags of the solids, and remarks for the user.

    Raises:
        InputError: If the faces enclose no volume, even after gaps are closed.
    """
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    # Widths of gaps to close between faces, relative to the size of all faces. The loops use the
    # smallest sufficient width.
    gaps = (1e-6, 1e-5, 1e-4, 1e-3)
    if faces:
        whole = _area(faces)
        around = np.array([gmsh.model.getBoundingBox(2, tag) for tag in faces])
        size = float(np.linalg.norm(around[:, 3:].max(axis=0) - around[:, :3].min(axis=0)))
        # Touching bodies share edges, so all faces together do not form a solid.
        for gap in gaps:
            shells = closed_shells(faces, gap * size)
            if len(shells) > 1 and (solids := _filled(shells, gap * size)):
                # Where bodies touch, the gaps between their corners are as wide as the gaps between
                # their faces.
                gmsh.option.setNumber("Geometry.ToleranceBoolean", gap * size)
                return _alone(solids), _left_out(whole)
        for gap in gaps:
            if solids := _healed(gap * size):
                return _alone(solids), _left_out(whole)
    raise InputError(
        f"'{path}' has {count} faces and curves, but no solid, and the faces enclose no volume, "
        f"even if gaps up to {gaps[-1]:g} times the size of the whole model are closed; sew the "
        "faces into solids in the CAD system."
    )


def _area(faces: Sequence[int]) -> float:
    return float(sum(gmsh.model.occ.getMass(2, face) for face in faces))


def _left_out(whole: float) -> list[str]:
    """Return a list with a remark on omitted faces if their area is not negligible.

    Args:
        whole: Area of all faces of the file.
    """
    matters = 1e-3  # relative to the area of all faces; sewing changes areas by less
    lost = 1 - _area([tag for _, tag in gmsh.model.getEntities(2)]) / whole
    if lost < matters:
        return []
    return [
        f"faces with {100 * lost:.2g} % of the total area enclose no solid and are ignored; sew "
        "them in the CAD system if they belong to a body"
    ]


def _filled(shells: Sequence[Sequence[int]], gap: float) -> list[int]:
    """Return the solids that shells enclose, each sewn separately; an empty list after a failure.

    Args:
        shells: Faces of the shells.
        gap: Width up to which gaps between faces are closed.
    """
    occ = gmsh.model.occ
    before = gmsh.option.getNumber("Geometry.Tolerance")
    gmsh.option.setNumber("Geometry.Tolerance", gap)
    try:
        made = [(3, occ.addVolume([occ.addSurfaceLoop(it, sewing=True)])) for it in shells]
        occ.healShapes(made, gap, True, True, True, True, True)
        # gmsh cannot mesh surfaces of revolution after cuts, so convert these surfaces
        occ.convertToNURBS(made)
    except Exception:  # gmsh raises no more specific exception; a larger gap may succeed
        occ.remove(occ.getEntities(3))
    finally:
        gmsh.option.setNumber("Geometry.Tolerance", before)
    occ.synchronize()
    return _solids(len(shells))


def _healed(gap: float) -> list[int]:
    """Return the solids after sewing all faces together; an empty list if they enclose no volume.

    Args:
        gap: Width up to which gaps between faces are closed.
    """
    try:
        gmsh.model.occ.healShapes([], gap, True, True, True, True, True)
        gmsh.model.occ.synchronize()
    except Exception:  # gmsh raises no more specific exception; a larger gap may succeed
        return []
    return _solids(1)


def _solids(least: int) -> list[int]:
    """Return gmsh's solids, or [] if there are fewer than ``least`` or one has no volume."""
    solids = [tag for _, tag in gmsh.model.getEntities(3)]
    whole = len(solids) >= least and all(gmsh.model.occ.getMass(3, tag) > 0 for tag in solids)
    return solids if whole else []


def _alone(solids: list[int]) -> list[int]:
    """Remove faces, curves and points that belong to no solid, and return ``solids``."""
    occ = gmsh.model.occ
    for dim in (2, 1, 0):
        loose = [
            (dim, tag)
            for _, tag in gmsh.model.getEntities(dim)
            if not len(gmsh.model.getAdjacencies(dim, tag)[0])
        ]
        occ.remove(loose)
        occ.synchronize()
    return solids


NO_NAME = re.compile(
    r"^the product name$|open cascade step translator|^=>|^\[?\d+[:.\d\]]*$", re.IGNORECASE
)
"""Pattern of names that programs give to unnamed parts in STEP files."""

ENTITY = ("point", "curve", "surface", "volume")
"""Gmsh's words for entities, by dimension."""


@dataclass(frozen=True)
class Part:
    """A body of gmsh's model, with its names.

    Attributes:
        name: Name in the mesh.
        label: Name in the file.
        tags: Tags of the entities of the body.
    """

    name: str
    label: str
    tags: tuple[int, ...]


@dataclass(frozen=True)
class Drawing:
    """The content of a geometry file: bodies, remarks and names.

    Attributes:
        dim: 3 for solids, 2 for faces of a plane model.
        parts: The bodies.
        remarks: Remarks for the user, one sentence each.
        named: Tags of faces (in the plane of curves) by names of physical groups in a script.
    """

    dim: int
    parts: list[Part]
    remarks: list[str] = field(default_factory=list)
    named: dict[str, tuple[int, ...]] = field(default_factory=dict)


def read_parts(path: Path) -> Drawing:
    """Read a file into gmsh's current model, after :func:`~geometry_file.check_file` checked it.

    Raises:
        InputError: If the file cannot be read, or if it contains no body.
    """
    if is_script(path):
        return _read_script(path)
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    if (
        IMPORTED[path.suffix.lower()].pattern == STEP
    ):  # other formats have no units, or gmsh does not read their units
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
    """Return the name of a part from a path of names in an assembly."""
    last = label.rpartition("/")[2].strip()
    return "part" if NO_NAME.search(last) else last


def _read_script(path: Path) -> Drawing:
    """Read a gmsh script; its physical groups, and entities in no group, are the bodies."""
    try:
        gmsh.merge(str(path))
        gmsh.model.geo.synchronize()
        gmsh.model.occ.synchronize()
    except Exception as error:  # gmsh raises no more specific exception
        raise InputError(
            f"'{path}' cannot be read: {str(error).rstrip('.')}; correct the script."
        ) from error
    dim = gmsh.model.getDimension()
    if dim < 2:
        raise InputError(f"'{path}' has no volume and no surface; draw the bodies in it.")
    groups = _physical_groups(dim)
    grouped: dict[int, str] = {}
    for label, tags in groups.items():
        for tag in tags:
            if tag in grouped:
                raise InputError(
                    f"{ENTITY[dim]} {tag} of '{path}' is in the physical groups '{grouped[tag]}' "
                    f"and '{label}', but a body can have only one name; remove it from one of them."
                )
            grouped[tag] = label
    alone = [tag for _, tag in gmsh.model.getEntities(dim) if tag not in grouped]
    labels = [*groups, *("part" for _ in alone)]
    entities = [*groups.values(), *((tag,) for tag in alone)]
    named = _physical_groups(dim - 1)
    remarks = [
        f"the physical {ENTITY[of]} {', '.join(map(repr, left))} of '{path.name}' is ignored, "
        f"because supports and loads act on {ENTITY[dim - 1]}s"
        for of in range(dim - 1)
        if (left := _physical_groups(of))
    ]
    given = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()]
    numbers = {str(tag) for _, tag in gmsh.model.getPhysicalGroups(dim)} - {*given}
    gmsh.model.removePhysicalGroups()
    for name in given:  # without this call, gmsh gives the name to no other group
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
    """Return the entities of each physical group by its name, or by number without a name."""
    found: dict[str, tuple[int, ...]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, group) or str(group)
        entities = gmsh.model.getEntitiesForPhysicalGroup(dim, group)
        found[name] = (*found.get(name, ()), *(int(tag) for tag in entities))
    return found
