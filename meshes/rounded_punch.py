"""Mesh a round punch with rounded edges on a round foundation: NAFEMS' second contact benchmark.

The mesh is half of the section of bodies of revolution about x = 0, in millimetres. The punch (0,
50)×(0, 100), whose edge has the radius FILLET, stands on the foundation (0, 100)×(−200, 0). Volumes
are ``punch`` and ``foundation``. Curves are ``top`` (of the punch), ``bottom``, ``side`` (of the
foundation), and the contact curves ``punch_seam`` (with the fillet) and ``foundation_seam`` (as far
as x = 50). The bodies have separate meshes.
"""

from pathlib import Path

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session

PUNCH, FILLET, HEIGHT = 50.0, 10.0, 100.0
"""Radius of the punch, radius of its edge, and its height."""

FOUNDATION, DEPTH = 100.0, 200.0
"""Radius and height of the foundation."""


def write_rounded_punch(
    path: str | Path, contact_size: float = 0.5, size: float = 8.0, order: int = 2
) -> None:
    """Mesh the section and write a .msh file. Not collective.

    Args:
        path: The file to write.
        contact_size: Edge length at the beginning of the fillet; two thirds of it in the
            foundation.
        size: Largest edge length.
        order: Degree of the geometry, 1 or 2.
    """
    flat = PUNCH - FILLET
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        places = [(0.0, 0.0), (flat, 0.0), (PUNCH, FILLET), (PUNCH, HEIGHT), (0.0, HEIGHT)]
        points = [occ.addPoint(x, y, 0.0) for x, y in places]
        centre = occ.addPoint(flat, FILLET, 0.0)
        under = occ.addLine(points[0], points[1])
        fillet = occ.addCircleArc(points[1], centre, points[2])
        others = [occ.addLine(points[k], points[(k + 1) % 5]) for k in (2, 3, 4)]
        punch = add_polygon([under, fillet, *others])
        corners = [(0.0, -DEPTH), (FOUNDATION, -DEPTH), (FOUNDATION, 0.0)]
        bottom, side, free, seam, middle = add_outline([*corners, (PUNCH, 0.0), (0.0, 0.0)])
        foundation = add_polygon([bottom, side, free, seam, middle])
        occ.synchronize()
        name(2, {"punch": [punch], "foundation": [foundation]})
        name(1, {"top": [others[1]], "bottom": [bottom], "side": [side]})
        name(1, {"punch_seam": [under, fillet], "foundation_seam": [seam]})

        def mesh(body: str) -> None:
            near = contact_size if body == "punch" else contact_size / 1.5
            generate(2, finer_at((flat, 0.0), near, size, flat=FILLET / 2), order)

        write_apart(path, mesh)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_rounded_punch, "Mesh a punch with rounded edges.")
    parser.add_argument("--contact-size", type=float, help="edge length where the fillet begins")
    write_from(parser, write_rounded_punch)


if __name__ == "__main__":
    main()
