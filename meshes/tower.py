"""Mesh a stack of random blocks and quarters of cylinders.

Volumes are ``body_0`` (the lowest body) and so on. Surfaces are ``x0`` and ``y0`` (planes of
symmetry), ``bottom`` and ``top``, and the contact surfaces ``body_0_seam_0``, ``body_1_seam_0`` and
so on.
"""

import math
import random
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name, name_planes
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

BODIES = (2, 6)
"""Least and largest number of bodies of a tower."""


def write_tower(path: str | Path, size: float = 0.4, order: int = 1, number: int = 0) -> None:
    """Mesh a tower and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length; the bodies are 0.4 to 1.2 wide.
        order: Degree of the geometry, 1 or 2.
        number: Number of the random tower.
    """
    draw = random.Random(number)
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        height, levels, bodies = 0.0, [0.0], []
        for _ in range(draw.randint(*BODIES)):
            thickness, width = draw.uniform(0.25, 0.6), draw.uniform(0.4, 1.2)
            if draw.random() < 0.5:
                tag = occ.addBox(0, 0, height, width, draw.uniform(0.4, 1.2), thickness)
            else:
                tag = occ.addCylinder(0, 0, height, 0, 0, thickness, width, angle=math.pi / 2)
            bodies.append((3, tag))
            height += thickness
            levels.append(height)
        _, pieces = occ.fragment(bodies[:1], bodies[1:])
        occ.synchronize()

        name(3, {f"body_{i}": [tag for _, tag in piece] for i, piece in enumerate(pieces)})
        name_planes(2, {"x0": (0, 0.0), "y0": (1, 0.0), "bottom": (2, 0.0), "top": (2, height)})
        for i, level in enumerate(levels[1:-1]):
            shared = [
                tag
                for tag in on_plane(2, 2, level)
                if len(gmsh.model.getAdjacencies(2, tag)[0]) == 2
            ]
            name(2, {f"seam_{i}": shared})
        generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_tower, "Mesh blocks and quarters of cylinders on each other.")
    parser.add_argument("--number", type=int, help="which one of all towers")
    write_from(parser, write_tower)


if __name__ == "__main__":
    main()
