"""Mesh an octant of a round socket and of the ball that fills it: contact on a whole sphere.

Both are centred at the origin. Volumes are ``ball`` and ``socket``. Surfaces are ``outer`` (of the
socket), ``x0``, ``y0`` and ``z0`` (the symmetry planes of both bodies), and the contact surfaces
``ball_seam`` and ``socket_seam``. Their nodes match unless the bodies have separate meshes.
"""

import math
from pathlib import Path

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name, name_planes
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADIUS, OUTER = 1.0, 2.0
"""Radii of the ball and of the socket."""


def write_ball_in_socket(
    path: str | Path, size: float = 0.35, order: int = 2, finer: float | None = None
) -> None:
    """Mesh an octant of both bodies and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length in the ball; outside the ball it grows in proportion to the radius.
        order: Degree of the geometry, 1 or 2.
        finer: Mesh both bodies separately, and multiply the number of the socket's edges at the
            seam by this factor.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        right = math.pi / 2
        whole, ball = (
            (3, occ.addSphere(0, 0, 0, radius, angle1=0, angle2=right, angle3=right))
            for radius in (OUTER, RADIUS)
        )
        occ.fragment([whole], [ball])
        occ.synchronize()
        masses = {tag: occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3)}
        small, large = sorted(masses, key=masses.__getitem__)
        name(3, {"ball": [small], "socket": [large]})
        name_planes(2, {"x0": (0, 0.0), "y0": (1, 0.0), "z0": (2, 0.0)})
        areas = {tag: occ.getMass(2, tag) for _, tag in gmsh.model.getEntities(2)}
        round_ = [tag for tag in areas if gmsh.model.getType(2, tag) == "Sphere"]
        seam, outer = sorted(round_, key=areas.__getitem__)
        name(2, {"seam": [seam], "outer": [outer]})

        def mesh(body: str = "") -> None:
            near = size / finer if finer and body == "socket" else size
            generate(3, lambda x, y, z: near * max(1.0, math.hypot(x, y, z)), order)

        if finer is None:
            mesh()
            write_split(path)
        else:
            write_apart(path, mesh)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_ball_in_socket, "Mesh an octant of a ball in a round socket.")
    parser.add_argument("--finer", type=float, help="mesh them apart, the socket so much finer")
    write_from(parser, write_ball_in_socket)


if __name__ == "__main__":
    main()
