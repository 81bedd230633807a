"""Mesh a hollow shaft with eight flat thin walls around the z axis.

The centre lines of the walls have the distance 1 from the axis. The shaft is ``LENGTH`` long, and
its walls are ``THICK``. The volume is ``shaft``. Surfaces are ``bottom0`` ... ``bottom7`` (z = 0)
and ``top0`` ... ``top7``, each of one wall: wall i faces the angle 45° i. The surface ``held`` is a
square in the middle of the bottom of wall 0, which ``bottom0`` omits.
"""

import math
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

SIDES, LENGTH, THICK = 8, 1.0, 0.05


def write_hollow_shaft(path: str | Path, size: float = 0.5, order: int = 1) -> None:
    """Mesh the shaft and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length along walls.
        order: Degree of the geometry, 1 or 2.
    """
    half = math.pi / SIDES

    def at(distance: float, turn: float) -> tuple[float, float]:
        radius = distance / math.cos(half)
        return radius * math.cos(turn), radius * math.sin(turn)

    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        inner, outer = 1 - THICK / 2, 1 + THICK / 2
        walls = []
        for i in range(SIDES):
            a, b = half * (2 * i - 1), half * (2 * i + 1)
            corners = [at(inner, a), at(outer, a), at(outer, b), at(inner, b)]
            section = add_polygon(add_outline(corners))
            ends = occ.extrude([(2, section)], 0.0, 0.0, LENGTH)
            walls.append(next(tag for dim, tag in ends if dim == 3))
        solids = [(3, wall) for wall in walls]
        square = occ.addRectangle(inner, -THICK / 2, 0.0, THICK, THICK)
        _, parts = occ.fragment(solids[:1], [*solids[1:], (2, square)])
        occ.synchronize()
        name(3, {"shaft": [tag for part in parts[:-1] for _, tag in part]})
        ends_of = {"held": [tag for _, tag in parts[-1]]}
        for dim, tag in gmsh.model.getEntities(2):
            x, y, z = occ.getCenterOfMass(dim, tag)
            wall = round(math.atan2(y, x) / (2 * half)) % SIDES
            if tag in ends_of["held"]:
                continue
            if abs(z) < 1e-9 or abs(z - LENGTH) < 1e-9:
                ends_of.setdefault(f"{'top' if z > LENGTH / 2 else 'bottom'}{wall}", []).append(tag)
        name(2, ends_of)
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_hollow_shaft, "Mesh a hollow shaft of eight walls.")
    write_from(parser, write_hollow_shaft)


if __name__ == "__main__":
    main()
