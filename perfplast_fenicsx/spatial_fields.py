"""Define numbers that vary in space: formulas, tables over depth, and values at scattered points.

A strength that varies is evaluated at each quadrature point. Strict bounds need two linear
functions in each cell: one nowhere above the field, and one nowhere below it
(:meth:`SpatialField.between`). In a cell in which the field is linear, both equal the field.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.formulas import ROUNDING, Pair, check, enclosed, evaluate
from perfplast_fenicsx.point_net import Triangulation, read_vtu_points

if TYPE_CHECKING:
    from dolfinx import fem


@dataclass(frozen=True, kw_only=True)
class SpatialField:
    """Base class of numbers that vary in space: a profile times a number.

    Args:
        scale: Number by which the profile is multiplied.
    """

    scale: float = 1.0

    @property
    def profile(self) -> Self:
        """Return the field with scale 1."""
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
        """Return the values of the field at points. Not collective.

        Args:
            x: Coordinates, shape (n, d).
            place: Name of the object that has the field, for messages.

        Returns:
            Values, shape (n,).

        Raises:
            InputError: If the field has no finite value at a point.
        """
        return self.scale * self._at(x, place)

    def between(self, corners: Floats, place: str) -> Pair:
        """Return linear functions below and above the field in simplices. Not collective.

        Args:
            corners: Vertices of the simplices, shape (n, k, d).
            place: Name of the object that has the field, for messages.

        Returns:
            Values of both functions at the vertices, both of shape (n, k). The arrays are equal
            where the field is linear in the simplex.

        Raises:
            InputError: If no such functions are known for the field.
        """
        low, high = self._between(corners, place)
        both = self.scale * low, self.scale * high
        return both if self.scale >= 0 else (both[1], both[0])

    def in_words(self) -> str:
        """Return a short description of the field."""
        raise NotImplementedError

    def _at(self, x: Floats, place: str) -> Floats:
        raise NotImplementedError

    def _between(self, corners: Floats, place: str) -> Pair:
        raise NotImplementedError


if TYPE_CHECKING:
    # For type checkers, any type: numbers and fields share their arithmetic, and most code knows
    # that its strength is a number.
    Strength: TypeAlias = Any
else:
    Strength = float | SpatialField
"""Number of a material that may vary in space."""


@dataclass(frozen=True)
class Formula(SpatialField):
    """A formula in the coordinates.

    Args:
        text: Formula such as ``"20 + 1.5*(12 - y)"``, with x, y, z, pi and NumPy's functions.
        scale: Number by which the formula is multiplied.

    Raises:
        InputError: If the formula has any other parts.
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
                f"{place}: strict bounds need linear functions below and above the formula "
                f"'{self.text}' in each cell. Such functions are known only for sums, products, "
                "abs, minimum, maximum and where; give such a formula, or a table of [coordinate, "
                "value] pairs."
            )
        return found


@dataclass(frozen=True)
class DepthTable(SpatialField):
    """Values at some heights, linear between them.

    Args:
        rows: At least two pairs of the vertical coordinate and the value. The coordinate is y in
            the plane and z in 3D.
        scale: Number by which the values are multiplied.

    Raises:
        InputError: If there are fewer than two pairs, if a number is not finite, or if two pairs
            have the same coordinate.
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
                f"a table over depth has two values at the coordinate {table[same[0], 0]:g}; give "
                "one value there, or a separate body for each layer where the value jumps."
            )
        rows = tuple((float(height), float(value)) for height, value in table)
        object.__setattr__(self, "rows", rows)

    @property
    def heights(self) -> Floats:
        """Return the vertical coordinates of the values, in ascending order."""
        return np.array(self.rows)[:, 0]

    def in_words(self) -> str:
        """Return the number of values, and the coordinates and values at the ends, in words."""
        (low, first), *_, (high, last) = self.rows
        return f"table of {len(self.rows)} values, {first:g} at {low:g} to {last:g} at {high:g}"

    def _at(self, x: Floats, place: str) -> Floats:
        heights, values = np.array(self.rows).T
        s, reach = x[:, -1], ROUNDING * np.abs(heights).max()
        outside = (s < heights[0] - reach) | (s > heights[-1] + reach)
        if outside.any():
            where = place_of(x[np.argmax(outside)])
            raise InputError(
                f"{place}: the table over depth covers {heights[0]:g} to {heights[-1]:g}, but "
                f"there is material at {where}; give values for the whole depth of the body."
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


@dataclass(frozen=True)
class PointValues(SpatialField):
    """Values at points from a file, interpolated linearly in triangles or tetrahedra.

    Args:
        net: The points with their values and simplices.
        scale: Number by which the values are multiplied.
    """

    net: Triangulation

    def in_words(self) -> str:
        """Return the name of the file and its number of values, in words."""
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
    """Return the field that a column of a CSV file gives at points.

    Args:
        path: File whose first line names the columns: x, y, in 3D also z, and values.
        column: Name of the column with the values.

    Raises:
        InputError: If the file cannot be read, a column is missing, or an entry is not a number.
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
                f"'{path.name}' has no column '{name}' in its first line; name the coordinates x "
                "and y (and z in 3D) in this line, and the values as in the case file."
            )
    wanted = [*(name for name in "xyz" if name in names), column]
    numbers = np.empty((len(rows) - 1, len(wanted)))
    for line, row in enumerate(rows[1:]):
        try:
            numbers[line] = [float(row[names.index(name)]) for name in wanted]
        except (ValueError, IndexError) as error:
            raise InputError(
                f"'{path.name}': row {line + 2} has no number in one of the columns "
                f"{', '.join(wanted)}; give one number in each."
            ) from error
    if not np.isfinite(numbers).all():
        raise InputError(f"'{path.name}' has an entry that is not finite; give numbers.")
    return PointValues(Triangulation(path.name, numbers[:, :-1], numbers[:, -1]))


def read_vtu(path: Path, name: str) -> PointValues:
    """Return the field of an array at the points of a ``.vtu`` file, linear in its cells.

    Args:
        path: The file.
        name: Name of the array.

    Raises:
        InputError: If the file cannot be read, if it has no such array, or if its cells overlap,
            have no area, or are not simplices. Also raised if triangles are not in
            a plane z = constant.
    """
    found = read_vtu_points(path, name)
    points = found.points
    if not (np.isfinite(points).all() and np.isfinite(found.values).all()):
        raise InputError(f"'{path.name}' has an entry that is not finite; give numbers.")
    if found.cells.shape[1] == 3:
        if np.ptp(points[found.cells, 2]) > 1e-9 * np.ptp(points):
            raise InputError(
                f"'{path.name}' has triangles that do not lie in one plane z = constant; give a "
                "mesh in such a plane, or tetrahedra."
            )
        points = np.ascontiguousarray(points[:, :2])
    return PointValues(Triangulation(path.name, points, found.values, found.cells))


def field_of(function: "fem.Function") -> PointValues:
    """Return the field of a DOLFINx function, such as a temperature or a pressure. Collective.

    Each rank stores the whole function, so the field may be evaluated on other meshes.

    Args:
        function: Continuous scalar function of degree 1 on straight triangles or tetrahedra.

    Raises:
        InputError: On every rank, if the function is of another kind or has a value that is not
            finite.
    """
    import basix.ufl  # slow to import, and only scripts have functions

    space, mesh = function.function_space, function.function_space.mesh
    element = space.ufl_element()
    straight = mesh.geometry.cmap.degree == 1 and mesh.topology.cell_name() in SIMPLICES
    if not straight or element != basix.ufl.element("Lagrange", mesh.basix_cell(), 1):
        raise InputError(
            f"'{function.name}' is a function of {element}, but a field needs a continuous scalar "
            "function of degree 1 on straight simplices; interpolate it into "
            "functionspace(mesh, ('Lagrange', 1))."
        )
    index_map, topology = space.dofmap.index_map, mesh.topology
    own = index_map.size_local
    cells = space.dofmap.list[: topology.index_map(topology.dim).size_local]
    points = space.tabulate_dof_coordinates()[:own, : mesh.geometry.dim]
    numbers = index_map.local_to_global(cells.ravel()).reshape(cells.shape)
    parts = mesh.comm.allgather((points, function.x.array[:own], numbers.astype(np.int64)))
    every = [np.concatenate(part) for part in zip(*parts, strict=True)]
    if not np.isfinite(every[1]).all():
        raise InputError(f"'{function.name}' has a value that is not finite; correct the function.")
    return PointValues(Triangulation(function.name, *every))


SIMPLICES = ("triangle", "tetrahedron")
"""Cells on which :func:`field_of` accepts functions."""


def spatial_field(value: object, folder: Path) -> SpatialField:
    """Return the field that a value in a case file describes.

    Args:
        value: A formula, a list of pairs, or a table with a file and the column of its values. For
            a .vtu file, the column is the name of an array at its points.
        folder: Folder of the case file, for relative paths.

    Raises:
        InputError: If the value has another form, or does not describe a field.
    """
    if isinstance(value, SpatialField):
        return value
    if isinstance(value, str):
        return Formula(value)
    if isinstance(value, dict) and set(value) == {"file", "column"}:
        file, column = value["file"], value["column"]
        if isinstance(file, str) and isinstance(column, str):
            path = folder / file
            if path.exists() and not path.is_file():  # reading from a pipe might never end
                raise InputError(f"'{file}' is not a regular file; give a .csv or .vtu file.")
            by_cells = file.lower().endswith(".vtu")
            return read_vtu(path, column) if by_cells else read_points(path, column)
    if isinstance(value, Sequence) and all(_is_pair(row) for row in value):
        return DepthTable(tuple((float(row[0]), float(row[1])) for row in value))
    raise InputError(
        'the value is not a number, a formula such as "20 + 1.5*(12 - y)", a table of [coordinate, '
        "value] pairs such as [[0.0, 30.0], [10.0, 20.0]], or a .csv or .vtu file such as { file = "
        '"points.csv", column = "c" }; give one of these.'
    )


def _is_pair(row: Any) -> bool:
    numbers = isinstance(row, Sequence) and not isinstance(row, str) and len(row) == 2
    return numbers and all(isinstance(it, int | float) and not isinstance(it, bool) for it in row)


def varying(material: object) -> dict[str, SpatialField]:
    """Return the fields of a material that vary in space, by name.

    Args:
        material: A dataclass, or an instance of another class, which has no such fields.
    """
    if not hasattr(material, "__dataclass_fields__"):
        return {}
    every: Any = material
    found = {it.name: getattr(every, it.name) for it in fields(every)}
    inner = varying(found["body"]) if "body" in found else {}
    return inner | {name: it for name, it in found.items() if isinstance(it, SpatialField)}
