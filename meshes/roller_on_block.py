"""Mesh half of a roller on a block, in millimetres: NAFEMS' first contact benchmark.

The mesh is plane. Half of a disc of radius RADIUS touches the block (0, 100)×(−200, 0) at the
origin. Volumes are ``roller`` and ``block``. Curves are ``x0`` (of both), ``crown`` (the roller's
top up to x = CROWN), ``bottom`` (y = −200), and the contact curves ``roller_seam`` and
``block_seam`` (up to x = SEAM). The bodies have separate meshes.
"""

import math
from pathlib import Path

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session

RADIUS, SIDE, DEPTH = 50.0, 100.0, 200.0
"""Radius of the disc, half of the block's width, and height of the block."""

SEAM, CROWN = 12.0, 5.0
"""Largest x of the contact curves, and of the loaded curve."""


def write_roller_on_block(
    path: str | Path, contact_size: float = 0.5, size: float = 10.0, order: int = 2
) -> None:
    """Mesh half of the roller and of the block and write a .msh file. Not collective.

    Args:
        path: The file to write.
        contact_size: Edge length about the origin; two thirds of it in the block.
        size: Largest edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        side, top = (math.sqrt(RADIUS**2 - x**2) for x in (SEAM, CROWN))
        places = [(0, 0), (SEAM, RADIUS - side), (CROWN, RADIUS + top), (0, 2 * RADIUS)]
        low, end, shoulder, high = [occ.addPoint(x, y, 0.0) for x, y in places]
        centre = occ.addPoint(0.0, RADIUS, 0.0)
        arcs = [occ.addCircleArc(a, centre, b) for a, b in ((low, end), (end, shoulder))]
        crown, axis = occ.addCircleArc(shoulder, centre, high), occ.addLine(high, low)
        roller = add_polygon([*arcs, crown, axis])
        corners = [(0.0, -DEPTH), (SIDE, -DEPTH), (SIDE, 0.0), (SEAM, 0.0), (0.0, 0.0)]
        bottom, side_line, free, seam, middle = add_outline(corners)
        block = add_polygon([bottom, side_line, free, seam, middle])
        occ.synchronize()
        name(2, {"roller": [roller], "block": [block]})
        name(1, {"x0": [axis, middle], "crown": [crown], "bottom": [bottom]})
        name(1, {"roller_seam": [arcs[0]], "block_seam": [seam]})

        def mesh(body: str) -> None:
            near = contact_size if body == "roller" else contact_size / 1.5
            generate(2, finer_at((0.0, 0.0), near, size, flat=0.75 * SEAM), order)

        write_apart(path, mesh)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_roller_on_block, "Mesh a roller on a block.")
    parser.add_argument("--contact-size", type=float, help="edge length about the origin")
    write_from(parser, write_roller_on_block)


if __name__ == "__main__":
    main()
