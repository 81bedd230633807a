"""Mesh a quarter of a block pressed between rough platens in plane strain.

The block is (0, WIDTH/2)×(0, HEIGHT/2). The volume is ``block``. Curves are ``x0``, ``y0`` (the
symmetry lines), ``side`` (x = WIDTH/2) and ``top``. With a platen, which is glued on top of the
block and has the same width, the volumes are ``block`` and ``platen``. They are one body with
shared nodes, and their common line has no name. Then ``top`` belongs to the platen, ``x0`` to both,
and ``side`` only to the block.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name, name_planes
from meshes.shapes import add_box
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, on_plane

WIDTH, HEIGHT, PLATEN = 2.0, 1.0, 0.25
"""Width and height of the whole block; thickness of a platen."""
FINER = 10.0
"""Default factor by which the elements are smaller at the edge of the block's top."""


def write_platens(
    path: str | Path,
    platen: bool = False,
    grading: float = FINER,
    size: float = 0.05,
    order: int = 1,
) -> None:
    """Mesh a quarter of the block and the platen on it and write a .msh file. Not collective.

    Args:
        path: The file to write.
        platen: Whether a platen is glued to the block.
        grading: Factor by which the elements are smaller at the edge of the block's top.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    width, height = WIDTH / 2, HEIGHT / 2
    with gmsh_session() as gmsh:
        block = add_box([0.0, 0.0], [width, height])
        bodies = {}
        if platen:
            above = add_box([0.0, height], [width, PLATEN])
            _, ((block,), (above,)) = gmsh.model.occ.fragment([block], [above])
            bodies["platen"] = [above[1]]
        gmsh.model.occ.synchronize()

        name(2, bodies | {"block": [block[1]]})
        top = height + PLATEN if platen else height
        name_planes(1, {"x0": (0, 0.0), "y0": (1, 0.0), "top": (1, top)})
        _, curves = gmsh.model.getAdjacencies(*block)
        name(1, {"side": [tag for tag in on_plane(1, 0, width) if tag in curves]})
        generate(2, finer_at((width, height), size / grading, size), order)
        # Not write_split, which would separate the platen from the block.
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_platens, "Mesh a quarter of a block between platens.")
    parser.add_argument("--platen", action="store_true", help="with a platen glued to the block")
    parser.add_argument("--grading", type=float, help="how much smaller elements are at the edge")
    write_from(parser, write_platens)


if __name__ == "__main__":
    main()
