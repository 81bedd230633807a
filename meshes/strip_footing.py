"""Mesh half of a strip footing in plane strain: Prandtl's problem.

As half of the section of a body of revolution, the footing is circular. The ground is (0,
width)×(-depth, 0); the footing is the part x ≤ 1 of y = 0. The volume is ``ground``. Curves are
``x0`` (the symmetry line), ``bottom``, ``side``, ``footing`` and ``free`` (the rest of y = 0). A
punch is a second body (0, 1)×(0, 1) on the ground. Then the volumes are ``ground`` and ``punch``,
whose curve is ``top``; ``x0`` belongs to both bodies. The contact curves are ``ground_footing`` and
``punch_footing``, whose nodes match unless the bodies have separate meshes.
"""

from pathlib import Path

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import finer_at, generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

WIDTH, DEPTH = 6.0, 6.0
"""Default extent of the ground; half of the footing's width is 1."""
FINER, REACH = 10.0, 2.2
"""Default factor by which the elements are smaller at the footing's edge, and distance from this
edge up to which the edge length is ``size``, the region of the slip lines."""


def write_strip_footing(
    path: str | Path,
    punch: bool = False,
    width: float = WIDTH,
    depth: float = DEPTH,
    grading: float = FINER,
    size: float = 0.2,
    order: int = 1,
    finer: float | None = None,
) -> None:
    """Mesh the ground and the punch and write a .msh file. Not collective.

    Args:
        path: The file to write.
        punch: Whether there is a punch on the ground.
        width: Width of the ground, more than 1.
        depth: Depth of the ground.
        grading: Factor by which the elements are smaller at the footing's edge.
        size: Edge length in the region of the slip lines.
        order: Degree of the geometry, 1 or 2.
        finer: Mesh the punch separately, and multiply the number of its edges by this factor.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        outline = [(0.0, 0.0), (0.0, -depth), (width, -depth), (width, 0.0), (1.0, 0.0)]
        points = [occ.addPoint(x, y, 0.0) for x, y in outline]
        following = points[1:] + points[:1]
        axis, bottom, side, free, footing = map(occ.addLine, points, following)
        curves = {
            "x0": [axis],
            "bottom": [bottom],
            "side": [side],
            "free": [free],
            "footing": [footing],
        }
        bodies = {"ground": [add_polygon([axis, bottom, side, free, footing])]}
        if punch:
            right, left = occ.addPoint(1.0, 1.0, 0.0), occ.addPoint(0.0, 1.0, 0.0)
            chain = [points[-1], right, left, points[0]]
            lines = list(map(occ.addLine, chain, chain[1:]))
            curves["top"] = lines[1:2]
            curves["x0"] += lines[2:]
            bodies["punch"] = [add_polygon([*lines, footing])]
        occ.synchronize()

        name(2, bodies)
        name(1, curves)

        def mesh(body: str = "") -> None:
            own = size / finer if finer and body == "punch" else size
            generate(2, finer_at((1.0, 0.0), own / grading, own, reach=REACH), order)

        if finer is None:
            mesh()
            write_split(path)
        else:
            write_apart(path, mesh)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_strip_footing, "Mesh half of a strip footing.")
    parser.add_argument("--punch", action="store_true", help="with a punch on the ground")
    parser.add_argument("--width", type=float, help="width of the ground")
    parser.add_argument("--depth", type=float, help="depth of the ground")
    parser.add_argument("--grading", type=float, help="how much smaller elements are at the edge")
    parser.add_argument("--finer", type=float, help="mesh the punch apart, so much finer")
    write_from(parser, write_strip_footing)


if __name__ == "__main__":
    main()
