"""Mesh a quarter of a square plate with a square hole in plane strain.

The plate is (0, WIDTH)² without (0, HOLE)². The volume is ``plate``. Curves are ``x0`` (x = 0, y ≥
HOLE), ``y0`` (y = 0, x ≥ HOLE), ``side`` (x = WIDTH), ``top`` (y = WIDTH) and ``hole`` (two lines).
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, HOLE = 5.0, 2.5
"""Half-widths of the plate and of the hole."""
FINER = 10.0
"""Factor by which the elements are smaller at the hole's corner."""


def write_plate_with_hole(path: str | Path, size: float = 0.25, order: int = 1) -> None:
    """Mesh a quarter of the plate and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length; at the hole's corner it is a tenth of this.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        corners = [(HOLE, 0.0), (WIDTH, 0.0), (WIDTH, WIDTH), (0.0, WIDTH), (0.0, HOLE)]
        lines = add_outline([*corners, (HOLE, HOLE)])
        plate = add_polygon(lines)
        gmsh.model.occ.synchronize()

        name(2, {"plate": [plate]})
        y0, side, top, x0, *hole = lines
        name(1, {"x0": [x0], "y0": [y0], "side": [side], "top": [top], "hole": hole})
        generate(2, finer_at((HOLE, HOLE), size / FINER, size), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_plate_with_hole, "Mesh a quarter of a plate with a square hole.")
    write_from(parser, write_plate_with_hole)


if __name__ == "__main__":
    main()
