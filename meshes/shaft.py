"""Mesh a quarter of a round shaft about the z axis, alone or in a hub, as a section or a bar.

A section is plane, with the symmetry lines ``x0`` and ``y0``. A bar consists of tetrahedra, with
the symmetry planes ``x0`` and ``y0`` and the ends ``z0`` and ``z1``. The volume is ``shaft``, and
its surface is ``outer``. With a hub there is a second volume ``hub``, to which ``outer`` belongs.
The contact surfaces are ``shaft_seam`` and ``hub_seam``, whose nodes match unless the bodies have
separate meshes.
"""

from itertools import pairwise
from pathlib import Path

from meshes.apart import write_apart
from meshes.command_line import mesh_parser, write_from
from meshes.naming import interface, name, name_planes
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
    finer: float | None = None,
) -> None:
    """Mesh the shaft and write a .msh file. Not collective.

    Args:
        path: The file to write.
        hub: Outer radius of a hub, or None; the radius of the shaft is 1.
        length: Length of a bar; None for a section.
        size: Edge length.
        order: Degree of the geometry, 1 or 2.
        finer: Mesh shaft and hub separately, and multiply the number of the hub's edges by this
            factor.
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
        dim, bodies = 2, faces
        if length is not None:
            parts = occ.extrude([(2, face) for face in faces], 0.0, 0.0, length)
            dim, bodies = 3, [tag for kind, tag in parts if kind == 3]
        occ.synchronize()
        name(dim, dict(zip(("shaft", "hub"), ([body] for body in bodies), strict=False)))
        if length is None:
            name(1, {"outer": arcs[-1:], "x0": x0, "y0": y0})
        else:
            planes = {"x0": (0, 0.0), "y0": (1, 0.0), "z0": (2, 0.0), "z1": (2, length)}
            name_planes(2, planes)
            boundary = gmsh.model.getBoundary([(3, bodies[-1])], oriented=False)
            kinds = {tag: gmsh.model.getType(2, tag) for _, tag in boundary}
            curved = {tag for tag, kind in kinds.items() if kind != "Plane"}
            name(2, {"outer": curved - set(interface(2))})
        if hub is not None:
            name(dim - 1, {"seam": interface(dim - 1)})

        def mesh(body: str = "") -> None:
            near = size / finer if finer and body == "hub" else size
            generate(dim, lambda x, y, z: near, order)

        if finer is None:
            mesh()
            write_split(path)
        else:
            write_apart(path, mesh)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_shaft, "Mesh a quarter of a shaft.")
    parser.add_argument("--hub", type=float, help="outer radius of a hub")
    parser.add_argument("--length", type=float, help="of a bar")
    parser.add_argument("--finer", type=float, help="mesh them apart, the hub so much finer")
    write_from(parser, write_shaft)


if __name__ == "__main__":
    main()
