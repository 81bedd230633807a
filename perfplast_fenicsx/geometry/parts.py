"""The bodies of a geometry file, read into gmsh's current model, with names."""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.sewing import sewn
from perfplast_fenicsx.mesh.gmsh_subprocess import windows_path

NO_NAME = re.compile(
    r"^the product name$|open cascade step translator|^=>|^\[?\d+[:.\d\]]*$", re.IGNORECASE
)
"""What writers of STEP files put where a part has no name."""

SCRIPTS = (".geo", ".geo_unrolled")
"""Gmsh's own files. Physical groups may have names in them; they may also run any command."""


STEP = b"ISO-10303-21"

IGES = re.compile(rb"^.{72}[SBC][ 0]{6}1", re.MULTILINE)
"""The first line of an IGES file has the letter of its section in column 73, and its number."""

IMPORTED = {
    ".step": re.compile(STEP),
    ".stp": re.compile(STEP),
    ".brep": re.compile(b"CASCADE Topology"),
    ".iges": IGES,
    ".igs": IGES,
}
"""What OpenCASCADE reads, and what such a file has in its beginning."""


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


def read_parts(path: Path) -> tuple[int, list[Part]]:
    """Read a geometry file, which :func:`check_file` has seen, into gmsh's current model.

    Returns:
        3 for solids or 2 for faces of a plane model, and the bodies.

    Raises:
        InputError: If the file cannot be read, or there is no solid in it.
    """
    if is_script(path):
        return _read_script(path)
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
    tags = tags or sewn(path, len(found))
    labels = [gmsh.model.getEntityName(3, tag) for tag in tags]
    names = unique_names(_leaf(label) for label in labels)
    return 3, [
        Part(name, label.removeprefix("Shapes/"), (tag,))
        for name, label, tag in zip(names, labels, tags, strict=True)
    ]


def is_script(path: Path) -> bool:
    """Whether gmsh would run what is in a file, by its name."""
    return path.suffix.lower() in SCRIPTS


def check_trust(path: Path, trust: bool) -> None:
    """Refuse a script that nobody has vouched for.

    Args:
        path: A geometry file.
        trust: Whether the user has said that its scripts may be run.

    Raises:
        InputError: Naming the file.
    """
    if is_script(path) and not trust:
        raise InputError(
            f"'{path}' is a script, by which gmsh may run any command and write any file; give"
            " --trust if you know what is in it, or export the geometry as STEP."
        )


def check_file(path: Path) -> None:
    """Refuse what is no geometry file.

    Raises:
        InputError: Naming the file.
    """
    suffix = path.suffix.lower()
    # Files that make geometries or meshes when they are run, which nothing here does.
    programs = (".py", ".m", ".jl", ".exe", ".sh", ".bat")
    if suffix in programs:
        raise InputError(
            f"'{path}' is a program, which is never run here; run it yourself if you know what is"
            " in it, and give the geometry that it writes."
        )
    if suffix not in (*IMPORTED, *SCRIPTS):
        known = ", ".join((*IMPORTED, *SCRIPTS))
        raise InputError(
            f"'{path}' is no geometry file by its name; it must end in one of {known}."
        )
    try:
        with path.open("rb") as file:
            head = file.read(2000)
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror}; {windows_path(path)}."
        ) from error
    if not head.strip():
        raise InputError(f"'{path}' is empty; export the geometry again.")
    if not _begins_as(suffix, head):
        kind = suffix[1:].upper()
        raise InputError(
            f"'{path}' is no {kind} file, whatever its name; export the parts as {kind}."
        )


def _begins_as(suffix: str, head: bytes) -> bool:
    """Whether a file of this name begins as such files do; scripts have no beginning."""
    return suffix in SCRIPTS or IMPORTED[suffix].search(head) is not None


def unique_names(wanted: Iterable[str]) -> list[str]:
    """Names of letters, digits and _ alone, in lower case, each once: equal ones are numbered."""
    plain = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "part" for name in wanted]
    plain = [f"part_{name}" if name[0].isdigit() else name for name in plain]
    how_many, seen, used = Counter(plain), Counter[str](), set[str]()
    names = []
    for name in plain:
        one = name
        while how_many[name] > 1 or one in used:
            seen[name] += 1
            one = f"{name}_{seen[name]}"
            if one not in used and one not in how_many:
                break
        used.add(one)
        names.append(one)
    return names


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
