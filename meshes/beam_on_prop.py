"""Mesh a beam that is fixed in a wall and rests on a block near its other end, in millimetres.

The beam is (0, 400)×(100, 150), the block (300, 400)×(0, 100). Volumes are ``beam`` and ``block``.
Curves are ``wall`` (x = 0), ``floor`` (y = 0), ``top`` (y = 150), and the contact curves
``beam_seam`` and ``block_seam``. The tutorial has the same bodies.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_beam_on_prop(path: str | Path, size: float = 12.0, order: int = 1) -> None:
    """Mesh the beam and the block and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        beam = add_box([0.0, 100.0], [400.0, 50.0])
        block = add_box([300.0, 0.0], [100.0, 100.0])
        _, ((beam,), (block,)) = gmsh.model.occ.fragment([beam], [block])
        gmsh.model.occ.synchronize()

        name(2, {"beam": [beam[1]], "block": [block[1]]})
        name_planes(1, {"wall": (0, 0.0), "floor": (1, 0.0), "top": (1, 150.0)})
        name(1, {"seam": interface(1)})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_beam_on_prop, "Mesh a beam on a prop.")
    write_from(parser, write_beam_on_prop)


if __name__ == "__main__":
    main()
