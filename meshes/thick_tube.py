"""Mesh a quarter of a thick tube in plane strain, as one tube or as two nested tubes.

The tube is centred at the origin in the plane z = 0. As half of the section of a body of revolution
it is half of a thick sphere, with ``x0`` on the axis. The volume is ``tube``. Curves are ``inner``,
``outer``, ``x0`` and ``y0`` (the symmetry lines). With an interface the volumes are ``inner_tube``
and ``outer_tube``. Then the contact curves are ``inner_tube_seam`` and ``outer_tube_seam``, whose
nodes match unless the tubes have separate meshes.
"""

import math
from itertools import pairwise
from pathlib import Path

import gmsh

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

INNER = 1.0
"""Inner radius."""
OUTER = 1.3
"""Default outer radius."""


def write_thick_tube(
    path: str | Path,
    outer: float = OUTER,
    interface: float | None = None,
    size: float = 0.05,
    order: int = 1,
    finer: float | None = None,
    sides: int | None = None,
    round_seam: bool = False,
) -> None:
    """Mesh a quarter of a tube and write a .msh file. Not collective.

    Args:
        path: The file to write.
        outer: Outer radius; the inner one is 1.
        interface: Radius at which the tube is divided in two; None for one tube.
        size: Edge length at the inner radius; it grows in proportion to the radius.
        order: Degree of the geometry, 1 or 2.
        finer: Mesh two tubes separately, and multiply the number of the outer tube's edges at the
            seam by this factor.
        sides: Number of sides in a quarter, if all circles become polygons with vertices on the
            circles.
        round_seam: Whether the interface remains a circle, whose chords are the edges of either
            tube.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        radii = [INNER, outer] if interface is None else [INNER, interface, outer]
        bodies = ["tube"] if interface is None else ["inner_tube", "outer_tube"]
        centre = occ.addPoint(0.0, 0.0, 0.0)
        starts = [occ.addPoint(radius, 0.0, 0.0) for radius in radii]
        ends = [occ.addPoint(0.0, radius, 0.0) for radius in radii]
        rings = [
            [occ.addCircleArc(start, centre, end)]
            if sides is None or (round_seam and radius == interface)
            else _chords(radius, start, end, sides)
            for radius, start, end in zip(radii, starts, ends, strict=True)
        ]
        y0 = [occ.addLine(a, b) for a, b in pairwise(starts)]
        x0 = [occ.addLine(a, b) for a, b in pairwise(ends)]
        faces = [
            add_polygon([below, *outside, above, *reversed(inside)])
            for below, above, (inside, outside) in zip(y0, x0, pairwise(rings), strict=True)
        ]
        occ.synchronize()

        name(2, {body: [face] for body, face in zip(bodies, faces, strict=True)})
        name(1, {"inner": rings[0], "outer": rings[-1], "x0": x0, "y0": y0})
        if interface is not None:
            name(1, {"seam": rings[1]})

        def mesh(body: str = "") -> None:
            near = size / finer if finer and body == "outer_tube" else size
            generate(2, lambda x, y, z: near * math.hypot(x, y), order)

        if finer is None:
            mesh()
            write_split(path)
        else:
            write_apart(path, mesh)


def _chords(radius: float, start: int, end: int, sides: int) -> list[int]:
    """Return lines from one point of a circle to another point at a right angle."""
    occ = gmsh.model.occ
    turns = [math.pi / 2 * side / sides for side in range(1, sides)]
    between = [occ.addPoint(radius * math.cos(t), radius * math.sin(t), 0.0) for t in turns]
    return [occ.addLine(*pair) for pair in pairwise([start, *between, end])]


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_thick_tube, "Mesh a quarter of a thick tube.")
    parser.add_argument("--outer", type=float, help="outer radius; the inner one is 1")
    parser.add_argument("--interface", type=float, help="radius at which to cut the tube in two")
    parser.add_argument("--finer", type=float, help="mesh them apart, the outer one so much finer")
    write_from(parser, write_thick_tube)


if __name__ == "__main__":
    main()
