"""Curved bodies that were meshed apart: tubes and spheres, one in the other."""

import math
from pathlib import Path

import gmsh
import numpy as np

from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADII = (1.0, 1.15, 1.3)


def write_tubes_apart(
    path: str | Path, size: float = 0.05, finer: float = 1.5, order: int = 2
) -> None:
    """Two quarters of tubes as `meshes/thick_tube.py` makes them, with unlike nodes at the seam.

    Args:
        path: The file to write.
        size: Edge length at the inner radius.
        finer: How many times as many edges the outer tube has at the seam.
        order: Degree of the geometry.
    """
    with gmsh_session() as session:
        occ = session.model.occ
        faces, arcs, lines = [], [], []
        for inner, outer in ((RADII[0], RADII[1]), (RADII[1], RADII[2])):
            centre = occ.addPoint(0.0, 0.0, 0.0)
            below = [occ.addPoint(radius, 0.0, 0.0) for radius in (inner, outer)]
            above = [occ.addPoint(0.0, radius, 0.0) for radius in (inner, outer)]
            both = [occ.addCircleArc(a, centre, b) for a, b in zip(below, above, strict=True)]
            ends = [occ.addLine(*below), occ.addLine(*above)]
            faces.append(add_polygon([ends[0], both[1], ends[1], both[0]]))
            arcs.append(both)
            lines.append(ends)
        occ.synchronize()
        name(2, {"inner_tube": [faces[0]], "outer_tube": [faces[1]]})
        name(1, {"inner": [arcs[0][0]], "outer": [arcs[1][1]]})
        name(1, {"inner_tube_seam": [arcs[0][1]], "outer_tube_seam": [arcs[1][0]]})
        name(1, {"y0": [ends[0] for ends in lines], "x0": [ends[1] for ends in lines]})
        edges = math.ceil(math.pi / 2 / size)
        gmsh.model.mesh.setTransfiniteCurve(arcs[0][1], edges + 1)
        gmsh.model.mesh.setTransfiniteCurve(arcs[1][0], round(finer * edges) + 1)
        generate(2, lambda x, y, z: size * math.hypot(x, y), order)
        write_split(path)


def write_shells_apart(
    path: str | Path, size: float = 0.35, finer: float = 1.4, order: int = 2
) -> None:
    """Octants of two spherical shells, of radii 1, 1.4 and 2, with unlike nodes at the seam.

    Args:
        path: The file to write.
        size: Edge length at the inner radius.
        finer: How many times as many edges the outer shell has at the seam.
        order: Degree of the geometry.
    """
    with gmsh_session() as session:
        geo = session.model.geo
        centre = geo.addPoint(0.0, 0.0, 0.0)
        volumes, planes, spheres, seams = [], [], [], []
        for radii in ((1.0, 1.4), (1.4, 2.0)):
            corners = [[geo.addPoint(*row) for row in np.eye(3) * radius] for radius in radii]
            arcs = [
                [geo.addCircleArc(points[i], centre, points[(i + 1) % 3]) for i in range(3)]
                for points in corners
            ]
            both = [
                geo.addSurfaceFilling([geo.addCurveLoop(triangle)], sphereCenterTag=centre)
                for triangle in arcs
            ]
            rays = [geo.addLine(a, b) for a, b in zip(*corners, strict=True)]
            loops = [
                geo.addCurveLoop([rays[j], arcs[1][j], -rays[(j + 1) % 3], -arcs[0][j]])
                for j in range(3)
            ]
            planes.append([geo.addPlaneSurface([loop]) for loop in loops])
            volumes.append(geo.addVolume([geo.addSurfaceLoop([*both, *planes[-1]])]))
            spheres.append(both)
            seams.append(arcs)
        geo.synchronize()
        name(3, {"inner_shell": volumes[:1], "outer_shell": volumes[1:]})
        name(2, {"inner": [spheres[0][0]], "outer": [spheres[1][1]]})
        name(2, {"inner_shell_seam": [spheres[0][1]], "outer_shell_seam": [spheres[1][0]]})
        name(2, dict(zip(("z0", "x0", "y0"), zip(*planes, strict=True), strict=True)))
        edges = math.ceil(math.pi / 2 / size)
        for arc in seams[0][1]:
            gmsh.model.mesh.setTransfiniteCurve(arc, edges + 1)
        for arc in seams[1][0]:
            gmsh.model.mesh.setTransfiniteCurve(arc, round(finer * edges) + 1)
        generate(3, lambda x, y, z: size * math.sqrt(x * x + y * y + z * z), order)
        write_split(path)
