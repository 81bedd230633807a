"""Mesh ground with a vertical cut of height 1, in the plane z = 0.

The cut extends from its foot (0, 0) to its crest (0, 1). The ground behind it extends to x =
−width, the ground in front of it to x = width, and both to y = −depth. The volume is ``ground``;
curves are ``face`` (the cut), ``top``, ``floor`` (y = 0), ``sides`` and ``bottom``.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, DEPTH = 2.0, 1.0
"""Width of the ground on either side of the cut, and depth below its foot."""


def write_vertical_cut(
    path: str | Path,
    size: float = 0.25,
    width: float = WIDTH,
    depth: float = DEPTH,
    order: int = 1,
) -> None:
    """Mesh the ground and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
        width: Width of the ground on either side of the cut.
        depth: Depth of the ground below the foot of the cut.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        corners = [(-width, -depth), (width, -depth), (width, 0.0)]
        curves = add_outline([*corners, (0.0, 0.0), (0.0, 1.0), (-width, 1.0)])
        ground = add_polygon(curves)
        gmsh.model.occ.synchronize()

        bottom, right, floor, face, top, left = curves
        name(2, {"ground": [ground]})
        name(1, {"face": [face], "top": [top], "floor": [floor], "bottom": [bottom]})
        name(1, {"sides": [right, left]})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_vertical_cut, "Mesh ground with a vertical cut.")
    parser.add_argument("--width", type=float, help="of the ground on either side of the cut")
    parser.add_argument("--depth", type=float, help="of the ground below the foot of the cut")
    write_from(parser, write_vertical_cut)


if __name__ == "__main__":
    main()
