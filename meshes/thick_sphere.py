"""Mesh an octant of a thick spherical shell, as one shell or as two nested shells.

The shell is centred at the origin. The volume is ``shell``. Surfaces are ``inner``, ``outer``,
``x0``, ``y0`` and ``z0`` (the symmetry planes). With an interface the volumes are ``inner_shell``
and ``outer_shell``. Then the contact surfaces are ``inner_shell_seam`` and ``outer_shell_seam``,
whose nodes match unless the shells have separate meshes.

Vertices lie on the spheres, so flat facets cut the spheres: the body of the mesh extends into the
hole, and is smaller at the outside. The facets of a *circumscribed* sphere touch it from outside
instead. A stress of a body with a larger hole, in which the pressure fills the rest, is a stress of
the shell. A mechanism of a larger body is also a mechanism of the shell.
"""

import math
from itertools import pairwise
from pathlib import Path

import gmsh
import numpy as np

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.sizes import generate
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh import gmsh_session, write_split

INNER, OUTER = 1.0, 2.0
"""Radii of the shell."""


def write_thick_sphere(
    path: str | Path,
    interface: float | None = None,
    size: float = 0.2,
    order: int = 1,
    finer: float | None = None,
    circumscribed: str | None = None,
) -> None:
    """Mesh an octant of a shell and write a .msh file. Not collective.

    Args:
        path: The file to write.
        interface: Radius at which the shell is divided in two; None for one shell.
        size: Edge length at the inner radius, which is 1; it grows in proportion to the radius.
        order: Degree of the geometry, 1 or 2.
        circumscribed: ``inner`` or ``outer``: the surface whose vertices move outwards until none
            of its facets cuts its sphere.
        finer: Mesh two shells separately, and multiply the number of the outer shell's edges at the
            seam by this factor.

    Raises:
        InputError: If curved facets are to be circumscribed.
    """
    if circumscribed is not None and order != 1:
        raise InputError(
            f"order = {order} and circumscribed facets, which are flat; give order = 1."
        )
    with gmsh_session():
        geo = gmsh.model.geo
        radii = [INNER, OUTER] if interface is None else [INNER, interface, OUTER]
        bodies = ["shell"] if interface is None else ["inner_shell", "outer_shell"]
        centre = geo.addPoint(0.0, 0.0, 0.0)

        # Each sphere is a triangle of three arcs: from the x axis to the y axis, and so on.
        corners = [[geo.addPoint(*row) for row in ((r, 0, 0), (0, r, 0), (0, 0, r))] for r in radii]
        arcs = [
            [geo.addCircleArc(points[i], centre, points[(i + 1) % 3]) for i in range(3)]
            for points in corners
        ]
        spheres = [
            geo.addSurfaceFilling([geo.addCurveLoop(triangle)], sphereCenterTag=centre)
            for triangle in arcs
        ]
        volumes, planes = [], []
        for i, ((inside, outside), (below, above)) in enumerate(
            zip(pairwise(corners), pairwise(arcs), strict=True)
        ):
            rays = [geo.addLine(a, b) for a, b in zip(inside, outside, strict=True)]
            loops = [
                geo.addCurveLoop([rays[j], above[j], -rays[(j + 1) % 3], -below[j]])
                for j in range(3)
            ]
            planes.append([geo.addPlaneSurface([loop]) for loop in loops])
            shell = geo.addSurfaceLoop([spheres[i], spheres[i + 1], *planes[-1]])
            volumes.append(geo.addVolume([shell]))
        geo.synchronize()

        name(3, {body: [volume] for body, volume in zip(bodies, volumes, strict=True)})
        z0, x0, y0 = zip(*planes, strict=True)
        name(2, {"inner": spheres[:1], "outer": spheres[-1:], "x0": x0, "y0": y0, "z0": z0})
        if interface is not None:
            name(2, {"seam": spheres[1:2]})

        def mesh(body: str = "") -> None:
            near = size / finer if finer and body == "outer_shell" else size
            generate(3, lambda x, y, z: near * math.hypot(x, y, z), order)

        if finer is None:
            mesh()
            if circumscribed is not None:
                _circumscribe(spheres[0] if circumscribed == "inner" else spheres[-1])
            write_split(path)
        else:
            write_apart(path, mesh)


def _circumscribe(sphere: int) -> None:
    """Move the vertices of a sphere outwards until all its facets touch it or lie outside it."""
    mesh = gmsh.model.mesh
    tags, places, _ = mesh.getNodes(2, sphere, includeBoundary=True)
    points = dict(zip(tags, places.reshape(-1, 3), strict=True))
    _, _, (nodes,) = mesh.getElements(2, sphere)
    a, b, c = np.array([points[node] for node in nodes]).reshape(-1, 3, 3).swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    distance = np.abs(np.einsum("fi,fi->f", a, normals)) / np.linalg.norm(normals, axis=1)
    factor = np.linalg.norm(a, axis=1).max() / distance.min()
    for node, point in points.items():
        mesh.setNode(node, factor * point, [])


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_thick_sphere, "Mesh an octant of a thick spherical shell.")
    parser.add_argument("--interface", type=float, help="radius at which to cut the shell in two")
    parser.add_argument(
        "--circumscribed", choices=("inner", "outer"), help="surface that does not cut its sphere"
    )
    parser.add_argument("--finer", type=float, help="mesh them apart, the outer one so much finer")
    write_from(parser, write_thick_sphere)


if __name__ == "__main__":
    main()
