"""Mesh half of the section of a vessel with a torispherical head, about the axis x = 0.

The inner surface consists of a cylinder, a knuckle and a crown, which join smoothly. The cylinder
has the radius RADIUS for −height ≤ y ≤ 0. The centre of the knuckle is on y = 0, and the centre of
the crown is on the axis. The wall has the thickness THICKNESS. The volume is ``vessel``. Curves are
``inside``, ``outside``, ``x0`` (on the axis) and ``end`` (y = −height). The default lengths are
those of the vessel in the benchmark LISA, in mm.
"""

import math
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADIUS, THICKNESS, CROWN, KNUCKLE = 49.0, 2.0, 98.0, 20.0
"""Inner radius of the cylinder; thickness; inner radii of crown and knuckle."""
HEIGHT = 40.0
"""Default height of the cylinder: four times √(radius · thickness)."""


def write_torispherical_head(
    path: str | Path,
    size: float = 0.5,
    height: float = HEIGHT,
    crown: float = CROWN,
    knuckle: float = KNUCKLE,
    order: int = 1,
) -> None:
    """Mesh half a section and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
        height: Height of the cylinder.
        crown: Inner radius of the crown.
        knuckle: Inner radius of the knuckle.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        across = RADIUS - knuckle
        along = math.sqrt((crown - knuckle) ** 2 - across**2)
        way = (across / (crown - knuckle), along / (crown - knuckle))
        of_knuckle = occ.addPoint(across, 0.0, 0.0)
        of_crown = occ.addPoint(0.0, -along, 0.0)
        sides = []
        for out in (0.0, THICKNESS):
            end = occ.addPoint(RADIUS + out, -height, 0.0)
            tangent = occ.addPoint(RADIUS + out, 0.0, 0.0)
            reach = crown + out
            seam = occ.addPoint(reach * way[0], reach * way[1] - along, 0.0)
            pole = occ.addPoint(0.0, reach - along, 0.0)
            curves = [
                occ.addLine(end, tangent),
                occ.addCircleArc(tangent, of_knuckle, seam),
                occ.addCircleArc(seam, of_crown, pole),
            ]
            sides.append((end, pole, curves))
        (end, pole, inside), (outer_end, outer_pole, outside) = sides
        axis, foot = occ.addLine(pole, outer_pole), occ.addLine(outer_end, end)
        face = add_polygon([*inside, axis, *reversed(outside), foot])
        occ.synchronize()

        name(2, {"vessel": [face]})
        name(1, {"inside": inside, "outside": outside, "x0": [axis], "end": [foot]})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_torispherical_head, "Mesh half a section of a vessel with a head.")
    parser.add_argument("--height", type=float, help="of the cylinder")
    parser.add_argument("--crown", type=float, help="inner radius of the crown")
    parser.add_argument("--knuckle", type=float, help="inner radius of the knuckle")
    write_from(parser, write_torispherical_head)


if __name__ == "__main__":
    main()
