"""Mesh a stiff wall, and ground that extends below the toe of the wall, in plane strain.

The ground is (0, width)×(-depth, 1) without the wall, which is (-1/2, 0)×(0, 1). Volumes are
``ground`` and ``wall``. Curves are ``top`` (the ground's), ``side``, ``bottom``, ``below`` (the
ground's face below the toe), ``back``, ``crest`` and ``base`` of the wall, and the contact curves
``ground_face`` and ``wall_face``, whose nodes match.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, DEPTH = 6.0, 1.0
"""Default extent of the ground beside and below a wall of height 1."""


def write_retaining_wall(
    path: str | Path,
    width: float = WIDTH,
    depth: float = DEPTH,
    grading: float = 1.0,
    size: float = 0.5,
    order: int = 1,
) -> None:
    """Mesh the wall and the ground and write a .msh file. Not collective.

    Args:
        path: The file to write.
        width: Width of the ground.
        depth: Depth of the ground below the toe.
        grading: Factor by which the elements are smaller at the wall's top.
        size: Edge length elsewhere.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        toe, edge = (0.0, 0.0), (0.0, 1.0)
        outline = [toe, (0.0, -depth), (width, -depth), (width, 1.0), edge]
        points = [occ.addPoint(x, y, 0.0) for x, y in outline]
        below, bottom, side, top, face = map(occ.addLine, points, points[1:] + points[:1])
        behind = [occ.addPoint(-0.5, y, 0.0) for y in (1.0, 0.0)]
        chain = [points[4], *behind, points[0]]
        crest, back, base = map(occ.addLine, chain, chain[1:])
        ground = add_polygon([below, bottom, side, top, face])
        wall = add_polygon([crest, back, base, face])
        occ.synchronize()
        name(2, {"ground": [ground], "wall": [wall]})
        own = {"below": below, "bottom": bottom, "side": side, "top": top, "face": face}
        own |= {"crest": crest, "back": back, "base": base}
        name(1, {label: [curve] for label, curve in own.items()})
        generate(2, finer_at((*edge,), size / grading, size, reach=1.0), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_retaining_wall, "Mesh a wall and the ground beside it.")
    parser.add_argument("--width", type=float, help="width of the ground")
    parser.add_argument("--depth", type=float, help="depth of the ground below the toe")
    parser.add_argument("--grading", type=float, help="how much smaller elements are at the top")
    write_from(parser, write_retaining_wall)


if __name__ == "__main__":
    main()
