"""Write VTK's XML files of cells (``.vtu``) from the VTKHDF files of a run, with NumPy and h5py."""

import base64
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.io.results.result_files import (
    BESIDE,
    CELL_DATA,
    CONNECTIVITY,
    FIELD_DATA,
    OFFSETS,
    POINT_DATA,
    POINTS,
    TYPES,
)
from perfplast_fenicsx.proof.stored_file import stored_file

HEADER = (
    '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0"'
    ' byte_order="LittleEndian" header_type="UInt64">\n<UnstructuredGrid>\n'
)
FOOTER = "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"


def vtu_of(path: Path) -> bytes:
    """Return the content of a ``.vtu`` file with the mesh and the fields of a VTKHDF file.

    Args:
        path: A VTKHDF file of a run; its mesh file, if any, is in the same folder or in ``fields``.

    Returns:
        The content of the file, with numbers of unchanged type in base64, tensors with nine
        components, and text in UTF-8.

    Raises:
        OSError, KeyError, ValueError: If the file is damaged, or arrays are missing.
    """
    with stored_file(path, BESIDE) as file:
        return "".join(_parts(file)).encode()


def _parts(file: h5py.File) -> Iterator[str]:
    points, offsets = np.asarray(file[POINTS]), np.asarray(file[OFFSETS])
    yield HEADER
    yield _group("FieldData", _content(file, FIELD_DATA), fields=True)
    yield f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(offsets) - 1}">\n'
    yield _group("PointData", _content(file, POINT_DATA))
    yield _group("CellData", _content(file, CELL_DATA))
    yield _group("Points", {"Points": points})
    cells = {"connectivity": file[CONNECTIVITY], "offsets": offsets[1:], "types": file[TYPES]}
    yield _group("Cells", cells)
    yield FOOTER


def _content(file: h5py.File, place: str) -> dict[str, Any]:
    return {name: data[()] for name, data in file[place].items()} if place in file else {}


def _group(kind: str, arrays: Mapping[str, Any], fields: bool = False) -> str:
    content = "".join(_array(name, np.asarray(array), fields) for name, array in arrays.items())
    return f"<{kind}>\n{content}</{kind}>\n"


def _array(name: str, values: npt.NDArray[Any], field: bool) -> str:
    """Return a data array of numbers, or of texts that each end with a zero byte."""
    count = f' NumberOfTuples="{len(values)}"' if field else ""
    if values.dtype.kind in "OS":
        content = b"".join(bytes(text) + b"\0" for text in values)
        kind, width = "String", ""
    else:
        content = np.ascontiguousarray(values.astype(values.dtype.newbyteorder("<"))).tobytes()
        # VTK's names of number types, by NumPy's letters for their kinds.
        kinds = {"f": "Float", "i": "Int", "u": "UInt"}
        kind = f"{kinds[values.dtype.kind]}{8 * values.dtype.itemsize}"
        width = f' NumberOfComponents="{int(np.prod(values.shape[1:]))}"'
    size = len(content).to_bytes(8, "little")
    text = base64.b64encode(size + content).decode()
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)}{width}{count} format="binary">'
        f"{text}</DataArray>\n"
    )
