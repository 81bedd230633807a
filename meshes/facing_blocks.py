"""Mesh two rectangles that face each other on y = 0 with matching nodes, finer near a point.

The volume ``lower`` is (left, right)×(−below, 0), and ``upper`` is (left, right)×(0, above). Curves
are ``left`` and ``right`` (both bodies), ``bottom``, ``top``, and the contact curves ``lower_seam``
and ``upper_seam``.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_facing_blocks(
    path: str | Path,
    left: float = -1.0,
    right: float = 1.0,
    below: float = 1.0,
    above: float = 1.0,
    finest_at: float = 0.0,
    flat: float = 0.15,
    fine: float = 0.01,
    size: float = 0.2,
    order: int = 1,
) -> None:
    """Mesh the two blocks and write a .msh file. Not collective.

    Args:
        path: The file to write.
        left: Smallest x.
        right: Largest x.
        below: Height of the lower block.
        above: Height of the upper block.
        finest_at: Coordinate x of the point on y = 0 near which the elements are smallest.
        flat: Radius of the finest part.
        fine: Edge length in this part; outside it the edge length grows to ``size``.
        size: Largest edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        lower = add_box([left, -below], [right - left, below])
        upper = add_box([left, 0.0], [right - left, above])
        _, ((low,), (high,)) = gmsh.model.occ.fragment([lower], [upper])
        gmsh.model.occ.synchronize()
        name(2, {"lower": [low[1]], "upper": [high[1]]})
        sides = {"left": (0, left), "right": (0, right), "bottom": (1, -below), "top": (1, above)}
        name_planes(1, sides)
        name(1, {"seam": interface(1)})
        generate(2, finer_at((finest_at, 0.0), fine, size, flat=flat), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_facing_blocks, "Mesh two blocks that face each other.")
    write_from(parser, write_facing_blocks)


if __name__ == "__main__":
    main()
