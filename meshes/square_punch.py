"""Mesh a square punch 2×2 on a block of ground: a quarter of both by symmetry, or an eighth.

The ground is (0, WIDTH)²×(−DEPTH, 0), the punch (0, 1)²×(0, PUNCH). Volumes are ``ground`` and
``punch``. Surfaces are ``x0``, ``y0`` (the symmetry planes, of both bodies), ``bottom``, ``sides``
(x = WIDTH and y = WIDTH), ``top`` (of the punch), and the contact surfaces ``ground_seam`` and
``punch_seam``. The rest of z = 0 has no name. An eighth is the part y ≤ x, with the surface
``diagonal`` of both bodies instead of ``x0``.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes, on_diagonal
from meshes.shapes import add_block
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

WIDTH, DEPTH, PUNCH = 3.0, 2.0, 0.5
"""Width and depth of the quarter of the ground; height of the punch."""
GROWTH = 0.5
"""Growth of the edge length per distance from the punch."""


def write_square_punch(
    path: str | Path, size: float = 0.5, order: int = 1, eighth: bool = False
) -> None:
    """Mesh the ground and the punch and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length under the punch.
        order: Degree of the geometry, 1 or 2.
        eighth: Whether to mesh an eighth instead of a quarter.
    """

    def law(x: float, y: float, z: float) -> float:
        return size + GROWTH * max(0.0, x - 1, y - 1, -z - 1)

    with gmsh_session() as gmsh:
        ground = add_block([0.0, 0.0, -DEPTH], [WIDTH, WIDTH, DEPTH], eighth)
        punch = add_block([0.0, 0.0, 0.0], [1.0, 1.0, PUNCH], eighth)
        _, ((ground,), (punch,)) = gmsh.model.occ.fragment([ground], [punch])
        gmsh.model.occ.synchronize()

        name(3, {"ground": [ground[1]], "punch": [punch[1]]})
        planes = {"y0": (1, 0.0), "bottom": (2, -DEPTH), "top": (2, PUNCH)}
        name_planes(2, planes if eighth else planes | {"x0": (0, 0.0)})
        if eighth:
            name(2, {"diagonal": on_diagonal()})
        name(2, {"sides": on_plane(2, 0, WIDTH) + on_plane(2, 1, WIDTH), "seam": interface(2)})
        generate(3, law, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_square_punch, "Mesh a quarter of a square punch on ground.")
    parser.add_argument("--eighth", action="store_true", help="half of the quarter, with y ≤ x")
    write_from(parser, write_square_punch)


if __name__ == "__main__":
    main()
