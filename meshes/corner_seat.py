"""Mesh a block in an L-shaped seat: one contact surface with a corner, in 2D or 3D.

The block is (0, 1)×(0, 1), and the seat is (-LEG, 1)×(-LEG, 1) without the block. In 3D both have
the length THICKNESS in z. Volumes are ``block`` and ``seat``. Surfaces are ``top`` (y = 1) and
``right`` (x = 1) of the block, ``seat_bottom`` (y = -LEG) and ``seat_left`` (x = -LEG), in 3D
``z0`` and ``z1`` (both bodies), and the contact surfaces ``block_corner`` and ``seat_corner``, of
two faces each.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

LEG, THICKNESS = 0.5, 1.0
"""Thickness of the seat's legs; thickness of both bodies in z."""


def write_corner_seat(path: str | Path, dim: int = 3, size: float = 0.2, order: int = 1) -> None:
    """Mesh the block and its seat and write a .msh file. Not collective.

    Args:
        path: The file to write.
        dim: 2 or 3.
        size: Edge length of the elements; the edges of the block are 1.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        flat = [0.0, THICKNESS] if dim == 3 else []  # start and extent in z
        inside = add_box([0.0, 0.0, *flat[:1]], [1.0, 1.0, *flat[1:]])
        outside = add_box([-LEG, -LEG, *flat[:1]], [1.0 + LEG, 1.0 + LEG, *flat[1:]])
        pieces, ((block,), _) = gmsh.model.occ.fragment([inside], [outside])
        gmsh.model.occ.synchronize()

        name(dim, {"block": [block[1]], "seat": [tag for _, tag in pieces if tag != block[1]]})
        _, faces = gmsh.model.getAdjacencies(*block)
        for label, axis in (("top", 1), ("right", 0)):
            name(dim - 1, {label: [tag for tag in on_plane(dim - 1, axis, 1.0) if tag in faces]})
        name_planes(dim - 1, {"seat_bottom": (1, -LEG), "seat_left": (0, -LEG)})
        if dim == 3:
            name_planes(2, {"z0": (2, 0.0), "z1": (2, THICKNESS)})
        name(dim - 1, {"corner": interface(dim - 1)})
        generate(dim, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_corner_seat, "Mesh a block in an L-shaped seat.")
    parser.add_argument("--dim", type=int, choices=(2, 3), help="2D or 3D")
    write_from(parser, write_corner_seat)


if __name__ == "__main__":
    main()
