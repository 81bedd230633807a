"""Mesh a quarter of a bar along z with a square section of side 1.

The volume ``bar`` is (0, ½)²×(0, length). Surfaces are ``x0``, ``y0`` (the symmetry planes), and
``z0`` and ``z1`` (the ends).
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

HALF = 0.5


def write_square_bar(
    path: str | Path, length: float = 0.1, size: float = 0.1, order: int = 1
) -> None:
    """Mesh the bar and write a .msh file. Not collective.

    Args:
        path: The file to write.
        length: Length of the bar.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        section = add_polygon(add_outline([(0.0, 0.0), (HALF, 0.0), (HALF, HALF), (0.0, HALF)]))
        (_, end), (_, bar), *sides = occ.extrude([(2, section)], 0.0, 0.0, length)
        occ.synchronize()
        name(3, {"bar": [bar]})
        y0, x0 = sides[0][1], sides[3][1]
        name(2, {"z0": [section], "z1": [end], "x0": [x0], "y0": [y0]})
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_square_bar, "Mesh a quarter of a square bar.")
    parser.add_argument("--length", type=float, help="of the bar")
    write_from(parser, write_square_bar)


if __name__ == "__main__":
    main()
