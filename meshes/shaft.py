"""A quarter of a round shaft, about the z axis: as a section in a hub, or as a bar.

With a hub the mesh is plane: volumes ``shaft`` and ``hub``; curves ``outer``, ``x0`` and ``y0``
(the symmetry lines) and the contact curves ``shaft_seam`` and ``hub_seam``. With a length it is one
of tetrahedra: volume ``shaft``; surfaces ``x0``, ``y0``, ``outer``, ``z0`` and ``z1``, its ends.
"""

from itertools import pairwise
from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.shapes import add_polygon
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session, write_split

RADIUS = 1.0


def write_shaft(
    path: str | Path,
    hub: float | None = None,
    length: float | None = None,
    size: float = 0.2,
    order: int = 2,
) -> None:
    """Mesh the shaft and write a .msh file. On one process.

    Args:
        path: The file to write.
        hub: Outer radius of a hub; that of the shaft is 1.
        length: Of a bar, which then has no hub.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        radii = [RADIUS] if hub is None else [RADIUS, hub]
        centre = occ.addPoint(0.0, 0.0, 0.0)
        starts = [centre, *(occ.addPoint(radius, 0.0, 0.0) for radius in radii)]
        ends = [centre, *(occ.addPoint(0.0, radius, 0.0) for radius in radii)]
        arcs = [occ.addCircleArc(a, centre, b) for a, b in zip(starts[1:], ends[1:], strict=True)]
        y0 = [occ.addLine(a, b) for a, b in pairwise(starts)]
        x0 = [occ.addLine(a, b) for a, b in pairwise(ends)]
        faces = [add_polygon([y0[0], arcs[0], x0[0]])]
        if hub is not None:
            faces.append(add_polygon([y0[1], arcs[1], x0[1], arcs[0]]))
        if length is None:
            occ.synchronize()
            name(2, dict(zip(("shaft", "hub"), ([face] for face in faces), strict=False)))
            name(1, {"outer": arcs[-1:], "x0": x0, "y0": y0})
            if hub is not None:
                name(1, {"seam": arcs[:1]})
            generate(2, lambda x, y, z: size, order)
        else:
            parts = occ.extrude([(2, faces[0])], 0.0, 0.0, length)
            occ.synchronize()
            name(3, {"shaft": [tag for dim, tag in parts if dim == 3]})
            labels = ("z1", "y0", "outer", "x0")
            around = [tag for dim, tag in parts if dim == 2]
            name(
                2, {"z0": faces} | {label: [tag] for label, tag in zip(labels, around, strict=True)}
            )
            generate(3, lambda x, y, z: size, order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line asks for."""
    parser = mesh_parser(write_shaft, "Mesh a quarter of a shaft.")
    parser.add_argument("--hub", type=float, help="outer radius of a hub")
    parser.add_argument("--length", type=float, help="of a bar, which then has no hub")
    write_from(parser, write_shaft)


if __name__ == "__main__":
    main()
