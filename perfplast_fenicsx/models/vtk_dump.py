"""Read a mesh file with VTK and write its content to an .npz file, as a separate program.

A damaged file may make VTK crash or allocate memory without limit. In this case only this process
ends, not the ranks. The program imports nothing from this package, because such an import might
start MPI.

    python3 -P vtk_dump.py FILE.vtu TARGET.npz
"""

import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyvista


def limit(size: int) -> None:
    """Limit the memory of this process for a file of ``size`` bytes, and forbid core dumps."""
    least_memory, memory_per_byte = 8 << 30, 100  # limits of the address space (bytes)
    memory, most = least_memory + memory_per_byte * size, resource.getrlimit(resource.RLIMIT_AS)[1]
    if most == resource.RLIM_INFINITY or memory < most:
        resource.setrlimit(resource.RLIMIT_AS, (memory, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def dump(source: str, target: str) -> None:
    """Read a mesh file, and write its arrays to an .npz file."""
    grid: Any = pyvista.read(source)
    if not isinstance(grid, pyvista.UnstructuredGrid):
        grid = (
            grid.combine()
            if isinstance(grid, pyvista.MultiBlock)
            else grid.cast_to_unstructured_grid()
        )
    arrays: dict[str, Any] = {"points": np.asarray(grid.points, dtype=np.float64)}
    arrays |= {"kinds": np.asarray(grid.celltypes), "offsets": np.asarray(grid.offset)}
    arrays["nodes"] = np.asarray(grid.cell_connectivity)
    for where, data in (("cell", grid.cell_data), ("point", grid.point_data)):
        for number, name in enumerate(data.keys()):
            values = np.asarray(data[name])
            if values.ndim == 1 and values.dtype.kind in "iub":
                arrays[f"{where}_{number}"] = values.astype(np.int64)
                arrays[f"{where}_{number}_name"] = np.array(name)
    np.savez(target, **arrays)


if __name__ == "__main__":
    limit(Path(sys.argv[1]).stat().st_size)
    dump(*sys.argv[1:3])
