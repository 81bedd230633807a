"""Mesh a slope of homogeneous ground: crest, face and, with a foundation, toe.

Surfaces are "crest", "face", "bottom" and "left"; with a foundation also "toe" and "right".
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_slope(
    path: str | Path,
    height: float = 1.0,
    run: float = 2.0,
    back: float = 1.2,
    depth: float = 0.0,
    front: float = 1.2,
    size: float = 0.15,
    order: int = 1,
) -> None:
    """Mesh the slope and write a .msh file. Not collective.

    Args:
        path: The file to write.
        height: Height of the slope.
        run: Horizontal length of the slope.
        back: Length of the crest.
        depth: Depth of the foundation; 0 for firm ground at the level of the toe.
        front: Length of the ground in front of the toe, with a foundation.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    points = [(0.0, 0.0), (back, 0.0), (back + run, -height)]
    names = ["crest", "face"]
    if depth:
        points += [(back + run + front, -height), (back + run + front, -height - depth)]
        names += ["toe", "right"]
    points.append((0.0, -height - depth))
    names += ["bottom", "left"]
    with gmsh_session() as gmsh:
        curves = add_outline(points)
        soil = add_polygon(curves)
        gmsh.model.occ.synchronize()

        name(2, {"soil": [soil]})
        name(1, {of: [curve] for of, curve in zip(names, curves, strict=True)})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_slope, "Mesh a slope.")
    parser.add_argument("--height", type=float, help="of the slope")
    parser.add_argument("--run", type=float, help="its length, level")
    parser.add_argument("--back", type=float, help="length of the crest")
    parser.add_argument("--depth", type=float, help="of the foundation, 0 for firm ground")
    parser.add_argument("--front", type=float, help="length of the toe, on a foundation")
    write_from(parser, write_slope)


if __name__ == "__main__":
    main()
