"""Mesh a strip footing in plane strain, with fans of long thin cells at the footing's ends.

The ground is (-WIDTH, WIDTH)×(-DEPTH, 0); the footing is the part |x| ≤ 1 of y = 0. The volume is
``ground``. Curves are ``bottom``, ``sides``, ``footing`` and ``free`` (the rest of y = 0). At
either end of the footing, stresses depend on the direction. A fan of cells begins at the free
surface and covers two thirds of the half plane. Each of its cells extends from the end of the
footing to ``RADIUS``.
"""

import math
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, DEPTH = 6.0, 4.0
"""Extent of the ground; half of the footing's width is 1."""
RADIUS = 1.0
"""Radius of the fans, which is half of the footing's width."""
ANGLE = math.radians(120.0)
"""Angle of each fan (radians)."""


def write_fanned_footing(
    path: str | Path, size: float = 1.2, order: int = 1, cells: int = 24
) -> None:
    """Mesh the ground and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Largest edge length.
        order: Degree of the geometry, 1 or 2.
        cells: Number of cells in each fan.
    """
    with gmsh_session() as gmsh:
        occ, straight = gmsh.model.occ, list[int]()
        middle, deep = occ.addPoint(0.0, 0.0, 0.0), occ.addPoint(0.0, -DEPTH, 0.0)
        axis = occ.addLine(middle, deep)
        ground, lines = list[int](), dict[str, list[int]]()
        for side in (1, -1):
            end = occ.addPoint(side, 0.0, 0.0)
            turns = [ANGLE * i / cells for i in range(cells + 1)]
            around = [
                occ.addPoint(side * (1 + RADIUS * math.cos(turn)), -RADIUS * math.sin(turn), 0.0)
                for turn in turns
            ]
            spokes = [occ.addLine(end, point) for point in around]
            chords = [occ.addLine(*around[i : i + 2]) for i in range(cells)]
            for i, chord in enumerate(chords):
                ground.append(add_polygon([spokes[i], chord, spokes[i + 1]]))
            straight += spokes + chords
            corners = [occ.addPoint(side * WIDTH, y, 0.0) for y in (-DEPTH, 0.0)]
            chain = [deep, *corners, around[0]]
            outer = [occ.addLine(*chain[i : i + 2]) for i in range(3)]
            footing = occ.addLine(end, middle)
            ground.append(add_polygon([axis, *outer, *chords, spokes[-1], footing]))
            parts = {"bottom": [outer[0]], "sides": [outer[1]], "free": [outer[2], spokes[0]]}
            for label, some in {**parts, "footing": [footing]}.items():
                lines.setdefault(label, []).extend(some)
        occ.synchronize()
        for line in straight:
            gmsh.model.mesh.setTransfiniteCurve(line, 2)
        name(2, {"ground": ground})
        name(1, lines)
        width, growth = RADIUS * ANGLE / cells, 0.4

        def law(x: float, y: float, z: float) -> float:
            away = min(abs(math.hypot(x - side, y) - RADIUS) for side in (1, -1))
            return min(size, width + growth * away)

        generate(2, law, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_fanned_footing, "Mesh a strip footing with fans at its ends.")
    parser.add_argument("--cells", type=int, help="of each fan")
    write_from(parser, write_fanned_footing)


if __name__ == "__main__":
    main()
