"""Mesh half of the section of a ring about the axis x = 0, as one ring or two nested rings.

The section is (inner, outer)×(0, height), with x as radius. The volume is ``ring``. Curves are
``inner``, ``outer``, ``bottom`` and ``top``. With an interface, the volumes are ``inner_ring`` and
``outer_ring``, and the contact curves are ``inner_ring_seam`` and ``outer_ring_seam``.
"""

from itertools import pairwise
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split


def write_ring(
    path: str | Path,
    inner: float = 1.0,
    outer: float = 2.0,
    height: float = 0.5,
    interface: float | None = None,
    size: float = 0.1,
    order: int = 1,
) -> None:
    """Mesh half the section of a ring and write a .msh file. Not collective.

    Args:
        path: The file to write.
        inner: Inner radius; 0 for a disc.
        outer: Outer radius.
        height: Height along the axis.
        interface: Radius at which the ring is divided in two; None for one ring.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        radii = [inner, outer] if interface is None else [inner, interface, outer]
        bodies = ["ring"] if interface is None else ["inner_ring", "outer_ring"]
        lower = [occ.addPoint(radius, 0.0, 0.0) for radius in radii]
        upper = [occ.addPoint(radius, height, 0.0) for radius in radii]
        sides = [occ.addLine(a, b) for a, b in zip(lower, upper, strict=True)]
        bottom = [occ.addLine(a, b) for a, b in pairwise(lower)]
        top = [occ.addLine(a, b) for a, b in pairwise(upper)]
        faces = [
            add_polygon([below, outside, above, inside])
            for below, above, (inside, outside) in zip(bottom, top, pairwise(sides), strict=True)
        ]
        occ.synchronize()

        name(2, {body: [face] for body, face in zip(bodies, faces, strict=True)})
        name(1, {"inner": sides[:1], "outer": sides[-1:], "bottom": bottom, "top": top})
        if interface is not None:
            name(1, {"seam": sides[1:2]})
        generate(2, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_ring, "Mesh half the section of a ring.")
    parser.add_argument("--inner", type=float, help="inner radius")
    parser.add_argument("--outer", type=float, help="outer radius")
    parser.add_argument("--height", type=float, help="extent along the axis")
    parser.add_argument("--interface", type=float, help="radius at which to cut the ring in two")
    write_from(parser, write_ring)


if __name__ == "__main__":
    main()
