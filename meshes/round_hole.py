"""Mesh a quarter of a square plate with a round hole in its middle.

The plate is (0, WIDTH)² outside the circle of radius 1 around the origin. The volume is ``plate``.
Curves are ``x0`` (x = 0), ``y0`` (y = 0), ``side`` (x = WIDTH), ``top`` (y = WIDTH) and ``hole``.
"""

import math
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH = 5.0
"""Half of the plate's width, in radii of the hole."""


def write_round_hole(path: str | Path, size: float = 0.1, order: int = 1) -> None:
    """Mesh a quarter of the plate and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length at the hole; it grows in proportion to the distance from the middle.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        places = [(1.0, 0.0), (WIDTH, 0.0), (WIDTH, WIDTH), (0.0, WIDTH), (0.0, 1.0)]
        right, corner, far, upper, left = (occ.addPoint(x, y, 0.0) for x, y in places)
        y0, side = occ.addLine(right, corner), occ.addLine(corner, far)
        top, x0 = occ.addLine(far, upper), occ.addLine(upper, left)
        hole = occ.addCircleArc(left, occ.addPoint(0.0, 0.0, 0.0), right)
        plate = add_polygon([y0, side, top, x0, hole])
        occ.synchronize()
        name(2, {"plate": [plate]})
        name(1, {"x0": [x0], "y0": [y0], "side": [side], "top": [top], "hole": [hole]})
        generate(2, lambda x, y, z: size * max(math.hypot(x, y), 1.0), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_round_hole, "Mesh a quarter of a plate with a round hole.")
    write_from(parser, write_round_hole)


if __name__ == "__main__":
    main()
