"""Mesh a quarter of a half-ball that touches a plane, or its mirror image, at a point.

The body is a quarter (x, y ≥ 0) of the lower half of the ball of radius RADIUS about (0, 0,
RADIUS), which touches z = 0 at the origin. The volume is ``upper``. Surfaces are ``x0``, ``y0``,
``top`` (z = RADIUS), ``upper_cap`` (the sphere up to the distance CAP from the z axis, where
contact is possible) and ``upper_free`` (the rest of the sphere). A second body is the image in z =
0, with ``lower``, ``lower_cap``, ``lower_free`` and ``bottom``; ``x0`` and ``y0`` then belong to
both. The nodes are exact mirror images unless the bodies have separate meshes. At the origin each
body has a node of its own.
"""

import math
from pathlib import Path

from meshes.apart import meshed_body, write_bodies
from meshes.command_line import mesh_parser, write_from
from meshes.mirror import add_mirror_image
from meshes.naming import name
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADIUS, CAP, FINE = 1.0, 0.3, 0.15
"""Radius; radius of the contact surface; radius of the finest part about the origin."""


def write_hertz_sphere(
    path: str | Path,
    contact_size: float = 0.03,
    bodies: int = 1,
    size: float = 0.3,
    order: int = 1,
    finer: float | None = None,
) -> None:
    """Mesh a quarter of a half-ball, and its image, and write a .msh file. Not collective.

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
        geo = gmsh.model.geo
        height = RADIUS - math.sqrt(RADIUS**2 - CAP**2)
        origin = geo.addPoint(0.0, 0.0, 0.0)
        centre = geo.addPoint(0.0, 0.0, RADIUS)
        inside = geo.addPoint(0.0, 0.0, height)  # of the circle that bounds the cap

        # Half-planes y = 0 and x = 0: from the origin along the sphere to the plane of the centre.
        ends = [geo.addPoint(CAP, 0.0, height), geo.addPoint(0.0, CAP, height)]
        rims = [geo.addPoint(RADIUS, 0.0, RADIUS), geo.addPoint(0.0, RADIUS, RADIUS)]
        low = [geo.addCircleArc(origin, centre, end) for end in ends]
        high = [geo.addCircleArc(a, centre, b) for a, b in zip(ends, rims, strict=True)]
        tops = [geo.addLine(rim, centre) for rim in rims]
        axis = geo.addLine(centre, origin)
        brink, equator = (
            geo.addCircleArc(ends[0], inside, ends[1]),
            geo.addCircleArc(rims[0], centre, rims[1]),
        )

        def sphere(*curves: int) -> int:
            return geo.addSurfaceFilling([geo.addCurveLoop(curves)], sphereCenterTag=centre)

        def flat(*curves: int) -> int:
            return geo.addPlaneSurface([geo.addCurveLoop(curves)])

        cap = sphere(low[0], brink, -low[1])
        free = sphere(high[0], equator, -high[1], -brink)
        y0, x0 = (flat(low[i], high[i], tops[i], axis) for i in range(2))
        top = flat(equator, tops[1], -tops[0])
        upper = geo.addVolume([geo.addSurfaceLoop([cap, free, y0, x0, top])])
        geo.synchronize()

        name(3, {"upper": [upper]})
        name(2, {"upper_cap": [cap], "upper_free": [free], "top": [top], "x0": [x0], "y0": [y0]})

        def mesh(near: float) -> None:
            generate(3, finer_at((0.0, 0.0, 0.0), near, size, flat=FINE), order)

        def mirror() -> None:
            names = {"upper": "lower", "upper_cap": "lower_cap", "upper_free": "lower_free"}
            add_mirror_image(2, names | {"top": "bottom", "x0": "x0", "y0": "y0"})

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
    parser = mesh_parser(write_hertz_sphere, "Mesh a half-ball on a plane, a quarter by symmetry.")
    parser.add_argument("--contact-size", type=float, help="edge length about the origin")
    parser.add_argument("--bodies", type=int, choices=(1, 2), help="2: its mirror image as well")
    parser.add_argument("--finer", type=float, help="mesh the image apart, so much finer")
    write_from(parser, write_hertz_sphere)


if __name__ == "__main__":
    main()
