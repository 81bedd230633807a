"""Write a model to a .msh file of gmsh, with physical names."""

from pathlib import Path
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.models.foreign_model import ForeignModel


def write_msh(model: ForeignModel, path: Path) -> None:
    """Write the mesh in gmsh's format 2.2, in which each element has a physical group.

    Raises:
        OSError: If the file cannot be written.
    """
    used, cells = np.unique(model.cells, return_inverse=True)
    cells = cells.reshape(model.cells.shape)
    facets = np.searchsorted(used, model.facets)
    kinds = {2: (1, 2), 3: (2, 4)}  # gmsh's type numbers of facets and cells, by dimension
    of_facets, of_cells = kinds[model.dim]
    first = len(model.surfaces)
    with path.open("w", encoding="utf-8") as opened:
        file: Any = opened  # NumPy writes text to the file, which its type hints do not allow
        file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n")
        names = [(model.dim - 1, name) for name in model.surfaces]
        names += [(model.dim, name) for name in model.bodies]
        file.write(f"{len(names)}\n")
        for number, (dim, name) in enumerate(names, start=1):
            file.write(f'{dim} {number} "{name}"\n')
        file.write(f"$EndPhysicalNames\n$Nodes\n{len(used)}\n")
        numbers = np.arange(1, len(used) + 1)
        np.savetxt(file, np.column_stack([numbers, model.points[used]]), "%d %.17g %.17g %.17g")
        file.write(f"$EndNodes\n$Elements\n{len(facets) + len(cells)}\n")
        _elements(file, 1, of_facets, model.surface + 1, facets + 1)
        _elements(file, 1 + len(facets), of_cells, model.body + first + 1, cells + 1)
        file.write("$EndElements\n")


def _elements(file: Any, first: int, kind: int, tags: Longs, nodes: Longs) -> None:
    """Write one line for each element: number, kind, two tags, nodes."""
    count = len(nodes)
    numbers = np.arange(first, first + count)
    table = [numbers, np.full(count, kind), np.full(count, 2), tags, tags, *nodes.T]
    np.savetxt(file, np.column_stack(table), "%d")
