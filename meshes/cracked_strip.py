"""Mesh a quarter, by symmetry, of a strip with a crack or a notch.

The strip is (0, width)×(0, length), and its bottom y = 0 is divided at the crack tip. The volume is
``strip``. Curves are ``x0``, ``side`` (x = width), ``top`` (y = length), ``inner`` (y = 0, x ≤ tip)
and ``outer`` (y = 0, x ≥ tip). Hold ``inner`` for two notches from the sides, and ``outer`` for a
slit in the middle.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

FINER = 16.0
"""Default ratio of the largest to the smallest edge length, which is at the tip."""


def write_cracked_strip(
    path: str | Path,
    width: float = 1.0,
    length: float = 2.0,
    tip: float = 0.5,
    grading: float = FINER,
    size: float = 0.05,
    order: int = 1,
) -> None:
    """Mesh a quarter of the strip and write a .msh file. Not collective.

    Args:
        path: The file to write.
        width: Half of the strip's width.
        length: Half of the strip's length.
        tip: Coordinate x of the tip on the line y = 0, between 0 and ``width``.
        grading: Factor by which the elements are smaller at the tip.
        size: Edge length around the tip, up to a distance of twice the shorter part of the bottom;
            it grows beyond.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        corners = [(0.0, 0.0), (tip, 0.0), (width, 0.0), (width, length), (0.0, length)]
        lines = add_outline(corners)
        strip = add_polygon(lines)
        gmsh.model.occ.synchronize()

        name(2, {"strip": [strip]})
        labels = ("inner", "outer", "side", "top", "x0")
        name(1, {label: [line] for label, line in zip(labels, lines, strict=True)})
        reach = 2.0 * min(tip, width - tip)
        generate(2, finer_at((tip, 0.0), size / grading, size, reach=reach), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_cracked_strip, "Mesh a quarter of a strip with a crack.")
    parser.add_argument("--width", type=float, help="half of the strip's width")
    parser.add_argument("--length", type=float, help="half of the strip's length")
    parser.add_argument("--tip", type=float, help="x of the crack's tip")
    parser.add_argument("--grading", type=float, help="how much smaller elements are at the tip")
    write_from(parser, write_cracked_strip)


if __name__ == "__main__":
    main()
