"""Read colours and labels of single faces in a STEP file, which become names.

Gmsh reads colours (``Geometry.OCCImportLabels``), but loses them when bodies are cut along each
other. So copies of marked faces are kept during the cut, and faces that coincide with a copy get
its mark.
"""

from collections.abc import Mapping, Sequence
from colorsys import rgb_to_hsv
from dataclasses import dataclass

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.parts import Part

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Mark:
    """A coloured or labelled face that is set aside as a copy.

    Attributes:
        body: Name of its body.
        colour: Its own colour if it differs from the body's; otherwise None.
        label: Its own label; empty without one.
        tag: Tag of the copy.
        names: Names of the physical groups of a script that contain it; its body is then empty.
    """

    body: str
    colour: Colour | None
    label: str
    tag: int
    names: tuple[str, ...] = ()


def word_of(colour: Colour) -> str:
    """Return the word for a colour."""
    hue, saturation, value = rgb_to_hsv(*(part / 255 for part in colour))
    pale, dark = 0.15, 0.1  # with less saturation or value, a colour has no visible hue
    if saturation < pale or value < dark:
        # Words for colours without a hue, by their value.
        greys = {"black": 0.0, "grey": 0.5, "white": 1.0}
        return min(greys, key=lambda word: abs(greys[word] - value))
    # Words for colours by their hue (degrees).
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
    """Return a colour as in HTML, such as "#dd5228"."""
    return "#" + "".join(f"{part:02x}" for part in colour)


def set_aside(parts: Sequence[Part], labels: Mapping[int, str]) -> list[Mark]:
    """Return copies of all faces with a label, or with a colour other than their body's.

    The colour of a body is that of most of its area, or none if some face has no colour.

    Args:
        parts: The bodies.
        labels: Labels of the labelled faces.
    """
    marks = []
    for part in parts:
        colours: dict[int, Colour | None] = {}
        for tag in part.tags:
            for face in gmsh.model.getAdjacencies(3, tag)[1]:
                red, green, blue, solid = gmsh.model.getColor(2, int(face))
                colours[int(face)] = (red, green, blue) if solid else None
        areas: dict[Colour | None, float] = {}
        if len(set(colours.values())) > 1:  # computing areas takes time
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
    """Return copies of OpenCASCADE's faces in physical groups of a script.

    Args:
        dim: Dimension of the faces.
        named: Faces by the names of their groups.
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
    """Return the marks of faces that coincide with marked copies, and remove the copies.

    Args:
        dim: Dimension of the faces.
        marks: Result of :func:`set_aside` or :func:`set_aside_named`.
        faces: The index of the body of each face.
        parts: The bodies.
    """
    found = {}
    boxes = {mark.tag: box(dim, [mark.tag]) for mark in marks}
    # A face closer to another one than this share of its size coincides with it.
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
    """Return a point inside a face, or the middle of its parameters if none is found."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(dim, face))
    if dim == 1:
        return np.asarray(gmsh.model.getValue(1, face, (low + high) / 2))
    # Shares of a face's parameters at which a point inside is sought.
    along = (0.5, 0.31, 0.67, 0.13, 0.86)
    places = [low + np.array([u, v]) * (high - low) for u in along for v in along]
    chosen = next((at for at in places if gmsh.model.isInside(2, face, at, True)), places[0])
    return np.asarray(gmsh.model.getValue(2, face, chosen))
