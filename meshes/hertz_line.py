"""Mesh half of a half-cylinder that touches a plane, or its mirror image, along a line.

The section in the plane z = 0 is a quarter of the disc of radius RADIUS about (0, RADIUS), with 0 ≤
x and 0 ≤ y ≤ RADIUS. It touches y = 0 at the origin. The volume is ``upper``. Curves are ``x0``,
``top`` (y = RADIUS), ``upper_arc`` (the arc up to x = ARC, where contact is possible) and
``upper_free`` (the rest of the arc). A second body is the image in y = 0, with ``lower``,
``lower_arc``, ``lower_free`` and ``bottom``; ``x0`` then belongs to both. The nodes are exact
mirror images unless the bodies have separate meshes. At the origin each body has a node of its own.
"""

import math
from pathlib import Path

from meshes.apart import meshed_body, write_bodies
from meshes.command_line import mesh_parser, write_from
from meshes.mirror import add_mirror_image
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADIUS, ARC, FINE = 1.0, 0.3, 0.15
"""Radius; largest x of the contact curve; radius of the finest part about the origin."""


def write_hertz_line(
    path: str | Path,
    contact_size: float = 0.01,
    bodies: int = 1,
    size: float = 0.2,
    order: int = 1,
    finer: float | None = None,
) -> None:
    """Mesh half of a half-cylinder, and its image, and write a .msh file. Not collective.

    Args:
        path: The file to write.
        contact_size: Edge length up to the distance FINE from the origin; from there it grows to
            ``size``.
        bodies: 1, or 2 for the mirror image as well.
        size: Largest edge length.
        order: Degree of the geometry, 1 or 2.
        finer: Mesh the image separately, with edges that are shorter by this factor.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        height = RADIUS - math.sqrt(RADIUS**2 - ARC**2)
        places = [(0.0, 0.0), (ARC, height), (RADIUS, RADIUS), (0.0, RADIUS)]
        origin, end, rim, centre = [occ.addPoint(x, y, 0.0) for x, y in places]
        arc = occ.addCircleArc(origin, centre, end)
        free = occ.addCircleArc(end, centre, rim)
        top, axis = occ.addLine(rim, centre), occ.addLine(centre, origin)
        upper = add_polygon([arc, free, top, axis])
        occ.synchronize()

        name(2, {"upper": [upper]})
        name(1, {"upper_arc": [arc], "upper_free": [free], "top": [top], "x0": [axis]})

        def mesh(near: float) -> None:
            generate(2, finer_at((0.0, 0.0), near, size, flat=FINE), order)

        def mirror() -> None:
            names = {"upper": "lower", "upper_arc": "lower_arc", "upper_free": "lower_free"}
            add_mirror_image(1, names | {"top": "bottom", "x0": "x0"})

        mesh(contact_size)
        if bodies == 1:
            write_split(path)
        elif finer is None:
            mirror()
            write_split(path)
        else:
            upper_mesh = meshed_body("upper")
            gmsh.model.mesh.clear()
            mesh(contact_size / finer)
            mirror()
            write_bodies(path, [upper_mesh, meshed_body("lower")])


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_hertz_line, "Mesh a half-cylinder on a plane, half by symmetry.")
    parser.add_argument("--contact-size", type=float, help="edge length about the origin")
    parser.add_argument("--bodies", type=int, choices=(1, 2), help="2: its mirror image as well")
    parser.add_argument("--finer", type=float, help="mesh the image apart, so much finer")
    write_from(parser, write_hertz_line)


if __name__ == "__main__":
    main()
