"""Read fields of a result file as numbers at the skin of the bodies. Single-process.

The module reads a field in slabs of rows and keeps only the values on the skin.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.results.result_files import BESIDE, BODY, CELL_DATA, POINT_DATA
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof.stored_file import stored_file

SLAB = 1 << 17
"""Number of rows that are read at once."""


@dataclass(frozen=True)
class SkinField:
    """A number at each point or triangle of the skin.

    Attributes:
        name: Name in the file.
        at: Whether the values are at points or triangles.
        values: Shape (num_points,) or (num_triangles,).
    """

    name: str
    at: Literal["points", "cells"]
    values: Floats


@dataclass(frozen=True)
class SkinState:
    """The skin at a level, or of the mechanism.

    Attributes:
        motion: Displacement or velocity of its points, shape (num_points, 3).
        fields: The other fields, as numbers.
    """

    motion: Floats
    fields: list[SkinField]


def read_state(reader: ResultReader, name: str) -> SkinState:
    """Return all fields of a file at the skin.

    Args:
        reader: The results.
        name: Name of a field file in the folder.

    Raises:
        InputError: If it cannot be read, or if it has no displacement or velocity.
    """
    skin = reader.skin

    # Fields that give the motion of points; the second is a velocity.
    motions = ("displacement", "mechanism")

    def read(path: Path) -> SkinState:
        fields, motion = [], None
        with stored_file(path, BESIDE) as file:
            places = [f"{POINT_DATA}/{a}" for a in file.get(POINT_DATA, ())]
            places += [f"{CELL_DATA}/{a}" for a in file.get(CELL_DATA, ())]
            for place in places:
                if place == BODY:
                    continue
                nodal = place.startswith(POINT_DATA)
                values = rows_of(file[place], skin.nodes if nodal else skin.cells)
                label = place.rsplit("/", 1)[1]
                if label in motions:
                    motion = values
                number = as_number(label, values)
                fields.append(SkinField(label, "points" if nodal else "cells", number))
        if motion is None:
            raise KeyError(f"neither {' nor '.join(motions)} is in it")
        return SkinState(motion, fields)

    return reader.read(name, read)


def rows_of(data: Any, rows: Longs) -> npt.NDArray[Any]:
    """Return rows of a data set in single precision.

    Args:
        data: The data set.
        rows: Their numbers, in ascending order.
    """
    found = np.empty((len(rows), *data.shape[1:]), dtype=np.float32)
    for first in range(0, len(data), SLAB):
        low, high = np.searchsorted(rows, [first, first + SLAB])
        if high > low:
            found[low:high] = data[first : first + SLAB][rows[low:high] - first]
    return found


def as_number(name: str, values: Floats) -> Floats:
    """Return the displayed numbers of a field.

    Args:
        name: Name of the field.
        values: Numbers, vectors (n, 3) or tensors (n, 9) or (n, 3, 3).

    Returns:
        Numbers unchanged; for vectors the norm; for stresses von Mises' stress √(3/2) ‖dev σ‖; for
        other tensors, which are strains, √(2/3) ‖ε‖.
    """
    if values.ndim == 1:
        return values
    flat = values.reshape(len(values), -1)
    if flat.shape[1] != 9:
        return np.asarray(np.linalg.norm(flat, axis=1))
    if "stress" not in name:
        return np.asarray(np.sqrt(2 / 3) * np.linalg.norm(flat, axis=1))
    deviator = flat.copy()
    deviator[:, ::4] -= flat[:, ::4].mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(3 / 2) * np.linalg.norm(deviator, axis=1))
