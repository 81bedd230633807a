"""Mesh two brackets bolted onto a plate, with a rod between them: ten bodies, sixteen contacts.

The plate lies below z = 0, with its long side along x. Each bracket has a foot on the plate, an
upright, and three carriage bolts; a bolt and its nut are one body. The square neck of a bolt in the
foot prevents it from turning, and its round shank fits the plate. The rod has a square end in one
upright and a round end in the other, with a nut outside each upright. Only the plate has supports;
contact alone holds the other bodies.

Volumes are ``plate``, ``bracket_1`` and ``bracket_2``, ``bolt_1`` to ``bolt_6``, and ``rod``.
Surfaces are ``ends`` (the plate's short sides) and ``grip`` (the middle of the rod). Each pair of
touching bodies has an interface ``joint_1``, …, whose sides have names such as ``plate_joint_1``.
Nodes match at an interface, unless the bodies have separate meshes. The generator also writes a
STEP file of the bodies beside the mesh.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import gmsh

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.joints import Solid, fragment, joints
from meshes.naming import interface, name
from meshes.shapes import add_box
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

LENGTH, WIDTH, THICKNESS = 240.0, 80.0, 10.0
"""Dimensions of the plate (mm)."""

FOOT, LEG, UPRIGHT, HEIGHT = 40.0, 8.0, 10.0, 60.0
"""Dimensions of a bracket (mm): length and thickness of its foot, thickness and height of its
upright."""

INNER = 50.0
"""Distance from the middle to an upright (mm)."""

SHANK, NECK, HEAD, HEAD_HEIGHT = 5.0, 12.0, 10.0, 6.0
"""Dimensions of a bolt (mm): shank's radius, neck's side, radius and height of the head."""

ROD, ROD_NECK, ROD_NUT, ROD_HEIGHT = 6.0, 14.0, 12.0, 38.0
"""Dimensions of the rod (mm): radius, side of its square end, circumradius of its nuts, height of
its axis."""

GRIP = 15.0
"""Half of the length of the rod on which it is pulled (mm)."""

ROWS = (-26.0, 0.0, 26.0)
"""Coordinates y of a bracket's bolts (mm)."""

ROUND = 10
"""Least number of elements around a circle."""

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def write_bolted_assembly(
    path: str | Path,
    size: float = 8.0,
    order: int = 1,
    glued: bool = False,
    apart: float | None = None,
) -> None:
    """Mesh the assembly and write a .msh and a .step file. Not collective.

    Args:
        path: The .msh file to write; the .step file has the same name except for the suffix.
        size: Largest edge length of the tetrahedra (mm); round parts have smaller ones.
        order: Degree of the geometry, 1 or 2.
        glued: Whether the bodies form one piece, for a comparison without contact.
        apart: Ratio of the edges of plate and rod to those of brackets and bolts, if each body is
            meshed separately; None for a common mesh.
    """
    with gmsh_session():
        parts = {"plate": _plate()}
        for number, side in ((1, -1), (2, 1)):
            parts[f"bracket_{number}"] = _bracket(side)
        places = [(side, y) for side in (-1, 1) for y in ROWS]
        for number, (side, y) in enumerate(places, start=1):
            parts[f"bolt_{number}"] = _bolt(side * (INNER + UPRIGHT + (FOOT - UPRIGHT) / 2), y)
        parts["rod"] = _rod()
        bodies = fragment(parts)
        gmsh.write(str(Path(path).with_suffix(".step")))
        name(3, bodies)
        ends = [tag for x in (-LENGTH / 2, LENGTH / 2) for tag in on_plane(2, 0, x)]
        name(2, {"ends": ends, "grip": _grip(bodies["rod"])} | joints(bodies))

        if apart:
            finer = {"bracket": apart, "bolt": apart**2}
            write_apart(
                path, lambda body: _generate(size, order, finer.get(body.split("_")[0], 1.0))
            )
            return
        _generate(size, order)
        if glued:
            gmsh.write(str(path))
        else:
            write_split(path)


def _generate(size: float, order: int, finer: float = 1.0) -> None:
    around = finer * max(ROUND, 2 * math.pi * SHANK / size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size / finer)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", around)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)


def _plate() -> list[Solid]:
    corner = (-LENGTH / 2, -WIDTH / 2, -THICKNESS)
    return [add_box(corner, (LENGTH, WIDTH, THICKNESS))]


def _bracket(side: int) -> list[Solid]:
    """Return the bracket on the side of positive or negative x."""
    foot = _from_middle(side, FOOT, (0.0, LEG))
    upright = _from_middle(side, UPRIGHT, (0.0, HEIGHT))
    return gmsh.model.occ.fuse([foot], [upright])[0]


def _from_middle(side: int, length: float, z: tuple[float, float]) -> Solid:
    """Return a box that begins at the place of an upright and is as wide as the plate."""
    x = INNER if side > 0 else -INNER - length
    return add_box((x, -WIDTH / 2, z[0]), (length, WIDTH, z[1] - z[0]))


def _bolt(x: float, y: float) -> list[Solid]:
    """Return a carriage bolt with its nut below the plate."""
    occ = gmsh.model.occ
    bottom = -THICKNESS - HEAD_HEIGHT
    head = occ.addCylinder(x, y, LEG, 0, 0, HEAD_HEIGHT, HEAD)
    neck = add_box((x - NECK / 2, y - NECK / 2, 0.0), (NECK, NECK, LEG))
    shank = occ.addCylinder(x, y, bottom, 0, 0, -bottom, SHANK)
    nut = _hexagon((x, y, bottom), Z, HEAD, HEAD_HEIGHT)
    return occ.fuse([(3, head)], [neck, (3, shank), nut])[0]


def _rod() -> list[Solid]:
    """Return the rod in three pieces, with the square end at negative x and the grip between."""
    occ = gmsh.model.occ
    outer = INNER + UPRIGHT
    low = (-outer, -ROD_NECK / 2, ROD_HEIGHT - ROD_NECK / 2)
    neck = add_box(low, (UPRIGHT, ROD_NECK, ROD_NECK))
    pieces = []
    for start, end, more in ((-outer, -GRIP, [neck]), (GRIP, outer, [])):
        shaft = occ.addCylinder(start, 0, ROD_HEIGHT, end - start, 0, 0, ROD)
        place = start - HEAD_HEIGHT if start < 0 else end
        nut = _hexagon((place, 0.0, ROD_HEIGHT), X, ROD_NUT, HEAD_HEIGHT)
        pieces += occ.fuse([(3, shaft)], [*more, nut])[0]
    return [*pieces, (3, occ.addCylinder(-GRIP, 0, ROD_HEIGHT, 2 * GRIP, 0, 0, ROD))]


def _hexagon(centre: Sequence[float], axis: Sequence[float], radius: float, height: float) -> Solid:
    """Return a hexagonal prism that extends from a centre along an axis."""
    occ = gmsh.model.occ
    along_x = axis[0] > 0
    corners = []
    for k in range(6):
        a, b = radius * math.cos(k * math.pi / 3), radius * math.sin(k * math.pi / 3)
        offset = (0.0, a, b) if along_x else (a, b, 0.0)
        corners.append(occ.addPoint(*(c + d for c, d in zip(centre, offset, strict=True))))
    lines = [occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    extruded = occ.extrude([(2, face)], *(height * component for component in axis))
    occ.remove([(2, face)])
    return next(entity for entity in extruded if entity[0] == 3)


def _grip(rod: list[int]) -> list[int]:
    """Return the outer face of the middle piece of the rod."""
    middle = next(t for t in rod if abs(gmsh.model.occ.getCenterOfMass(3, t)[0]) < GRIP)
    faces = gmsh.model.getAdjacencies(3, middle)[1]
    return [tag for tag in faces if tag not in interface(2)]


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_bolted_assembly, "Mesh a bolted assembly of ten bodies.")
    parser.add_argument("--glued", action="store_true", help="leave the bodies in one piece")
    parser.add_argument(
        "--apart", type=float, help="mesh bodies apart, brackets and bolts so much finer"
    )
    write_from(parser, write_bolted_assembly)


if __name__ == "__main__":
    main()
