"""Mesh a slender beam in the plane, with places for a load on its top.

The volume ``beam`` is (0, LENGTH)×(0, 1). Curves are ``left`` and ``right`` (the ends), and
``at0``, ``at1``, ... on the top, each of the length WIDTH around one of ``PLACES``.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

LENGTH, WIDTH = 24.0, 0.5
"""Length of the beam, and width of the load."""
PLACES = (6.0, 12.0, 18.0)
"""Coordinates x of the middles of the load."""


def write_loaded_beam(path: str | Path, size: float = 0.25, order: int = 1) -> None:
    """Mesh the beam and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        on_top = [(x + a * WIDTH / 2, 1.0) for x in reversed(PLACES) for a in (1, -1)]
        lines = add_outline([(0.0, 0.0), (LENGTH, 0.0), (LENGTH, 1.0), *on_top, (0.0, 1.0)])
        beam = add_polygon(lines)
        gmsh.model.occ.synchronize()
        name(2, {"beam": [beam]})
        under = {f"at{i}": [line] for i, line in enumerate(reversed(lines[3:-2:2]))}
        name(1, {"left": [lines[-1]], "right": [lines[1]], **under})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_loaded_beam, "Mesh a beam under a load that moves.")
    write_from(parser, write_loaded_beam)


if __name__ == "__main__":
    main()
