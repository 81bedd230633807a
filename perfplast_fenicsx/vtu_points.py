"""Read values at the points of a ``.vtu`` file, with its triangles or tetrahedra. NumPy only.

Content may be text, base64 or raw bytes, in the arrays themselves or appended, and compressed by
zlib (VTK file formats, https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
"""

import base64
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError

SIMPLICES = {5: 3, 10: 4}
"""Numbers of corners by VTK's types of cells: triangles and tetrahedra."""

LOWER = {1, 2, 3}
"""Types of cells that have no area: vertices and lines."""


@dataclass(frozen=True)
class PointArray:
    """Values at the points of a mesh.

    Attributes:
        points: Shape (num_points, 3).
        cells: Points of each triangle or tetrahedron, shape (num_cells, 3 or 4).
        values: Shape (num_points,).
    """

    points: Floats
    cells: Longs
    values: Floats


def read_vtu_points(path: Path, name: str) -> PointArray:
    """Return an array of a ``.vtu`` file. Not collective.

    Args:
        path: The file.
        name: Of an array at its points, with one component.

    Raises:
        InputError: If the file cannot be read, has no such array, or has other cells than triangles
            or tetrahedra.
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
            f"'{path.name}' cannot be read as a .vtu file of one piece ({error}); write it again."
        ) from error
    if values is None or len(values) != len(points):
        given = ", ".join(known) or "none"
        raise InputError(
            f"'{path.name}' has no array '{name}' of one number a point; it has {given}."
        )
    found = [int(kind) for kind in np.unique(kinds) if kind not in LOWER]
    if len(found) != 1 or found[0] not in SIMPLICES:
        raise InputError(
            f"'{path.name}' has cells of VTK's types {', '.join(map(str, found)) or 'none'}; give"
            " triangles (5) in the plane, or tetrahedra (10) in space."
        )
    corners = SIMPLICES[found[0]]
    counts = np.diff(offsets, prepend=0)
    damaged = InputError(f"'{path.name}' has cells whose points do not exist; write it again.")
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
    """A file whose arrays are decoded when they are asked for."""

    def __init__(self, content: bytes) -> None:
        """Parse the elements.

        Raises:
            ParseError, ValueError: If it is not VTK's, or has several pieces.
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
            raise ValueError(f"it is compressed by {compressor}, and zlib alone is known")
        self.compressed = bool(compressor)

    def names(self, group: str) -> list[str]:
        """Return the names of the arrays of a group."""
        return [one.get("Name", "") for one in self.piece.findall(f"{group}/DataArray")]

    def array(self, group: str, name: str | None) -> npt.NDArray[Any]:
        """Return an array, flat.

        Args:
            group: Such as ``PointData``.
            name: Of the array; the first one without.

        Raises:
            ValueError, KeyError: If it is missing or damaged.
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
        """Return the content of blocks; their number and sizes are before them."""
        size = self.header.itemsize

        def head(count: int) -> Longs:
            part = _decoded_bytes(content, count * size) if coded else content[: count * size]
            return np.frombuffer(part, self.header).astype(np.int64)

        blocks = int(head(1)[0])
        numbers = head(3 + blocks)
        length = len(numbers) * size
        if coded:  # head and blocks are coded each by itself
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
    """Return the first bytes of what base64 holds."""
    return base64.b64decode(content[: 4 * -(-count // 3)])[:count]
