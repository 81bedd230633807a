"""Mesh half of a pin in the eye of a lug, by symmetry: contact on a cylinder.

The lug is a bar of width 2·WIDTH with a round end about the pin's axis (the z axis); its shank
extends to y = -LENGTH. Volumes are ``lug`` and ``pin``. Surfaces are ``x0`` (the symmetry plane x =
0, both bodies), ``z0`` and ``z1`` (the flat faces, both bodies), ``end`` (y = -LENGTH, of the lug),
and the contact surfaces ``lug_bore`` and ``pin_bore``.
"""

import math
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

RADIUS, WIDTH, LENGTH, THICKNESS = 1.0, 2.0, 4.0, 1.0


def write_pin_in_lug(path: str | Path, size: float = 0.4, order: int = 1) -> None:
    """Mesh half of a lug and its pin and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length of the tetrahedra; the pin's radius is 1.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ

        def half_cylinder(radius: float) -> tuple[int, int]:
            tag = occ.addCylinder(0, 0, 0, 0, 0, THICKNESS, radius, angle=math.pi)
            occ.rotate([(3, tag)], 0, 0, 0, 0, 0, 1, -math.pi / 2)
            return 3, tag

        shank = (3, occ.addBox(0, -LENGTH, 0, WIDTH, LENGTH, THICKNESS))
        bar, _ = occ.fuse([shank], [half_cylinder(WIDTH)])
        occ.fragment(bar, [half_cylinder(RADIUS)])
        occ.synchronize()

        masses = {tag: occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3)}
        small, large = sorted(masses, key=masses.__getitem__)
        gmsh.model.addPhysicalGroup(3, [small], name="pin")
        gmsh.model.addPhysicalGroup(3, [large], name="lug")
        planes = {"x0": (0, 0.0), "z0": (2, 0.0), "z1": (2, THICKNESS), "end": (1, -LENGTH)}
        for name, (axis, value) in planes.items():
            gmsh.model.addPhysicalGroup(2, on_plane(2, axis, value), name=name)
        bore = [
            tag
            for _, tag in gmsh.model.getEntities(2)
            if len(gmsh.model.getAdjacencies(2, tag)[0]) == 2
        ]
        gmsh.model.addPhysicalGroup(2, bore, name="bore")

        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_pin_in_lug, "Mesh half of a lug and its pin.")
    write_from(parser, write_pin_in_lug)


if __name__ == "__main__":
    main()
