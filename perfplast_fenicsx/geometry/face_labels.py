"""Read the labels and colours of individual faces in a STEP file, which give names to the faces.

The module reads labels from the text of the file. Gmsh lists the faces of a solid in the order of
the file. The module verifies this order for each body: after a rigid motion, the corners of its
faces in the file must coincide with those in gmsh.

Gmsh reads colours (``Geometry.OCCImportLabels``), but loses them when bodies are cut along each
other. The program therefore keeps copies of coloured and labelled faces during the cut. After the
cut, a face that coincides with a copy gets the colour and the label of this copy.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from colorsys import rgb_to_hsv
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.geometry_file import IMPORTED, STEP
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.parts import Part

Entities = Mapping[int, tuple[str, str]]
"""Kind and arguments of each entity by number; the arguments contain indices of strings."""


@dataclass(frozen=True)
class StepSolid:
    """A solid as it is drawn, before its placement in the assembly.

    Attributes:
        labels: Labels of the faces in the order of the file; "" for a face without a label.
        corners: Mean of the corners of each face, shape (num_faces, 3); NaN without corners.
        counts: Number of corners of each face.
    """

    labels: tuple[str, ...]
    corners: Floats
    counts: tuple[int, ...]


def read_solids(path: Path) -> tuple[list[StepSolid], bool]:
    """Return the solids in a STEP file if faces have labels, and whether no part is moved.

    Returns:
        The solids (an empty list if no face has a label or if the text has an unknown form), and
        whether all solids are placed where they are drawn.
    """
    data = path.read_bytes()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    # Most files have no labels, and a search for labels is faster than a search for entities.
    if not re.search(r"ADVANCED_FACE\s*\(\s*'(?!NONE')[^']", text):
        return [], True
    pieces = text.split("'")
    strings = pieces[1::2]
    marked = [f"{piece}'{k}'" for k, piece in enumerate(pieces[::2])]
    plain = re.sub(r"/\*.*?\*/", "", "".join(marked), flags=re.DOTALL)
    entities = _entities(plain)
    try:
        solids = [
            _solid(entities, strings, args)
            for kind, args in entities.values()
            if kind in ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS")
        ]
        in_place = _in_place(entities)
    except (KeyError, ValueError, IndexError):  # an entity is missing or has an unknown form
        return [], True
    return (solids if any(names_in(solid.labels) for solid in solids) else []), in_place


def _entities(text: str) -> Entities:
    """Return the entities that define faces, corners and placements; no surfaces or curves."""
    kinds = {
        *("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "CLOSED_SHELL", "ORIENTED_CLOSED_SHELL"),
        *("ADVANCED_FACE", "FACE_BOUND", "FACE_OUTER_BOUND", "EDGE_LOOP", "VERTEX_LOOP"),
        *("ORIENTED_EDGE", "EDGE_CURVE", "VERTEX_POINT", "CARTESIAN_POINT", "DIRECTION"),
        *("ITEM_DEFINED_TRANSFORMATION", "AXIS2_PLACEMENT_3D", "MAPPED_ITEM"),
    }
    found = {}
    for statement in text.split(";"):
        entity = re.fullmatch(r"\s*#(\d+)\s*=\s*(\w+)\s*\((.*)\)\s*", statement, re.DOTALL)
        if entity and entity[2] in kinds:
            found[int(entity[1])] = (entity[2], entity[3])
    return found


def _solid(entities: Entities, strings: list[str], args: str) -> StepSolid:
    faces = list(_below(entities, args, "ADVANCED_FACE"))
    points = []
    for face in faces:
        corners = list(_below(entities, entities[face][1], "VERTEX_POINT"))
        places = [_refs(entities[corner][1])[0] for corner in corners]
        points.append(np.array([_numbers(entities[at][1]) for at in places]).reshape(-1, 3))
    none = np.full(3, np.nan)
    means = np.array([p.mean(axis=0) if len(p) else none for p in points]).reshape(-1, 3)
    labels = tuple(_label(entities[face][1], strings) for face in faces)
    return StepSolid(labels, means, tuple(len(p) for p in points))


def _below(entities: Entities, args: str, kind: str) -> dict[int, None]:
    """Return the entities of type ``kind`` to which ``args`` refers, also indirectly, in order."""
    found: dict[int, None] = {}
    seen: set[int] = set()
    left = _refs(args)[::-1]
    while left:
        one = left.pop()
        if one in seen or one not in entities:
            continue
        seen.add(one)
        if entities[one][0] == kind:
            found[one] = None
        else:
            left += _refs(entities[one][1])[::-1]
    return found


def _label(args: str, strings: list[str]) -> str:
    """Return the string at the beginning of ``args``; two quotes in a row mean one quote."""
    (numbers,) = re.findall(r"^\s*((?:'\d+')*)", args)
    label = "'".join(strings[int(k)] for k in re.findall(r"\d+", numbers))
    wide = re.sub(r"\\X2\\((?:[0-9A-Fa-f]{4})+)\\X0\\", _from_hex, label)
    return " ".join(wide.split())


def _from_hex(digits: re.Match[str]) -> str:
    return bytes.fromhex(digits[1]).decode("utf-16-be", "replace")


def _in_place(entities: Entities) -> bool:
    """Return whether no part is moved: both coordinate systems of each placement are equal."""
    for kind, args in entities.values():
        if kind == "MAPPED_ITEM":
            return False
        if kind == "ITEM_DEFINED_TRANSFORMATION":
            one, other = (_system(entities, entities[k][1]) for k in _refs(args)[-2:])
            if one != other:
                return False
    return True


def _system(entities: Entities, args: str) -> list[list[float]]:
    return [_numbers(entities[k][1]) for k in _refs(args)]


def _numbers(args: str) -> list[float]:
    """Return the numbers in the parentheses of a point or direction."""
    return [float(number) for number in args[args.index("(") :].strip("() \r\n").split(",")]


def _refs(args: str) -> list[int]:
    return [int(ref) for ref in re.findall(r"#(\d+)", args)]


def names_in(labels: Iterable[str]) -> set[str]:
    """Return those labels of a solid that can serve as names.

    Empty labels, "NONE", counters such as "Face 12", and a label that all faces share are excluded.
    """
    given = set(labels)
    if len(given) < 2:
        return set()
    counter = re.compile(r"(none|null|unnamed|face|surface|f)?[\W_]*\d*", re.IGNORECASE)
    return {label for label in given if not counter.fullmatch(label)}


def labels_of(path: Path, parts: Sequence[Part]) -> tuple[dict[int, str], list[str]]:
    """Return the labels of the faces that gmsh has read, before any cut, and remarks.

    Args:
        path: The geometry file.
        parts: The bodies of the file in gmsh's current model.

    Returns:
        Labels by tag of the face, and a list with a remark if some labels are omitted.
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
    # The remark lists at most five labels.
    first = sorted(lost)[:5]
    more = f" and {len(lost) - len(first)} more" if len(lost) > len(first) else ""
    which = ", ".join(map(repr, first)) + more
    return found, [
        f"labels of faces are ignored because the faces to which they belong are uncertain: {which}"
    ]


def _of_body(
    part: Part, solids: Sequence[StepSolid], in_place: bool
) -> tuple[dict[int, str], set[str]]:
    """Return the labels of a body's faces by tag, and the labels whose face is uncertain."""
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
    """Return whether point sets are equal up to units and, unless ``in_place``, a rigid motion."""
    # Allowed deviation of corners, relative to the body's size, because STEP files have fewer
    # digits.
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


Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Mark:
    """The colour, label or names of a face, of which the program keeps a copy during the cut.

    Attributes:
        body: Name of the body of the face.
        colour: Colour of the face if it differs from the body's colour; otherwise None.
        label: Label of the face; "" if the face has no label.
        tag: Tag of the copy.
        names: Names of the physical groups in a script that contain the face; ``body`` is then "".
    """

    body: str
    colour: Colour | None
    label: str
    tag: int
    names: tuple[str, ...] = ()


def word_of(colour: Colour) -> str:
    """Return the English word for a colour."""
    hue, saturation, value = rgb_to_hsv(*(part / 255 for part in colour))
    pale, dark = 0.15, 0.1  # below this saturation or value, a colour has no visible hue
    if saturation < pale or value < dark:
        # words for colours without a hue, by value
        greys = {"black": 0.0, "grey": 0.5, "white": 1.0}
        return min(greys, key=lambda word: abs(greys[word] - value))
    # words for colours, by hue (degrees)
    hues = {
        "red": 0,
        "orange": 30,
        "yellow": 60,
        "green": 120,
        "cyan": 180,
        "blue": 230,
        "magenta": 300,
    }
    return min(hues, key=lambda word: abs((360 * hue - hues[word] + 180) % 360 - 180))


def hex_of(colour: Colour) -> str:
    """Return the HTML code of a colour, such as "#dd5228"."""
    return "#" + "".join(f"{part:02x}" for part in colour)


def set_aside(parts: Sequence[Part], labels: Mapping[int, str]) -> list[Mark]:
    """Copy all faces with a label or with a colour other than their body's; return their marks.

    The colour of a body is the colour of most of its area. A body has no colour if one of its faces
    has no colour.

    Args:
        parts: The bodies.
        labels: Labels of the faces by tag.
    """
    marks = []
    for part in parts:
        colours: dict[int, Colour | None] = {}
        for tag in part.tags:
            for face in gmsh.model.getAdjacencies(3, tag)[1]:
                red, green, blue, solid = gmsh.model.getColor(2, int(face))
                colours[int(face)] = (red, green, blue) if solid else None
        areas: dict[Colour | None, float] = {}
        if len(set(colours.values())) > 1:  # only if necessary, because computing areas takes time
            for face, colour in colours.items():
                areas[colour] = areas.get(colour, 0.0) + gmsh.model.occ.getMass(2, face)
        usual = None if None in areas else max(areas, key=areas.__getitem__, default=None)
        for face, colour in colours.items():
            own = colour if areas and colour != usual else None
            label = labels.get(face, "")
            if own is not None or label:
                ((_, copy),) = gmsh.model.occ.copy([(2, face)])
                marks.append(Mark(part.name, own, label, copy))
    gmsh.model.occ.synchronize()
    return marks


def set_aside_named(dim: int, named: Mapping[str, Sequence[int]]) -> list[Mark]:
    """Copy the faces of OpenCASCADE's kernel that are in physical groups; return the marks.

    Args:
        dim: Dimension of the faces.
        named: Tags of faces by names of groups.
    """
    names: dict[int, list[str]] = {}
    for name, tags in named.items():
        for tag in tags:
            names.setdefault(tag, []).append(name)
    made = {tag for _, tag in gmsh.model.occ.getEntities(dim)}
    marks = [
        Mark("", None, "", gmsh.model.occ.copy([(dim, tag)])[0][1], tuple(some))
        for tag, some in names.items()
        if tag in made
    ]
    gmsh.model.occ.synchronize()
    return marks


def take_back(
    dim: int, marks: Sequence[Mark], faces: Mapping[int, int], parts: Sequence[Part]
) -> dict[int, Mark]:
    """Return the marks of faces that coincide with copies, and remove the copies.

    Args:
        dim: Dimension of the faces.
        marks: Result of :func:`set_aside` or :func:`set_aside_named`.
        faces: Index of the body of each face, by tag of the face.
        parts: The bodies.
    """
    found = {}
    boxes = {mark.tag: box(dim, [mark.tag]) for mark in marks}
    # A face coincides with a copy if their distance, relative to the size of the face, is below
    # this value.
    nearest = 1e-6
    for face, body in faces.items() if marks else ():
        low, high = box(dim, [face])
        near = nearest * float(np.linalg.norm(high - low))
        point: Floats | None = None
        for mark in marks:
            least, most = boxes[mark.tag]
            if mark.body not in ("", parts[body].name) or (low < least - near).any():
                continue
            if (high > most + near).any():
                continue
            point = _inside(dim, face) if point is None else point
            foot, _ = gmsh.model.getClosestPoint(dim, mark.tag, point)
            if np.linalg.norm(point - foot) <= near and gmsh.model.isInside(dim, mark.tag, foot):
                found[face] = mark
                break
    gmsh.model.occ.remove([(dim, mark.tag) for mark in marks], recursive=True)
    gmsh.model.occ.synchronize()
    return found


def _inside(dim: int, face: int) -> Floats:
    """Return a point inside a face; if none is found, the point at the middle parameters."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(dim, face))
    if dim == 1:
        return np.asarray(gmsh.model.getValue(1, face, (low + high) / 2))
    # fractions of a face's parameter ranges at which a point inside is sought
    along = (0.5, 0.31, 0.67, 0.13, 0.86)
    places = [low + np.array([u, v]) * (high - low) for u in along for v in along]
    chosen = next((at for at in places if gmsh.model.isInside(2, face, at, True)), places[0])
    return np.asarray(gmsh.model.getValue(2, face, chosen))
