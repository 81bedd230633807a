"""Mesh a 3D beam that is held at one end and rests on a block at the other.

Volumes are ``beam``, (0, 4)×(0, 1)×(0, THICK), and ``block``, (3, 4)×(0, 1)×(−1, 0). Surfaces are
``held`` (x = 0), ``y0`` (of both), ``floor`` (z = −1), ``top`` (of the beam), and the contact
surfaces ``beam_seam`` and ``block_seam``. Other faces have no name.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

THICK = 0.5
"""Thickness of the beam."""


def write_propped_beam(path: str | Path, size: float = 0.3, order: int = 1) -> None:
    """Mesh the bodies and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        beam = add_box([0.0, 0.0, 0.0], [4.0, 1.0, THICK])
        block = add_box([3.0, 0.0, -1.0], [1.0, 1.0, 1.0])
        _, ((beam,), (block,)) = gmsh.model.occ.fragment([beam], [block])
        gmsh.model.occ.synchronize()
        name(3, {"beam": [beam[1]], "block": [block[1]]})
        planes = {"held": (0, 0.0), "y0": (1, 0.0), "floor": (2, -1.0), "top": (2, THICK)}
        name_planes(2, planes)
        name(2, {"seam": interface(2)})
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_propped_beam, "Mesh a beam on a block.")
    write_from(parser, write_propped_beam)


if __name__ == "__main__":
    main()
