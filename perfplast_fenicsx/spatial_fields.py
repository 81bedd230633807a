"""Numbers that vary in space: formulas, tables over depth, and values at scattered points.

A strength that varies is taken as it is where a value at a point is asked for. Strict bounds need
linear functions in each cell, one that is nowhere above the field and one that is nowhere below it
(:meth:`SpatialField.between`). Both are the field itself where that is linear in the cell.
"""

import csv
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.enclosures import ROUNDING, Pair, enclosed
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.formulas import check, evaluate
from perfplast_fenicsx.vtu_points import read_vtu_points


@dataclass(frozen=True, kw_only=True)
class SpatialField:
    """The base of numbers that vary in space: a profile times a number.

    Args:
        scale: The number that the profile is multiplied by.
    """

    scale: float = 1.0

    @property
    def profile(self) -> Self:
        """Return the field whose scale is 1."""
        return replace(self, scale=1.0)

    def __mul__(self, factor: float) -> Self:
        return replace(self, scale=self.scale * factor)

    def __rmul__(self, factor: float) -> Self:
        return self * factor

    def __truediv__(self, divisor: float) -> Self:
        return replace(self, scale=self.scale / divisor)

    def __format__(self, spec: str) -> str:
        words = self.in_words()
        return words if self.scale == 1 else f"{self.scale:{spec or '.6g'}} times ({words})"

    def at(self, x: Floats, place: str) -> Floats:
        """Return the values at points. Not collective.

        Args:
            x: Coordinates, shape (n, d).
            place: What has the field, for messages.

        Returns:
            Shape (n,).

        Raises:
            InputError: If the field has no finite value at a point.
        """
        return self.scale * self._at(x, place)

    def between(self, corners: Floats, place: str) -> Pair:
        """Return linear functions below and above the field in simplices. Not collective.

        Args:
            corners: Vertices of the simplices, shape (n, k, d).
            place: What has the field, for messages.

        Returns:
            Values at the vertices of both functions, each of shape (n, k). The arrays are equal
            where the field is linear in the simplex.

        Raises:
            InputError: If such functions are not known.
        """
        low, high = self._between(corners, place)
        both = self.scale * low, self.scale * high
        return both if self.scale >= 0 else (both[1], both[0])

    def in_words(self) -> str:
        """Return a description of the field in a few words."""
        raise NotImplementedError

    def _at(self, x: Floats, place: str) -> Floats:
        raise NotImplementedError

    def _between(self, corners: Floats, place: str) -> Pair:
        raise NotImplementedError


if TYPE_CHECKING:
    # Arithmetic is alike for both kinds, and most users of a number know that it is one.
    Strength: TypeAlias = Any
else:
    Strength = float | SpatialField
"""A number of a material that may vary in space."""


@dataclass(frozen=True)
class Formula(SpatialField):
    """A formula in the coordinates.

    Args:
        text: Such as ``"20 + 1.5*(12 - y)"``, with x, y, z, pi and NumPy's functions.
        scale: The number that it is multiplied by.

    Raises:
        InputError: If the formula has anything else in it.
    """

    text: str

    def __post_init__(self) -> None:
        check(" ".join(self.text.split()), "the formula")

    def in_words(self) -> str:
        """Return the formula."""
        return self.text

    def _at(self, x: Floats, place: str) -> Floats:
        return evaluate(self.text, np.pad(x, ((0, 0), (0, 3 - x.shape[1]))), place)

    def _between(self, corners: Floats, place: str) -> Pair:
        found = enclosed(self.text, corners, place)
        if found is None:
            raise InputError(
                f"{place}: strict bounds need linear functions below and above the formula"
                f" '{self.text}' in each cell. They are known of sums, products, abs, minimum,"
                " maximum and where; give such a formula, or a table of [coordinate, value] pairs."
            )
        return found


@dataclass(frozen=True)
class DepthTable(SpatialField):
    """Values at some heights, linear between them.

    Args:
        rows: Pairs of the vertical coordinate and the value, at least two. The coordinate is y in
            the plane and z in space.
        scale: The number that the values are multiplied by.

    Raises:
        InputError: If there are fewer than two pairs, a number is not finite, or two pairs have
            the same coordinate.
    """

    rows: Sequence[tuple[float, float]]

    def __post_init__(self) -> None:
        table = np.array([list(row) for row in self.rows], dtype=np.float64)
        if table.ndim != 2 or table.shape[0] < 2 or table.shape[1] != 2:
            raise InputError(
                "a table over depth needs at least two pairs of the vertical coordinate and the"
                " value, such as [[0.0, 30.0], [10.0, 20.0]]."
            )
        if not np.isfinite(table).all():
            raise InputError("a table over depth has an entry that is not finite; give numbers.")
        table = table[np.argsort(table[:, 0], kind="stable")]
        same = np.flatnonzero(np.diff(table[:, 0]) == 0)
        if len(same):
            raise InputError(
                f"a table over depth has two values at the coordinate {table[same[0], 0]:g}; give"
                " one there, or a body to each layer where the value jumps."
            )
        rows = tuple((float(height), float(value)) for height, value in table)
        object.__setattr__(self, "rows", rows)

    @property
    def heights(self) -> Floats:
        """Return the coordinates, sorted."""
        return np.array(self.rows)[:, 0]

    def in_words(self) -> str:
        """Return how many values there are, and from where to where."""
        (low, first), *_, (high, last) = self.rows
        return f"table of {len(self.rows)} values, {first:g} at {low:g} to {last:g} at {high:g}"

    def _at(self, x: Floats, place: str) -> Floats:
        heights, values = np.array(self.rows).T
        s, reach = x[:, -1], ROUNDING * np.abs(heights).max()
        outside = (s < heights[0] - reach) | (s > heights[-1] + reach)
        if outside.any():
            where = place_of(x[np.argmax(outside)])
            raise InputError(
                f"{place}: the table over depth goes from {heights[0]:g} to {heights[-1]:g}, and"
                f" there is material at {where}; give values for all of its depth."
            )
        return np.interp(s, heights, values)

    def _between(self, corners: Floats, place: str) -> Pair:
        s = corners[..., -1]
        values = self._at(corners.reshape(-1, corners.shape[2]), place).reshape(s.shape)
        first, last = s.min(axis=1), s.max(axis=1)
        ends = [np.take_along_axis(values, at(s, axis=1)[:, None], 1)[:, 0] for at in _ENDS]
        slope = (ends[1] - ends[0]) / (last - first)
        kinks, at_kinks = np.array(self.rows).T
        inside = (kinks > first[:, None]) & (kinks < last[:, None])
        above = np.where(inside, at_kinks - ends[0][:, None], 0.0)
        above -= np.where(inside, slope[:, None] * (kinks - first[:, None]), 0.0)
        little = ROUNDING * np.abs(values).max(axis=1, keepdims=True)
        above[np.abs(above) <= little] = 0.0
        chord = np.where((above == 0).all(axis=1)[:, None], values, 0.0)
        bent = (above != 0).any(axis=1)
        chord[bent] = (ends[0][:, None] + slope[:, None] * (s - first[:, None]))[bent]
        return (
            chord + np.minimum(above.min(axis=1), 0.0)[:, None],
            chord + np.maximum(above.max(axis=1), 0.0)[:, None],
        )


_ENDS = (np.argmin, np.argmax)

OUTSIDE = 1e-9
"""Barycentric coordinate below zero that counts as none, which rounding may be."""

PLACES_AT_ONCE = 2000
"""Places that are looked for together, for the memory."""


class Triangulation:
    """Points of a file, the values there, and triangles or tetrahedra between them.

    Attributes:
        name: Of the file, for messages.
        values: Shape (num_points,).
        simplices: Points of each, shape (num_simplices, d + 1).
        corners: Their coordinates, shape (num_simplices, d + 1, d).
        digest: SHA-256 of points, values and the simplices of the file.
    """

    def __init__(
        self, name: str, points: Floats, values: Floats, cells: Longs | None = None
    ) -> None:
        """Take the triangles of a file, or those of Delaunay.

        Args:
            name: Of the file.
            points: Shape (num_points, d), d = 2 or 3.
            values: Shape (num_points,).
            cells: Points of the triangles or tetrahedra of the file, shape (num_cells, d + 1); none
                if there are only points.

        Raises:
            InputError: If the points span no area, two of them are the same, or cells of the file
                have no area or overlap.
        """
        self.name, self.values = name, values
        told = b"" if cells is None else cells.astype(np.int64).tobytes()
        self.digest = hashlib.sha256(points.tobytes() + values.tobytes() + told).hexdigest()
        self._net: Any = None
        self.simplices: Longs
        self.corners: Floats
        if cells is None:
            self._by_delaunay(points)
        else:
            self.simplices, self.corners = cells, points[cells]
            self._check_cells()

    def _by_delaunay(self, points: Floats) -> None:
        """Triangulate the points.

        Raises:
            InputError: As the constructor.
        """
        from scipy.spatial import Delaunay, QhullError  # takes a while, and few cases need it

        try:
            self._net = net = Delaunay(points)
        except (QhullError, ValueError) as error:
            raise InputError(
                f"the {len(points)} points of '{self.name}' span no area (in space no volume), so"
                " that nothing is known between them; give points all around the body."
            ) from error
        if len(net.coplanar):
            where = place_of(points[net.coplanar[0, 0]])
            raise InputError(f"'{self.name}' has the point {where} twice; give one value there.")
        x: Floats = points[net.simplices]
        thin = 1e-12  # of a flat simplex at the hull, relative to its size
        size = np.ptp(x, axis=1).max(axis=1) ** points.shape[1]
        kept = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) > thin * size
        self.simplices = net.simplices[kept].astype(np.int64)
        self.corners = x[kept]

    def _check_cells(self) -> None:
        """Refuse cells of a file that have no area or overlap, and points that are there twice.

        Raises:
            InputError: Naming the place of the first one.
        """
        middles = self.corners.mean(axis=1)
        size = np.ptp(self.corners, axis=1).max(axis=1) ** middles.shape[1]
        edges = self.corners[:, 1:] - self.corners[:, :1]
        flat = np.abs(np.linalg.det(edges)) <= 1e-12 * size
        if flat.any():
            where = place_of(middles[np.argmax(flat)])
            raise InputError(f"'{self.name}' has a cell without area at {where}; leave it out.")
        d = middles.shape[1]
        near_sides = np.full((d + 1, d + 1), 0.9 / d)
        np.fill_diagonal(near_sides, 0.1)
        inside = np.einsum("sv,cvi->csi", near_sides, self.corners).reshape(-1, d)
        places, _, shares = self._candidates(inside)
        around = np.bincount(places[(shares > OUTSIDE).all(axis=1)], minlength=len(inside))
        if (around > 1).any():
            where = place_of(inside[np.argmax(around > 1)])
            raise InputError(
                f"'{self.name}' has cells that overlap at {where}, so that its values there are not"
                " known; correct its mesh."
            )
        used = np.unique(self.simplices)
        x = np.zeros((len(self.values), middles.shape[1]))
        x[self.simplices.ravel()] = self.corners.reshape(-1, middles.shape[1])
        _, first, inverse = np.unique(x[used], axis=0, return_index=True, return_inverse=True)
        apart = self.values[used] != self.values[used][first[inverse.ravel()]]
        if apart.any():
            where = place_of(x[used[np.argmax(apart)]])
            raise InputError(
                f"'{self.name}' has two values at the point {where}, where its field jumps; give"
                " one there, and a body to each side of the jump."
            )

    def _candidates(self, x: Floats) -> tuple[Longs, Longs, Floats]:
        """Return pairs of places and simplices whose boxes have them, with barycentric coordinates.

        Args:
            x: Places, shape (n, d).

        Returns:
            Number of the place and of the simplex of each pair, shape (num_pairs,), and shares of
            the simplex's vertices, shape (num_pairs, d + 1).
        """
        from scipy.spatial import cKDTree  # takes a while, and few cases need it

        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        middles = (low + high) / 2
        reach = np.linalg.norm(high - low, axis=1).max() / 2 * (1 + 1e-6)
        near = cKDTree(middles).query_ball_point(x, reach)
        places = np.repeat(np.arange(len(x)), [len(one) for one in near])
        each = [np.array(one, dtype=np.int64) for one in near]
        simplices = np.concatenate([np.zeros(0, dtype=np.int64), *each])
        little = OUTSIDE * (high - low)[simplices].max(axis=1, keepdims=True)
        inside = (x[places] >= low[simplices] - little) & (x[places] <= high[simplices] + little)
        kept = inside.all(axis=1)
        places, simplices = places[kept], simplices[kept]
        corners = self.corners[simplices]
        sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        shares = np.linalg.solve(sides, (x[places] - corners[:, 0])[..., None])[..., 0]
        return places, simplices, np.column_stack([1 - shares.sum(axis=1), shares])

    def at(self, x: Floats, place: str) -> Floats:
        """Return the values at places, linear between the points.

        Raises:
            InputError: If a place is in none of the simplices.
        """
        if x.shape[1] != self.corners.shape[2]:
            raise InputError(
                f"{place}: '{self.name}' has points in {self.corners.shape[2]} dimensions, and the"
                f" body has {x.shape[1]}; give points in as many."
            )
        vertices, shares = self._in_net(x) if self._net is not None else self._in_cells(x)
        outside = shares.min(axis=1) < -OUTSIDE
        if outside.any():
            where = place_of(x[np.argmax(outside)])
            raise InputError(
                f"{place}: there is material at {where}, outside of the points of '{self.name}';"
                " give points all around the body."
            )
        return np.asarray(np.einsum("ni,ni->n", shares, self.values[vertices]))

    def _in_net(self, x: Floats) -> tuple[Longs, Floats]:
        """Return the vertices of Delaunay's simplex at each place, and its barycentric coordinates.

        Those of a place outside are -1.
        """
        found, d = self._net.find_simplex(x, tol=OUTSIDE), x.shape[1]
        maps = self._net.transform[found]
        shares = np.einsum("nij,nj->ni", maps[:, :d], x - maps[:, d])
        shares = np.column_stack([shares, 1 - shares.sum(axis=1)])
        return self._net.simplices[found], np.where((found < 0)[:, None], -1.0, shares)

    def _in_cells(self, x: Floats) -> tuple[Longs, Floats]:
        """Return the same of the cells of a file."""
        found = np.zeros(len(x), dtype=np.int64)
        shares = np.full((len(x), x.shape[1] + 1), -1.0)
        for some in np.array_split(np.arange(len(x)), len(x) // PLACES_AT_ONCE + 1):
            places, simplices, given = self._candidates(x[some])
            order = np.lexsort((given.min(axis=1), places))  # the last one of a place is its own
            found[some[places[order]]] = simplices[order]
            shares[some[places[order]]] = given[order]
        return self.simplices[found], shares

    def deviations(self, corners: Floats, chords: Floats) -> Pair:
        """Return by how much the values are below and above linear functions in simplices, at most.

        Args:
            corners: Vertices of the simplices, shape (n, d + 1, d).
            chords: Values of the linear functions there, shape (n, d + 1).

        Returns:
            The least difference (zero or negative) and the largest one, each of shape (n,).
        """
        least, most = np.zeros((2, len(corners)))
        boxes = [(x.min(axis=1), x.max(axis=1)) for x in (corners, self.corners)]
        (low, high), (others_low, others_high) = boxes
        at_once = 200  # simplices whose neighbours are looked for together, for the memory
        for some in np.array_split(np.arange(len(corners)), len(corners) // at_once + 1):
            apart = (low[some, None] > others_high).any(axis=2)
            apart |= (high[some, None] < others_low).any(axis=2)
            a, b = np.nonzero(~apart)
            a = some[a]
            first, second, there = _overlap_ends(corners[a], self.corners[b])
            above = np.einsum("pev,pv->pe", second, self.values[self.simplices[b]])
            above -= np.einsum("pev,pv->pe", first, chords[a])
            above = np.where(there, above, 0.0)
            np.minimum.at(least, a, above.min(axis=1))
            np.maximum.at(most, a, above.max(axis=1))
        return least, most


def _overlap_ends(ones: Floats, others: Floats) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return barycentric coordinates of places whose convex hull is the overlap of two simplices.

    They are the ends of the part of each edge of the one that lies in the other, and the other way
    round. Every vertex of the overlap is such an end.

    Args:
        ones: Vertices of simplices, shape (num_pairs, d + 1, d).
        others: Vertices of the simplices beside them, of the same shape.

    Returns:
        Coordinates in both simplices, each of shape (num_pairs, n, d + 1), and which places there
        are.
    """
    rounding, count = 1e-9, ones.shape[1]  # of barycentric coordinates
    pairs = np.array(list(combinations(range(count), 2)))
    own = np.eye(count)
    found: list[tuple[Floats, Floats]] = []
    inside = []
    for x, y, swapped in ((ones, others, False), (others, ones, True)):
        inverse = np.linalg.inv(y[:, 1:] - y[:, :1])
        shares = (x - y[:, :1]) @ inverse  # of the vertices of x in y
        shares = np.concatenate([1 - shares.sum(axis=2, keepdims=True), shares], axis=2)
        start, rates = shares[:, pairs[:, 0]], shares[:, pairs[:, 1]] - shares[:, pairs[:, 0]]
        enters, leaves = rates > rounding, rates < -rounding
        cuts = np.divide(-start, rates, out=np.zeros_like(rates), where=enters | leaves)
        first = np.maximum(np.where(enters, cuts, 0.0).max(axis=2), 0.0)
        last = np.minimum(np.where(leaves, cuts, 1.0).min(axis=2), 1.0)
        beside = (~enters & ~leaves & (start < -rounding)).any(axis=2)
        for at in (first, last):
            here = own[pairs[:, 0]] + at[..., None] * (own[pairs[:, 1]] - own[pairs[:, 0]])
            there = start + at[..., None] * rates
            found.append((there, here) if swapped else (here, there))
            inside.append((first <= last + rounding) & ~beside)
    firsts, seconds = zip(*found, strict=True)
    return np.hstack(firsts), np.hstack(seconds), np.hstack(inside)


@dataclass(frozen=True)
class PointValues(SpatialField):
    """Values at points of a file, linear in triangles or tetrahedra between them.

    Args:
        net: The points, the values, and the triangles.
        scale: The number that the values are multiplied by.
    """

    net: Triangulation

    def in_words(self) -> str:
        """Return the file, and how many values it has."""
        return f"{len(self.net.values)} values of '{self.net.name}', linear between them"

    def _at(self, x: Floats, place: str) -> Floats:
        return self.net.at(x, place)

    def _between(self, corners: Floats, place: str) -> Pair:
        flat = self._at(corners.reshape(-1, corners.shape[2]), place)
        chords = flat.reshape(corners.shape[:2])
        least, most = self.net.deviations(corners, chords)
        little = ROUNDING * np.abs(chords).max(axis=1)
        least = np.where(-least <= little, 0.0, least)
        most = np.where(most <= little, 0.0, most)
        return chords + least[:, None], chords + most[:, None]


def read_points(path: Path, column: str) -> PointValues:
    """Return the field of a CSV file of points.

    Args:
        path: A file whose first line names its columns: x, y, in space z, and values.
        column: Name of the column of the values.

    Raises:
        InputError: If the file cannot be read, a column is missing, or an entry is no number.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"'{path.name}' cannot be read ({error}); give a CSV file.") from error
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines) if row]
    names = rows[0] if rows else []
    for name in ("x", "y", column):
        if name not in names:
            raise InputError(
                f"'{path.name}' has no column '{name}' in its first line; name the coordinates x"
                " and y (and z in space) there, and the values as the case file does."
            )
    wanted = [*(name for name in "xyz" if name in names), column]
    numbers = np.empty((len(rows) - 1, len(wanted)))
    for line, row in enumerate(rows[1:]):
        try:
            numbers[line] = [float(row[names.index(name)]) for name in wanted]
        except (ValueError, IndexError) as error:
            raise InputError(
                f"'{path.name}': row {line + 2} has no number in one of the columns"
                f" {', '.join(wanted)}; give one in each."
            ) from error
    if not np.isfinite(numbers).all():
        raise InputError(f"'{path.name}' has an entry that is not finite; give numbers.")
    return PointValues(Triangulation(path.name, numbers[:, :-1], numbers[:, -1]))


def read_vtu(path: Path, name: str) -> PointValues:
    """Return the field of an array at the points of a ``.vtu`` file, linear in its cells.

    Args:
        path: The file.
        name: Of the array.

    Raises:
        InputError: If the file cannot be read, has no such array, or its cells overlap, have no
            area, are not simplices, or (triangles) are not in a plane z = constant.
    """
    found = read_vtu_points(path, name)
    points = found.points
    if not (np.isfinite(points).all() and np.isfinite(found.values).all()):
        raise InputError(f"'{path.name}' has an entry that is not finite; give numbers.")
    if found.cells.shape[1] == 3:
        if np.ptp(points[found.cells, 2]) > 1e-9 * np.ptp(points):
            raise InputError(
                f"'{path.name}' has triangles that are not in a plane z = constant; give a mesh in"
                " the plane, or tetrahedra."
            )
        points = np.ascontiguousarray(points[:, :2])
    return PointValues(Triangulation(path.name, points, found.values, found.cells))


def spatial_field(value: object, folder: Path) -> SpatialField:
    """Return the field that a case file gives.

    Args:
        value: A formula, a list of pairs, or a table with a file and the column of its values. The
            column of a .vtu file is an array at its points.
        folder: Where files are, if their paths are relative.

    Raises:
        InputError: If it is neither, or not a field.
    """
    if isinstance(value, SpatialField):
        return value
    if isinstance(value, str):
        return Formula(value)
    if isinstance(value, dict) and set(value) == {"file", "column"}:
        file, column = value["file"], value["column"]
        if isinstance(file, str) and isinstance(column, str):
            by_cells = file.lower().endswith(".vtu")
            return (
                read_vtu(folder / file, column) if by_cells else read_points(folder / file, column)
            )
    if isinstance(value, Sequence) and all(_is_pair(row) for row in value):
        return DepthTable(tuple((float(row[0]), float(row[1])) for row in value))
    raise InputError(
        'it is no number, formula such as "20 + 1.5*(12 - y)", table of [coordinate, value] pairs'
        ' such as [[0.0, 30.0], [10.0, 20.0]], or .csv or .vtu file such as { file = "points.csv",'
        ' column = "c" }; give one of them.'
    )


def _is_pair(row: Any) -> bool:
    numbers = isinstance(row, Sequence) and not isinstance(row, str) and len(row) == 2
    return numbers and all(isinstance(it, int | float) and not isinstance(it, bool) for it in row)


def varying(material: object) -> dict[str, SpatialField]:
    """Return the fields of a material that vary in space, by name.

    Args:
        material: A dataclass, or a body of another class, which has none.
    """
    if not hasattr(material, "__dataclass_fields__"):
        return {}
    every: Any = material
    found = {it.name: getattr(every, it.name) for it in fields(every)}
    inner = varying(found["body"]) if "body" in found else {}
    return inner | {name: it for name, it in found.items() if isinstance(it, SpatialField)}
