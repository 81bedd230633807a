"""Mesh two stacked blocks with unstructured elements, in 2D or 3D.

``lower`` is the unit square or cube, and ``upper`` is an equal body on top of it. The vertical axis
is y in 2D and z in 3D. Surfaces are ``x0`` and, in 3D, ``y0`` (both bodies), ``bottom``, ``top``,
and the contact surfaces ``lower_seam`` and ``upper_seam``. The other sides have no name.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_contact_patch(path: str | Path, dim: int = 3, size: float = 0.25, order: int = 1) -> None:
    """Mesh the two blocks and write a .msh file. Not collective.

    Args:
        path: The file to write.
        dim: 2 or 3.
        size: Edge length of the elements; the edges of the blocks are 1.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        level = [0.0] * (dim - 1)
        lower = add_box([*level, 0.0], [1.0] * dim)
        upper = add_box([*level, 1.0], [1.0] * dim)
        _, parts = gmsh.model.occ.fragment([lower], [upper])
        gmsh.model.occ.synchronize()

        (low,), (high,) = parts
        name(dim, {"lower": [low[1]], "upper": [high[1]]})
        sides = {"x0": (0, 0.0), "y0": (1, 0.0)} if dim == 3 else {"x0": (0, 0.0)}
        name_planes(dim - 1, sides | {"bottom": (dim - 1, 0.0), "top": (dim - 1, 2.0)})
        name(dim - 1, {"seam": interface(dim - 1)})
        generate(dim, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_contact_patch, "Mesh two stacked blocks.")
    parser.add_argument("--dim", type=int, choices=(2, 3), help="2D or 3D")
    write_from(parser, write_contact_patch)


if __name__ == "__main__":
    main()
