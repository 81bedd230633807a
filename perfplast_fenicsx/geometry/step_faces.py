"""Read the faces of solids in a STEP file as text: their labels and corners."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats

Entities = Mapping[int, tuple[str, str]]
"""Kind and arguments of each entity, with strings replaced by their indices."""


@dataclass(frozen=True)
class StepSolid:
    """A solid as drawn, before its placement.

    Attributes:
        labels: Labels of its faces, in the file's order; empty for a face without one.
        corners: The mean of the corners of each face; NaN without corners.
        counts: Number of corners of each face.
    """

    labels: tuple[str, ...]
    corners: Floats
    counts: tuple[int, ...]


def read_solids(path: Path) -> tuple[list[StepSolid], bool]:
    """Return the solids of a STEP file whose faces have labels.

    Returns:
        The solids (none if no face has a label or if the text is not understood), and whether all
        of them lie where they are drawn.
    """
    data = path.read_bytes()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    # Most files have no label, which is faster to detect than to find entities.
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
    except (KeyError, ValueError, IndexError):  # missing or unexpected entities
        return [], True
    return (solids if any(names_in(solid.labels) for solid in solids) else []), in_place


def _entities(text: str) -> Entities:
    """Return the entities that define faces, corners and placements; no surfaces and curves."""
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
    """Return the entities of a kind that arguments refer to, each once, in order."""
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
    """Return the string at the beginning of arguments; a quote in it is doubled."""
    (numbers,) = re.findall(r"^\s*((?:'\d+')*)", args)
    label = "'".join(strings[int(k)] for k in re.findall(r"\d+", numbers))
    wide = re.sub(r"\\X2\\((?:[0-9A-Fa-f]{4})+)\\X0\\", _from_hex, label)
    return " ".join(wide.split())


def _from_hex(digits: re.Match[str]) -> str:
    return bytes.fromhex(digits[1]).decode("utf-16-be", "replace")


def _in_place(entities: Entities) -> bool:
    """Return whether no part is moved: both systems of each placement are equal."""
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
    """Return the numbers in the parentheses of a point or a direction."""
    return [float(number) for number in args[args.index("(") :].strip("() \r\n").split(",")]


def _refs(args: str) -> list[int]:
    return [int(ref) for ref in re.findall(r"#(\d+)", args)]


def names_in(labels: Iterable[str]) -> set[str]:
    """Return the labels of a solid that are proper names.

    Empty labels, "NONE", counters such as "Face 12", and a label shared by all faces are not.
    """
    given = set(labels)
    if len(given) < 2:
        return set()
    counter = re.compile(r"(none|null|unnamed|face|surface|f)?[\W_]*\d*", re.IGNORECASE)
    return {label for label in given if not counter.fullmatch(label)}
