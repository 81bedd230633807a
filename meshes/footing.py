"""Mesh both halves of a strip footing in plane strain, for inclined or eccentric loads.

The ground is (-WIDTH, WIDTH)×(-DEPTH, 0); the footing is the part |x| ≤ 1 of y = 0. The volume is
``ground``. Curves are ``bottom``, ``sides``, ``footing`` and ``free`` (the rest of y = 0). The mesh
is symmetric.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, DEPTH = 6.0, 4.0
"""Extent of the ground; half of the footing's width is 1."""
REACH = 2.2
"""Distance from the footing's edges up to which the edge length is ``size``."""


def write_footing(path: str | Path, size: float = 0.4, order: int = 1, finer: float = 10.0) -> None:
    """Mesh the ground and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length in the region of the slip lines.
        order: Degree of the geometry, 1 or 2.
        finer: Factor by which the edge length is smaller at the footing's edges.
    """
    with gmsh_session() as gmsh:
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        corners = [(0.0, 0.0), (0.0, -DEPTH), (WIDTH, -DEPTH), (WIDTH, 0.0), (1.0, 0.0)]
        ends = [occ.addPoint(x, y, 0.0) for x, y in corners]
        images = [*ends[:2], *(occ.addPoint(-x, y, 0.0) for x, y in corners[2:])]
        axis = occ.addLine(ends[0], ends[1])
        right, left = (
            [occ.addLine(chain[i], chain[(i + 1) % 5]) for i in range(1, 5)]
            for chain in (ends, images)
        )
        halves = [add_polygon([axis, *right]), add_polygon([axis, *left])]
        occ.synchronize()
        for line, image in zip(right, left, strict=True):
            mesh.setPeriodic(1, [image], [line], [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
        labels = ("bottom", "sides", "free", "footing")
        name(2, {"ground": halves})
        name(1, {label: [right[i], left[i]] for i, label in enumerate(labels)})
        one, other = (finer_at((x, 0.0), size / finer, size, reach=REACH) for x in (-1.0, 1.0))
        generate(2, lambda x, y, z: min(one(x, y, z), other(x, y, z)), order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_footing, "Mesh a strip footing.")
    parser.add_argument("--finer", type=float, help="how many times smaller they are at its edges")
    write_from(parser, write_footing)


if __name__ == "__main__":
    main()
