"""Write ``seepage.vtkhdf``: the seepage, for ParaView and for pictures."""

import os
from pathlib import Path

import h5py
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.io.results.result_files import (
    CONNECTIVITY,
    OFFSETS,
    POINT_DATA,
    POINTS,
    TYPES,
)
from perfplast_fenicsx.io.results.vtkhdf import add_counts, add_facts, make_grid
from perfplast_fenicsx.seepage.flow import SteadyFlow


def write_flow(flow: SteadyFlow, path: Path) -> None:
    """Write a flow at the vertices of its cells. Not collective.

    Args:
        flow: The seepage flow.
        path: The file, which is replaced if it exists.

    Raises:
        OSError: If the file cannot be written.
    """
    dim = flow.points.shape[1]
    cells, corners = flow.cells.shape
    core = h5py.File(os.fspath(path), "w", driver="core", backing_store=False)
    with core as file:
        make_grid(file)
        add_counts(file, (len(flow.points), cells, cells * corners))
        file[POINTS] = np.pad(flow.points, ((0, 0), (0, 3 - dim)))
        file[CONNECTIVITY] = flow.cells.ravel()
        file[OFFSETS] = corners * np.arange(cells + 1)
        vtk_type = {2: 5, 3: 10}[dim]
        file[TYPES] = np.full(cells, vtk_type, dtype=np.uint8)
        fields: dict[str, Floats] = {
            "pressure": flow.pressures,
            "head": flow.heads,
            "saturation": flow.saturation,
            "outflow": flow.outflow,
        }
        for name, values in fields.items():
            file[f"{POINT_DATA}/{name}"] = values
        add_facts(file, {"upwards": "xyz"[flow.axis]})
        file.flush()
        content = file.id.get_file_image()
    replace(path, content)
