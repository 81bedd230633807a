"""Two leaves on each other, held at one end: they bend together, and slide along each other.

Volumes ``lower`` = (0, LENGTH)×(0, 1)×(−THICK, 0), ``upper`` on it; surfaces ``held`` (x = 0, of
both), ``y0`` (of both), ``top`` (of the upper one), and the contact surfaces ``lower_seam`` and
``upper_seam``. Other faces have no name.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

LENGTH, THICK = 4.0, 0.5
"""Of a leaf, whose width is 1."""


def write_leaf_spring(path: str | Path, size: float = 0.3, order: int = 1) -> None:
    """Mesh the leaves and write a .msh file. On one process.

    Args:
        path: The file to write.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        lower = add_box([0.0, 0.0, -THICK], [LENGTH, 1.0, THICK])
        upper = add_box([0.0, 0.0, 0.0], [LENGTH, 1.0, THICK])
        _, ((lower,), (upper,)) = gmsh.model.occ.fragment([lower], [upper])
        gmsh.model.occ.synchronize()
        name(3, {"lower": [lower[1]], "upper": [upper[1]]})
        name_planes(2, {"held": (0, 0.0), "y0": (1, 0.0), "top": (2, THICK)})
        name(2, {"seam": interface(2)})
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line asks for."""
    parser = mesh_parser(write_leaf_spring, "Mesh two leaves on each other.")
    write_from(parser, write_leaf_spring)


if __name__ == "__main__":
    main()
