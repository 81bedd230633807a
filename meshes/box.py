"""Mesh a rectangle or a box whose faces have names by axis and end: ``x_low``, ``x_high``, ...

The volume is ``box``.
"""

from collections.abc import Sequence
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_box(
    path: str | Path,
    corner: Sequence[float] = (0.0, 0.0, 0.0),
    extent: Sequence[float] = (1.0, 1.0, 1.0),
    size: float = 0.5,
    order: int = 1,
) -> None:
    """Mesh a rectangle or a box and write a .msh file. Not collective.

    Args:
        path: The file to write.
        corner: Corner with the smallest coordinates, (x, y) or (x, y, z).
        extent: Lengths along the axes.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    dim = len(corner)
    with gmsh_session() as gmsh:
        box = add_box(corner, extent)
        gmsh.model.occ.synchronize()
        name(dim, {"box": [box[1]]})
        ends = {
            f"{'xyz'[axis]}_{end}": (axis, corner[axis] + far * extent[axis])
            for axis in range(dim)
            for end, far in (("low", 0), ("high", 1))
        }
        name_planes(dim - 1, ends)
        generate(dim, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    write_from(mesh_parser(write_box, "Mesh a unit cube with named faces."), write_box)


if __name__ == "__main__":
    main()
