"""Mesh cylindrical joints with facets along the axis, so that bodies can slide along the axis.

Facets of an arbitrary mesh of a cylinder are oblique to its axis. Two bodies with such facets
interlock: without friction, they still resist sliding along the axis and rotation about it. Bodies
with facets along the axis resist only rotation.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import gmsh
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.geometry.free_faces import ALIKE, Cylinder, cylinder_of

TURN = 2 * math.pi


@dataclass(frozen=True)
class Side:
    """A curve that bounds a face on a cylinder: an arc around the axis, or a line along it.

    Attributes:
        around: Whether the curve is an arc.
        straight: Whether gmsh has the curve as a line, which may be a single element.
        low: Smallest angle and position along the axis.
        high: Largest angle and position along the axis.
    """

    around: bool
    straight: bool
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def length(self) -> float:
        """Angle of an arc, or length of a line."""
        number = 0 if self.around else 1
        return self.high[number] - self.low[number]


@dataclass(frozen=True)
class Sleeve:
    """Connected faces on one cylinder, each of which is a rectangle if the cylinder is unrolled.

    Attributes:
        on: The cylinder.
        faces: Curves around each face, by tag of the face.
        sides: The curves by tag.
    """

    on: Cylinder
    faces: dict[int, tuple[int, ...]]
    sides: dict[int, Side]

    def frame(self) -> tuple[Floats, Floats]:
        """Return the two unit vectors from which angles are measured."""
        return _frame(self.on)

    def point(self, angle: Floats, along: Floats) -> Floats:
        """Return the points of the cylinder at angles and positions along its axis."""
        first, second = self.frame()
        out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        return self.on.centre + abs(self.on.radius) * out + along[:, None] * self.on.axis


def _frame(on: Cylinder) -> tuple[Floats, Floats]:
    first = np.cross(on.axis, np.eye(3)[np.argmin(np.abs(on.axis))])
    first /= np.linalg.norm(first)
    return np.asarray(first, dtype=np.float64), np.asarray(np.cross(on.axis, first), np.float64)


def sleeves_of(faces: Iterable[int]) -> list[Sleeve]:
    """Return the sleeves that the cylindrical ones of some faces form.

    Args:
        faces: Tags of faces in gmsh's current model. Faces that are no rectangles when unrolled,
            such as those with a hole or an oblique end, belong to no sleeve.
    """
    cylinders, sides = dict[int, Cylinder](), dict[int, dict[int, Side]]()
    for face in dict.fromkeys(faces):
        on = cylinder_of(2, face)
        found = None if on is None else _rectangle(face, on)
        if on is not None and found:
            cylinders[face], sides[face] = on, found
    tags = list(sides)
    curves = {curve: k for k, curve in enumerate({c for some in sides.values() for c in some})}
    pairs = [(k, len(tags) + curves[c]) for k, tag in enumerate(tags) for c in sides[tag]]
    graph = coo_array(
        (np.ones(len(pairs)), np.reshape(pairs, (-1, 2)).T), shape=(len(tags) + len(curves),) * 2
    )
    labels = connected_components(graph, directed=False)[1][: len(tags)]
    sleeves = []
    for label in dict.fromkeys(labels):
        own = [tag for tag, of in zip(tags, labels, strict=True) if of == label]
        on = cylinders[own[0]]
        if all(_coincide(on, cylinders[face]) for face in own[1:]):
            # all angles are measured in the frame of the first face
            again = [_rectangle(face, on) or {} for face in own]
            together = {curve: side for some in again for curve, side in some.items()}
            if all(again):
                sleeves.append(Sleeve(on, dict(zip(own, map(tuple, again), strict=True)), together))
    return sleeves


def _coincide(one: Cylinder, other: Cylinder) -> bool:
    """Return whether two cylinders are the same; the sides of their material may differ."""
    near = 10 * ALIKE * abs(one.radius)
    apart = np.linalg.norm(np.cross(one.centre - other.centre, one.axis))
    turned = np.linalg.norm(np.cross(one.axis, other.axis))
    return bool(
        abs(abs(one.radius) - abs(other.radius)) <= near and apart <= near and turned <= 10 * ALIKE
    )


def _rectangle(face: int, on: Cylinder) -> dict[int, Side] | None:
    """Return the curves around a face by tag, or None if they form no rectangle when unrolled."""
    radius, near = abs(on.radius), 10 * ALIKE
    sides = dict[int, Side]()
    for curve in map(int, gmsh.model.getAdjacencies(2, face)[1]):
        side = _side(curve, on)
        if side is None:
            return None
        sides[curve] = side
    arcs = [side for side in sides.values() if side.around]
    lines = [side for side in sides.values() if not side.around]
    if not arcs or not lines:
        return None
    low, high = (pick(side.low[1] for side in arcs) for pick in (min, max))
    turns = [
        sum(s.length for s in arcs if abs(s.low[1] - end) <= near * radius) for end in (low, high)
    ]
    angles = np.unique(np.round(np.mod([side.low[0] for side in lines], TURN) / near))
    count = 1 if abs(turns[0] - TURN) <= near else 2
    long = sum(side.length for side in lines) - count * (high - low)
    whole = abs(sum(turns) - sum(side.length for side in arcs)) <= near
    if not whole or abs(turns[0] - turns[1]) > near or abs(long) > near * radius:
        return None
    return sides if high - low > near * radius and len(angles) <= 2 * count else None


def _side(curve: int, on: Cylinder) -> Side | None:
    """Return a curve on a cylinder as an arc or a line, or None if it is neither."""
    low, high = (float(end[0]) for end in gmsh.model.getParametrizationBounds(1, curve))
    many = 33  # samples of the curve, close enough to unroll their angles
    points = np.reshape(gmsh.model.getValue(1, curve, np.linspace(low, high, many)), (-1, 3))
    first, second = _frame(on)
    out = points - on.centre
    angle = np.unwrap(np.arctan2(out @ second, out @ first))
    along = out @ on.axis
    near, radius = 10 * ALIKE, abs(on.radius)
    ends = ((float(angle.min()), float(along.min())), (float(angle.max()), float(along.max())))
    if np.ptp(along) <= near * radius:
        return Side(True, False, *ends)
    straight = gmsh.model.getType(1, curve) == "Line"
    return Side(False, straight, *ends) if np.ptp(angle) <= near else None


@dataclass(frozen=True)
class Grid:
    """Nodes of a sleeve, at the intersections of circles around it with lines along it.

    Attributes:
        angles: Angles of the lines, increasing, from 0 to less than a full turn.
        along: Positions of the circles along the axis, increasing.
    """

    angles: Floats
    along: Floats

    def column(self, angle: float) -> int:
        """Return the number of the line at an angle."""
        apart = np.abs(np.mod(self.angles - angle + math.pi, TURN) - math.pi)
        return int(np.argmin(apart))

    def row(self, along: float) -> int:
        """Return the number of the circle at a position along the axis."""
        return int(np.argmin(np.abs(self.along - along)))

    def columns(self, side: Side) -> list[int]:
        """Return the numbers of the lines that meet an arc, in the order of their angles."""
        first, last = self.column(side.low[0]), self.column(side.high[0])
        steps = (last - first) % len(self.angles) or len(self.angles)
        return [(first + k) % len(self.angles) for k in range(steps + 1)]


def grid_of(sleeve: Sleeve, counts: dict[int, int]) -> Grid | None:
    """Return the nodes of a sleeve, or None if its facets would be very unequal or if none exist.

    Args:
        sleeve: The sleeve.
        counts: Number of elements that each curve needs.
    """
    if not min(counts.values(), default=0):
        return None
    arcs = [(sleeve.sides[c], n) for c, n in counts.items() if sleeve.sides[c].around]
    lines = [(sleeve.sides[c], n) for c, n in counts.items() if not sleeve.sides[c].around]
    near = 10 * ALIKE
    ends = [angle for side, _ in arcs for angle in (side.low[0], side.high[0])]
    ends += [side.low[0] for side, _ in lines]
    angles = _distinct(np.mod(ends, TURN), near)
    if len(angles) > 1 and angles[0] + TURN - angles[-1] <= near:
        angles = angles[:-1]
    after = np.append(angles[1:], angles[0] + TURN)
    steps = after - angles
    middles = (angles + after) / 2
    densest = np.zeros(len(angles))
    for side, n in arcs:
        inside = np.mod(middles - side.low[0], TURN) < side.length
        densest[inside] = np.maximum(densest[inside], n / side.length)
    pieces = np.maximum(np.ceil(steps * densest * (1 - near)), 1).astype(int)
    unequal = 0.2  # smallest ratio of two angles between neighbouring lines
    covered = (steps / pieces)[densest > 0]
    if covered.min() < unequal * covered.max() or covered.max() > TURN / 3:
        return None
    chord = abs(sleeve.on.radius) * float(covered.max())
    longest = 2.0  # largest ratio of a facet's sides
    levels = [along for side, _ in [*arcs, *lines] for along in (side.low[1], side.high[1])]
    along = _distinct(np.array(levels), near * abs(sleeve.on.radius))
    heights, middles = np.diff(along), (along[:-1] + along[1:]) / 2
    closest = np.full(len(heights), 1 / (longest * chord))
    for side, n in lines:
        inside = (side.low[1] < middles) & (middles < side.high[1])
        # gmsh divides each spline at least once, even a short straight one
        dense = n / side.length if n > 2 or side.straight else 0.0
        closest[inside] = np.maximum(closest[inside], dense)
    rows = np.ceil(heights * closest * (1 - near)).astype(int)
    return Grid(_divided(np.append(angles, angles[0] + TURN), pieces)[:-1], _divided(along, rows))


def _distinct(values: Floats, near: float) -> Floats:
    """Return sorted values without those that nearly equal their predecessor."""
    found = np.sort(values)
    return np.asarray(found[np.append(True, np.diff(found) > near)])


def _divided(ends: Floats, pieces: npt.NDArray[np.int_]) -> Floats:
    """Return points that divide each interval between ``ends`` into equal pieces."""
    parts = [
        low + (high - low) * np.arange(count) / count
        for low, high, count in zip(ends[:-1], ends[1:], pieces, strict=True)
    ]
    return np.concatenate([*parts, ends[-1:]])


def mesh_sleeves(sleeves: Sequence[Sleeve]) -> None:
    """Mesh all curves of gmsh's current model, and the faces of sleeves.

    If gmsh then meshes only entities without elements, it keeps these facets.

    Args:
        sleeves: The sleeves; gmsh's sizes determine the number of their facets.
    """
    gmsh.model.mesh.generate(1)
    for sleeve in sleeves:
        counts = {
            curve: sum(len(tags) for tags in gmsh.model.mesh.getElements(1, curve)[1])
            for curve in sleeve.sides
        }
        grid = grid_of(sleeve, counts)
        if grid is not None:
            _Nodes(sleeve, grid).add()


class _Nodes:
    """Adds the nodes and elements of a sleeve to gmsh's current mesh."""

    def __init__(self, sleeve: Sleeve, grid: Grid) -> None:
        self.sleeve, self.grid = sleeve, grid
        self.tags = dict[tuple[int, int], int]()
        self.next = int(gmsh.model.mesh.getMaxNodeTag()) + 1

    def add(self) -> None:
        """Replace the meshes of the curves, and mesh the faces."""
        gmsh.model.mesh.clear([(1, curve) for curve in self.sleeve.sides])
        for curve, side in self.sleeve.sides.items():
            self._curve(curve, side)
        for face, curves in self.sleeve.faces.items():
            self._face(face, [self.sleeve.sides[curve] for curve in curves])

    def _places(self, columns: Sequence[int], rows: Sequence[int]) -> list[tuple[int, int]]:
        return [(column, row) for row in rows for column in columns]

    def _new(self, dim: int, tag: int, places: Sequence[tuple[int, int]]) -> None:
        """Add nodes in a curve or face, at places without a node."""
        places = [place for place in dict.fromkeys(places) if place not in self.tags]
        if not places:
            return
        columns, rows = np.transpose(places)
        points = self.sleeve.point(self.grid.angles[columns], self.grid.along[rows])
        own = range(self.next, self.next + len(places))
        self.next += len(places)
        self.tags.update(zip(places, own, strict=True))
        parameters = gmsh.model.getParametrization(dim, tag, points.ravel())
        gmsh.model.mesh.addNodes(dim, tag, list(own), points.ravel(), parameters)

    def _curve(self, curve: int, side: Side) -> None:
        if side.around:
            places = self._places(self.grid.columns(side), [self.grid.row(side.low[1])])
        else:
            first, last = self.grid.row(side.low[1]), self.grid.row(side.high[1])
            places = self._places([self.grid.column(side.low[0])], range(first, last + 1))
        for _, vertex in gmsh.model.getBoundary([(1, curve)], combined=False):
            self._vertex(vertex, places)
        self._new(1, curve, places)
        nodes = np.array([self.tags[place] for place in places])
        middle = self.sleeve.point(
            self.grid.angles[[places[0][0]]], self.grid.along[[places[0][1]]]
        )
        if places[0] != places[-1]:
            bounds = gmsh.model.getParametrizationBounds(1, curve)
            begin = np.array(gmsh.model.getValue(1, curve, bounds[0]))
            end = np.array(gmsh.model.getValue(1, curve, bounds[1]))
            backwards = np.linalg.norm(begin - middle[0]) > np.linalg.norm(end - middle[0])
        else:
            ends = gmsh.model.getParametrization(
                1, curve, self.sleeve.point(*self._first_two(places)).ravel()
            )
            backwards = ends[0] > ends[1]
        if backwards:
            nodes = nodes[::-1]
        lines = np.column_stack([nodes[:-1], nodes[1:]])
        gmsh.model.mesh.addElementsByType(curve, 1, [], lines.ravel())

    def _first_two(self, places: Sequence[tuple[int, int]]) -> tuple[Floats, Floats]:
        columns, rows = np.transpose(places[1:3])
        return self.grid.angles[columns], self.grid.along[rows]

    def _vertex(self, vertex: int, places: Sequence[tuple[int, int]]) -> None:
        """Move the node at an end of a curve onto the grid, by a rounding error."""
        point = np.array(gmsh.model.getValue(0, vertex, []))
        ends = [places[0], places[-1]]
        columns, rows = np.transpose(ends)
        exact = self.sleeve.point(self.grid.angles[columns], self.grid.along[rows])
        place = int(np.argmin(np.linalg.norm(exact - point, axis=1)))
        (node,), _, _ = gmsh.model.mesh.getNodes(0, vertex)
        self.tags[ends[place]] = int(node)
        gmsh.model.mesh.setNode(int(node), exact[place], [])

    def _face(self, face: int, sides: Sequence[Side]) -> None:
        arcs = [side for side in sides if side.around]
        low, high = (pick(side.low[1] for side in arcs) for pick in (min, max))
        rows = range(self.grid.row(low), self.grid.row(high) + 1)
        lower = [side for side in arcs if self.grid.row(side.low[1]) == rows[0]]
        columns = self._in_order(lower)
        self._new(2, face, self._places(columns, rows))
        grid = np.array([[self.tags[column, row] for column in columns] for row in rows])
        a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
        triangles: Longs = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
        middle = np.mean(gmsh.model.getParametrizationBounds(2, face), axis=0)
        out = np.array(gmsh.model.getValue(2, face, middle)) - self.sleeve.on.centre
        out -= (out @ self.sleeve.on.axis) * self.sleeve.on.axis
        if np.array(gmsh.model.getNormal(face, middle)) @ out < 0:
            triangles = triangles[:, [0, 2, 1]]
        gmsh.model.mesh.addElementsByType(face, 2, [], triangles.ravel())

    def _in_order(self, arcs: Sequence[Side]) -> list[int]:
        """Return the numbers of the lines that meet consecutive arcs, in the order of angles."""
        following = {self.grid.column(arc.low[0]): arc for arc in arcs}
        ends = {self.grid.column(arc.high[0]) for arc in arcs}
        start = next((first for first in following if first not in ends), next(iter(following)))
        columns = [start]
        for _ in arcs:
            columns += self.grid.columns(following[columns[-1]])[1:]
        return columns
