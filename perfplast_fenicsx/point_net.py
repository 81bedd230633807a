"""Interpolate values at points linearly in triangles or tetrahedra, and read ``.vtu`` files.

The module reads values at the points of a ``.vtu`` file with triangles or tetrahedra. It needs only
NumPy to read them. Data may be text, base64 or raw bytes. They are stored in the array elements or
appended, and may be compressed by zlib (VTK file formats,
https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
"""

import base64
import hashlib
import re
import zlib
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.formulas import Pair

OUTSIDE = 1e-9
"""Largest size of a negative barycentric coordinate that counts as rounding."""

PLACES_AT_ONCE = 2000
"""Number of places that are located together, limited by memory."""


class Triangulation:
    """Points of a file, values at the points, and triangles or tetrahedra between them.

    Attributes:
        name: Name of the file, for messages.
        values: Values at the points, shape (num_points,).
        simplices: Indices of each simplex's points, shape (num_simplices, d + 1).
        corners: Coordinates of these points, shape (num_simplices, d + 1, d).
        digest: SHA-256 of the points, the values, and the simplices of the file.
    """

    def __init__(
        self, name: str, points: Floats, values: Floats, cells: Longs | None = None
    ) -> None:
        """Store the simplices of a file, or compute a Delaunay triangulation if it has none.

        Args:
            name: Name of the file.
            points: Coordinates, shape (num_points, d) with d = 2 or 3.
            values: Values at the points, shape (num_points,).
            cells: Points of the file's triangles or tetrahedra, shape (num_cells, d + 1); None if
                the file has only points.

        Raises:
            InputError: If the points span no area, if two points coincide (in a file with cells:
                with unequal values), or if cells of the file have no area or overlap.
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
        """Compute a Delaunay triangulation of the points.

        Raises:
            InputError: If the points span no area, or if two points coincide.
        """
        from scipy.spatial import Delaunay, QhullError  # slow to import, and few cases need it

        try:
            self._net = net = Delaunay(points)
        except (QhullError, ValueError) as error:
            raise InputError(
                f"the {len(points)} points of '{self.name}' span no area (in 3D, no volume), so "
                "values between them are unknown; give points all around the body."
            ) from error
        if len(net.coplanar):
            where = place_of(points[net.coplanar[0, 0]])
            raise InputError(
                f"'{self.name}' has the point {where} twice; give one value at this point."
            )
        x: Floats = points[net.simplices]
        thin = 1e-12  # relative height of a flat simplex at the hull
        size = np.ptp(x, axis=1).max(axis=1) ** points.shape[1]
        kept = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) > thin * size
        self.simplices = net.simplices[kept].astype(np.int64)
        self.corners = x[kept]

    def _check_cells(self) -> None:
        """Refuse flat or overlapping cells of a file, and coinciding points with unequal values.

        Raises:
            InputError: If there is such a cell or point; the message names the first place.
        """
        middles = self.corners.mean(axis=1)
        size = np.ptp(self.corners, axis=1).max(axis=1) ** middles.shape[1]
        edges = self.corners[:, 1:] - self.corners[:, :1]
        flat = np.abs(np.linalg.det(edges)) <= 1e-12 * size
        if flat.any():
            where = place_of(middles[np.argmax(flat)])
            raise InputError(
                f"'{self.name}' has a degenerate cell (zero area or volume) at "
                f"{where}; remove this cell."
            )
        d = middles.shape[1]
        near_sides = np.full((d + 1, d + 1), 0.9 / d)
        np.fill_diagonal(near_sides, 0.1)
        inside = np.einsum("sv,cvi->csi", near_sides, self.corners).reshape(-1, d)
        places, _, shares = self._candidates(inside)
        around = np.bincount(places[(shares > OUTSIDE).all(axis=1)], minlength=len(inside))
        if (around > 1).any():
            where = place_of(inside[np.argmax(around > 1)])
            raise InputError(
                f"'{self.name}' has cells that overlap at {where}, so its values there are "
                "ambiguous; correct its mesh."
            )
        used = np.unique(self.simplices)
        x = np.zeros((len(self.values), middles.shape[1]))
        x[self.simplices.ravel()] = self.corners.reshape(-1, middles.shape[1])
        _, first, inverse = np.unique(x[used], axis=0, return_index=True, return_inverse=True)
        apart = self.values[used] != self.values[used][first[inverse.ravel()]]
        if apart.any():
            where = place_of(x[used[np.argmax(apart)]])
            raise InputError(
                f"'{self.name}' has two values at the point {where}, where its field jumps; give "
                "one value there, or a separate body with its own file on each side of the jump."
            )

    def _candidates(self, x: Floats) -> tuple[Longs, Longs, Floats]:
        """Return pairs of a place and a simplex whose bounding box has the place, with coordinates.

        Args:
            x: Places, shape (n, d).

        Returns:
            Index of the place and of the simplex in each pair, shape (num_pairs,), and the
            barycentric coordinates of the place, shape (num_pairs, d + 1).
        """
        from scipy.spatial import cKDTree  # slow to import, and few cases need it

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
        """Return the values at places, interpolated linearly between the points.

        Raises:
            InputError: If a place lies in no simplex, or has another number of coordinates.
        """
        if x.shape[1] != self.corners.shape[2]:
            raise InputError(
                f"{place}: '{self.name}' has points in {self.corners.shape[2]} dimensions, but the "
                f"body has {x.shape[1]}; give points with as many coordinates as the body has "
                "dimensions."
            )
        vertices, shares = self._in_net(x) if self._net is not None else self._in_cells(x)
        outside = shares.min(axis=1) < -OUTSIDE
        if outside.any():
            where = place_of(x[np.argmax(outside)])
            raise InputError(
                f"{place}: there is material at {where}, outside the points of '{self.name}'; "
                "give points all around the body."
            )
        return np.asarray(np.einsum("ni,ni->n", shares, self.values[vertices]))

    def _in_net(self, x: Floats) -> tuple[Longs, Floats]:
        """Return the vertices of the Delaunay simplex at each place, and barycentric coordinates.

        The coordinates are -1 for a place outside the triangulation.
        """
        found, d = self._net.find_simplex(x, tol=OUTSIDE), x.shape[1]
        maps = self._net.transform[found]
        shares = np.einsum("nij,nj->ni", maps[:, :d], x - maps[:, d])
        shares = np.column_stack([shares, 1 - shares.sum(axis=1)])
        return self._net.simplices[found], np.where((found < 0)[:, None], -1.0, shares)

    def _in_cells(self, x: Floats) -> tuple[Longs, Floats]:
        """Return the vertices of the file's simplex at each place, and barycentric coordinates."""
        found = np.zeros(len(x), dtype=np.int64)
        shares = np.full((len(x), x.shape[1] + 1), -1.0)
        for some in np.array_split(np.arange(len(x)), len(x) // PLACES_AT_ONCE + 1):
            places, simplices, given = self._candidates(x[some])
            # sorted such that the last simplex of each place contains the place
            order = np.lexsort((given.min(axis=1), places))
            found[some[places[order]]] = simplices[order]
            shares[some[places[order]]] = given[order]
        return self.simplices[found], shares

    def deviations(self, corners: Floats, chords: Floats) -> Pair:
        """Return the range of differences from given linear functions in simplices.

        The differences are the interpolated values minus the linear functions.

        Args:
            corners: Vertices of the simplices, shape (n, d + 1, d).
            chords: Values of the linear functions at these vertices, shape (n, d + 1).

        Returns:
            The least difference (zero or negative) and the largest difference, both of shape (n,).
        """
        least, most = np.zeros((2, len(corners)))
        boxes = [(x.min(axis=1), x.max(axis=1)) for x in (corners, self.corners)]
        (low, high), (others_low, others_high) = boxes
        at_once = 200  # simplices whose neighbours are found together, limited by memory
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
    """Return barycentric coordinates of points whose convex hull is the overlap of two simplices.

    The points are the ends of the part of each edge of either simplex that lies in the other
    simplex. Every vertex of the overlap is such an end.

    Args:
        ones: Vertices of the first simplices, shape (num_pairs, d + 1, d).
        others: Vertices of the second simplices, same shape.

    Returns:
        Coordinates in both simplices, both of shape (num_pairs, n, d + 1), and flags of the points
            that exist.
    """
    rounding, count = 1e-9, ones.shape[1]  # tolerance for barycentric coordinates
    pairs = np.array(list(combinations(range(count), 2)))
    own = np.eye(count)
    found: list[tuple[Floats, Floats]] = []
    inside = []
    for x, y, swapped in ((ones, others, False), (others, ones, True)):
        inverse = np.linalg.inv(y[:, 1:] - y[:, :1])
        shares = (x - y[:, :1]) @ inverse  # coordinates in y of the vertices of x
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


SIMPLICES = {5: 3, 10: 4}
"""Numbers of vertices by VTK's types of cells: triangles and tetrahedra."""

LOWER = {1, 2, 3}
"""VTK's types of cells without area: vertices and lines."""


@dataclass(frozen=True)
class PointArray:
    """Values at the points of a mesh.

    Attributes:
        points: Coordinates, shape (num_points, 3).
        cells: Points of each triangle or tetrahedron, shape (num_cells, 3 or 4).
        values: Values at the points, shape (num_points,).
    """

    points: Floats
    cells: Longs
    values: Floats


def read_vtu_points(path: Path, name: str) -> PointArray:
    """Return the array ``name`` of a ``.vtu`` file, with points and cells. Not collective.

    Args:
        path: The file.
        name: Name of a point data array with one component.

    Raises:
        InputError: If the file cannot be read, if it has no such array, or if it has cells other
            than triangles and tetrahedra.
    """
    try:
        file = _File(path.read_bytes())
        points = file.array("Points", None).reshape(-1, 3).astype(np.float64)
        kinds = file.array("Cells", "types").astype(np.int64)
        offsets = file.array("Cells", "offsets").astype(np.int64)
        nodes = file.array("Cells", "connectivity").astype(np.int64)
        known = file.names("PointData")
        values = file.array("PointData", name).astype(np.float64) if name in known else None
    except OSError as error:
        raise InputError(f"'{path.name}' cannot be read ({error}); give a .vtu file.") from error
    except (ElementTree.ParseError, ValueError, LookupError, zlib.error) as error:
        raise InputError(
            f"'{path.name}' cannot be read as a .vtu file with a single piece ({error}); write the "
            "file again."
        ) from error
    if values is None or len(values) != len(points):
        given = ", ".join(known) or "none"
        raise InputError(
            f"'{path.name}' has no array '{name}' with one number for each point; arrays in the "
            f"file: {given}."
        )
    found = [int(kind) for kind in np.unique(kinds) if kind not in LOWER]
    if len(found) != 1 or found[0] not in SIMPLICES:
        raise InputError(
            f"'{path.name}' has cells of VTK's types {', '.join(map(str, found)) or 'none'}; give "
            "triangles (5) in the plane, or tetrahedra (10) in 3D."
        )
    corners = SIMPLICES[found[0]]
    counts = np.diff(offsets, prepend=0)
    damaged = InputError(
        f"'{path.name}' has cells whose points do not exist; write the file again."
    )
    if len(offsets) != len(kinds) or counts.sum() != len(nodes):
        raise damaged
    mine = np.flatnonzero(kinds == found[0])
    if not ((counts[mine] == corners).all() and (counts >= 0).all()):
        raise damaged
    table = nodes[(offsets - counts)[mine][:, None] + np.arange(corners)]
    if not 0 <= table.min() <= table.max() < len(points):
        raise damaged
    return PointArray(points, table, values)


class _File:
    """A ``.vtu`` file that decodes its arrays on request."""

    def __init__(self, content: bytes) -> None:
        """Parse the XML elements of a file.

        Raises:
            ParseError, ValueError: If the file is not a VTK file, or has several pieces.
        """
        begin = re.search(rb"<AppendedData[^>]*>\s*_", content)
        self.appended = b"" if begin is None else content[begin.end() :]
        self.base64 = begin is None or b"base64" in begin.group()
        text = content if begin is None else content[: begin.start()] + b"</VTKFile>"
        self.root = ElementTree.fromstring(text)
        pieces = self.root.findall("UnstructuredGrid/Piece")
        if len(pieces) != 1:
            raise ValueError(f"it has {len(pieces)} pieces of an unstructured grid")
        self.piece = pieces[0]
        order = "<" if self.root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        header = self.root.get("header_type", "UInt32").removeprefix("UInt")
        self.order, self.header = order, np.dtype(f"{order}u{int(header) // 8}")
        compressor = self.root.get("compressor", "")
        if compressor not in ("", "vtkZLibDataCompressor"):
            raise ValueError(f"it is compressed by {compressor}, but only zlib is supported")
        self.compressed = bool(compressor)

    def names(self, group: str) -> list[str]:
        """Return the names of the arrays in a group."""
        return [one.get("Name", "") for one in self.piece.findall(f"{group}/DataArray")]

    def array(self, group: str, name: str | None) -> npt.NDArray[Any]:
        """Return an array of a group, flattened.

        Args:
            group: Name of the group, such as ``PointData``.
            name: Name of the array; by default the first one.

        Raises:
            ValueError, KeyError: If the array is missing or damaged.
        """
        for one in self.piece.findall(f"{group}/DataArray"):
            if name is None or one.get("Name") == name:
                return self._decoded(one)
        raise KeyError(name or group)

    def _decoded(self, one: ElementTree.Element) -> npt.NDArray[Any]:
        kind, bits = one.attrib["type"].rstrip("0123456789"), re.sub(r"\D", "", one.attrib["type"])
        letter = {"Float": "f", "Int": "i", "UInt": "u"}[kind]
        dtype = np.dtype(f"{self.order}{letter}{int(bits) // 8}")
        how = one.get("format", "ascii")
        if how == "ascii":
            return np.array((one.text or "").split(), dtype=dtype)
        if how == "appended":
            content, coded = self.appended[int(one.attrib["offset"]) :], self.base64
        else:
            content, coded = "".join((one.text or "").split()).encode(), True
        data = (
            self._uncompressed(content, coded) if self.compressed else self._plain(content, coded)
        )
        return np.frombuffer(data, dtype=dtype)

    def _plain(self, content: bytes, coded: bool) -> bytes:
        size = self.header.itemsize
        if coded:
            first = _decoded_bytes(content, size)
            total = size + int(np.frombuffer(first, self.header)[0])
            return _decoded_bytes(content, total)[size:]
        return content[size : size + int(np.frombuffer(content[:size], self.header)[0])]

    def _uncompressed(self, content: bytes, coded: bool) -> bytes:
        """Return uncompressed blocks of ``content``, which begins with their number and sizes."""
        size = self.header.itemsize

        def head(count: int) -> Longs:
            part = _decoded_bytes(content, count * size) if coded else content[: count * size]
            return np.frombuffer(part, self.header).astype(np.int64)

        blocks = int(head(1)[0])
        numbers = head(3 + blocks)
        length = len(numbers) * size
        if coded:  # header and blocks are encoded separately
            content = content[4 * -(-length // 3) :]
            content = _decoded_bytes(content, int(numbers[3:].sum()))
        else:
            content = content[length : length + int(numbers[3:].sum())]
        parts, at = [], 0
        for number, packed in enumerate(map(int, numbers[3:])):
            last = number == blocks - 1 and numbers[2]
            most = int(numbers[2] if last else numbers[1])
            parts.append(zlib.decompressobj().decompress(content[at : at + packed], most))
            at += packed
        return b"".join(parts)


def _decoded_bytes(content: bytes, count: int) -> bytes:
    """Return the first ``count`` bytes of base64 data."""
    return base64.b64decode(content[: 4 * -(-count // 3)])[:count]
