"""Mesh random blocks in a row against a wall, with pins in the blocks and a lid on top.

The mesh is half of the assembly, by symmetry. Volumes are ``block_0`` (at the wall), ``pin_0`` in
it and so on, and ``lid``. Surfaces are ``x0`` (at the wall, of blocks and lid), ``y0`` (the plane
of symmetry), ``z0`` (the bottom of all bodies except the lid), ``end`` (of the last block) and
``top`` (of the lid). Contact surfaces have names such as ``block_0_joint_1`` and ``pin_0_joint_1``.
"""

import random
from pathlib import Path

import gmsh

from meshes.command_line import mesh_parser, write_from
from meshes.joints import Solid, fragment, joints
from meshes.naming import name, name_planes
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

BLOCKS = (1, 3)
"""Least and largest number of blocks in a row. A single block has a pin."""

MOST_WITHOUT_LID = 5
"""Largest number of bodies in a row without a lid, including the pins."""

LID = 0.3
"""Thickness of the lid."""


def write_assembly(path: str | Path, size: float = 0.45, order: int = 1, number: int = 0) -> None:
    """Mesh an assembly and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length; blocks are 0.7 to 1.2 long, and radii of pins 0.15 to 0.3.
        order: Degree of the geometry, 1 or 2.
        number: Number of the random assembly.
    """
    draw = random.Random(number)
    with gmsh_session():
        occ = gmsh.model.occ
        parts: dict[str, list[Solid]] = {}
        count, low = draw.randint(*BLOCKS), draw.uniform(0.4, 0.7)
        end, ends = 0.0, [0.0]
        for i in range(count):
            length, width = draw.uniform(0.7, 1.2), draw.uniform(0.5, 0.9)
            height = low + (draw.uniform(0.1, 0.4) if i == BLOCKS[1] - 1 else 0.0)
            parts[f"block_{i}"] = [(3, occ.addBox(end, 0, 0, length, width, height))]
            if count == 1 or (len(parts) < MOST_WITHOUT_LID and draw.random() < 0.7):
                x, radius = end + length * draw.uniform(0.4, 0.6), draw.uniform(0.15, 0.3)
                pin = occ.addCylinder(x, 0, 0, 0, 0, height, radius)
                inside = occ.addBox(x - radius, 0, 0, 2 * radius, radius, height)
                parts[f"pin_{i}"] = occ.intersect([(3, pin)], [(3, inside)])[0]
            end += length
            ends.append(end)
        has_lid = draw.random() < 0.5
        if has_lid:
            reach = ends[1] + (draw.uniform(0.2, 0.6) if count > 1 else 0.0)
            parts["lid"] = [(3, occ.addBox(0, 0, low, reach, draw.uniform(0.4, 0.9), LID))]
        bodies = fragment(parts)
        name(3, bodies)
        planes = {"x0": (0, 0.0), "y0": (1, 0.0), "z0": (2, 0.0), "end": (0, end)}
        name_planes(2, planes | ({"top": (2, low + LID)} if has_lid else {}))
        name(2, joints(bodies))
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_assembly, "Mesh blocks in a row with pins and a lid.")
    parser.add_argument("--number", type=int, help="which one of all assemblies")
    write_from(parser, write_assembly)


if __name__ == "__main__":
    main()
