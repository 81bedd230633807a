"""Divide drawn ground by its lines, and write a gmsh script for the ground."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import place_of
from perfplast_fenicsx.geometry.part_names import LEFT, RIGHT
from perfplast_fenicsx.geometry.plane_arrangement import ROUNDING, Arrangement, arrange, within

SIDES = ("left", "base", "right", "surface")
"""Names of the parts of the outline, counterclockwise from the top left corner."""


@dataclass(frozen=True)
class Shape:
    """A region, an opening or a stratum as a closed polygon."""

    name: str
    corners: Floats
    opening: bool = False


@dataclass(frozen=True)
class Outline:
    """The ground divided by all its lines.

    Attributes:
        plan: Edges and faces.
        names: Names of the bodies.
        face_body: Index of the body of each face; -1 if the face belongs to no body.
        body: Indices of the bodies on the left and right of each edge, shape (num_edges, 2); -1 if
            there is no body.
        openings: Edges around each opening, by name of the opening.
        sides: Edges of each side of the ground, by name of the side.
        unnamed: Reason why the sides of the ground have no names; "" if they have names.
        first_line: Index of the first line among the owners of edges in ``plan``.
    """

    plan: Arrangement
    names: list[str]
    face_body: list[int]
    body: Longs
    openings: dict[str, list[int]]
    sides: dict[str, list[int]]
    unnamed: str
    first_line: int

    def edges_of(self, line: int) -> Longs:
        """Return the indices of the edges that lie on a line.

        Args:
            line: Index of the line.
        """
        return np.flatnonzero(self.plan.owners[:, self.first_line + line])

    @staticmethod
    def of(shapes: Sequence[Shape], chains: Sequence[Sequence[Floats]]) -> "Outline":
        """Return the outline of shapes, between which there are no overlaps and gaps.

        Args:
            shapes: Bodies and openings.
            chains: The polylines of each line, followed by the polylines of all kinks.
        """
        parts, owner = segments_of(shapes)
        for number, some in enumerate(chains, start=len(shapes)):
            for chain in some:
                parts.append(np.stack([chain[:-1], chain[1:]], axis=1))
                owner += [number] * (len(chain) - 1)
        plan = arrange(np.concatenate(parts), owner)
        missing = len(shapes) + len(chains) - plan.owners.shape[1]
        owners = np.pad(plan.owners, ((0, 0), (0, missing)))
        plan = Arrangement(plan.points, plan.edges, owners, plan.faces, plan.sides, plan.outer)
        solid = [k for k, one in enumerate(shapes) if not one.opening]
        inside = faces_inside(shapes, plan)
        cut = [inside[k] for k, one in enumerate(shapes) if one.opening]
        free = ~np.any(cut, axis=0) if cut else np.ones(len(plan.faces), dtype=bool)
        of_face = [-1] * len(plan.faces) + [-1]  # the last entry belongs to face -1, the outside
        for number, k in enumerate(solid):
            for face in np.flatnonzero(inside[k] & free):
                of_face[face] = number
        body = np.array(of_face)[plan.sides]
        hollow = [k for k, one in enumerate(shapes) if one.opening]
        around: dict[str, list[int]] = {}
        opening = np.zeros(len(plan.edges), dtype=bool)
        for k in hollow:
            within_it = np.append(inside[k], False)[plan.sides]
            edges = np.flatnonzero((within_it.sum(axis=1) == 1) & ((body >= 0).sum(axis=1) == 1))
            around[shapes[k].name] = [int(e) for e in edges]
            opening[edges] = True
        sides, unnamed = _sides(plan, body, opening)
        names = [shapes[k].name for k in solid]
        return Outline(plan, names, of_face[:-1], body, around, sides, unnamed, len(shapes))


def segments_of(shapes: Sequence[Shape]) -> tuple[list[Floats], list[int]]:
    """Return the sides of shapes without those of length 0, and the index of each side's shape."""
    parts, owner = list[Floats](), list[int]()
    for number, one in enumerate(shapes):
        sides = np.stack([one.corners, np.roll(one.corners, -1, axis=0)], axis=1)
        sides = sides[(sides[:, 0] != sides[:, 1]).any(axis=1)]
        parts.append(sides)
        owner += [number] * len(sides)
    return parts, owner


def faces_inside(shapes: Sequence[Shape], plan: Arrangement) -> npt.NDArray[np.bool_]:
    """Return flags of the faces that lie inside each polygon, shape (num_shapes, num_faces)."""
    points = np.array([face.point for face in plan.faces]).reshape(-1, 2)
    return np.array([within(one.corners, points) for one in shapes])


def _sides(
    plan: Arrangement, body: Longs, opening: npt.NDArray[np.bool_]
) -> tuple[dict[str, list[int]], str]:
    """Return the edges of each side of the ground, or the reason why sides have no names."""
    outer = np.flatnonzero(((body >= 0).sum(axis=1) == 1) & ~opening)
    leaving: dict[int, tuple[int, int]] = {}
    for edge in outer:
        a, b = plan.edges[edge] if body[edge, 0] >= 0 else plan.edges[edge][::-1]
        if int(a) in leaving:
            return {}, (
                "the sides of the ground have no names, because its outline touches itself at "
                f"{place_of(plan.points[a])}"
            )
        leaving[int(a)] = (int(b), int(edge))
    points = plan.points
    start = min(leaving, key=lambda at: (points[at, 0], -points[at, 1]))
    loop, edges, now = list[int](), list[int](), start
    while not loop or now != start:
        loop.append(now)
        now, edge = leaving[now]
        edges.append(edge)
    if len(loop) < len(leaving):
        return {}, "the sides of the ground have no names, because it has several parts"
    x = points[loop, 0]
    tolerance = ROUNDING * float(np.linalg.norm(np.ptp(points[loop], axis=0)))
    at_left, at_right = (np.abs(x - end) <= tolerance for end in (x.min(), x.max()))
    for word, on in (("left", at_left), ("right", at_right)):
        if int((on & ~np.roll(on, 1)).sum()) > 1:
            return {}, (
                f"the sides of the ground have no names, because its {word} end has several parts"
            )
    down, up = int(at_left.sum()) - 1, int(at_right.sum()) - 1
    to_right = int(np.argmax(at_right))
    ends = (0, down, to_right, to_right + up, len(loop))
    found = {
        name: edges[a:b] for name, a, b in zip(SIDES, ends[:-1], ends[1:], strict=True) if b > a
    }
    return found, ""


def script_of(outline: Outline, lines: Sequence[str], cracks: Mapping[str, Floats]) -> str:
    """Return a gmsh script that draws an outline with the built-in kernel.

    Args:
        outline: The outline.
        lines: Names of the lines, in order.
        cracks: Points of the lines that are open cracks inside a body, by name. The curves of a
            crack have the direction of its points, and two names.
    """
    plan = outline.plan
    turned = {
        int(edge)
        for number, name in enumerate(lines)
        if name in cracks
        for edge in outline.edges_of(number)
        if not _follows(plan.points[plan.edges[edge]], cracks[name])
    }
    solid = [k for k, of in enumerate(outline.face_body) if of >= 0]
    used = {abs(e) - 1 for k in solid for loop in plan.faces[k].loops for e in loop}
    used |= {e for k in solid for e in plan.faces[k].inside}
    text, loops = list[str](), 0
    for point in sorted({int(p) for e in used for p in plan.edges[e]}):
        x, y = (repr(float(value)) for value in plan.points[point])
        text.append(f"Point({point + 1}) = {{{x}, {y}, 0}};")
    for edge in sorted(used):
        a, b = (plan.edges[edge][::-1] if edge in turned else plan.edges[edge]) + 1
        text.append(f"Line({edge + 1}) = {{{a}, {b}}};")
    for k in solid:
        own = []
        for loop in plan.faces[k].loops:
            loops += 1
            own.append(str(loops))
            along = [-e if abs(e) - 1 in turned else e for e in loop]
            text.append(f"Curve Loop({loops}) = {{{', '.join(map(str, along))}}};")
        text.append(f"Plane Surface({k + 1}) = {{{', '.join(own)}}};")
    for k in solid:
        if plan.faces[k].inside:
            inside = ", ".join(str(e + 1) for e in plan.faces[k].inside)
            text.append(f"Curve {{{inside}}} In Surface {{{k + 1}}};")
    for number, name in enumerate(outline.names):
        own = [str(k + 1) for k in solid if outline.face_body[k] == number]
        text.append(f'Physical Surface("{name}") = {{{", ".join(own)}}};')
    named = {side: edges for side, edges in outline.sides.items() if side not in lines}
    named |= outline.openings
    for number, line in enumerate(lines):
        on = outline.edges_of(number)
        if line in cracks:
            named |= {f"{line}{end}": [int(e) for e in on] for end in (LEFT, RIGHT)}
            continue
        named[line] = [int(e) for e in on if outline.body[e, 0] != outline.body[e, 1]]
    for name, edges in named.items():
        if edges:
            curves = ", ".join(str(edge + 1) for edge in edges)
            text.append(f'Physical Curve("{name}") = {{{curves}}};')
    return "\n".join(text) + "\n"


def _follows(edge: Floats, chain: Floats) -> bool:
    """Return whether an edge on a polyline runs in the direction of the polyline.

    Args:
        edge: Ends of the edge, shape (2, 2).
        chain: Points of the polyline, shape (n, 2).
    """
    way = chain[1:] - chain[:-1]
    beyond = edge.mean(axis=0) - chain[:-1]
    shares = (np.einsum("si,si->s", beyond, way) / np.einsum("si,si->s", way, way)).clip(0, 1)
    nearest = int(np.argmin(np.linalg.norm(beyond - shares[:, None] * way, axis=1)))
    return bool((edge[1] - edge[0]) @ way[nearest] > 0)
