"""Mesh two blocks that meet on an inclined plane: an unstructured assembly with oblique contact.

The box (0, 2)×(0, 1)×(0, 2) is cut from (0, ·, 0.75) to (2, ·, 1.25). Volumes are ``lower`` and
``upper``. Surfaces are ``x0``, ``x1`` (x = 2), ``y0``, ``y1`` (both bodies), ``bottom``, ``top``,
and the contact surfaces ``lower_seam`` and ``upper_seam``. Frictionless blocks slide on the
incline: hold ``x0`` or ``x1`` in x.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split

LENGTH, WIDTH, HEIGHT = 2.0, 1.0, 2.0
SEAM = (0.75, 1.25)  # height of the inclined plane at x = 0 and at x = LENGTH


def write_wedge(path: str | Path, size: float = 0.2, order: int = 1) -> None:
    """Mesh the two blocks and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length of the tetrahedra; the box is 2×1×2.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        corners = [(0.0, 0.0), (LENGTH, 0.0), (LENGTH, SEAM[1]), (0.0, SEAM[0])]
        lower = [occ.addPoint(x, 0.0, z) for x, z in corners]
        upper = lower[3:1:-1] + [occ.addPoint(x, 0.0, HEIGHT) for x in (LENGTH, 0.0)]
        faces = []
        for points in (lower, upper):
            following = points[1:] + points[:1]
            lines = [occ.addLine(a, b) for a, b in zip(points, following, strict=True)]
            faces.append((2, occ.addPlaneSurface([occ.addCurveLoop(lines)])))
        solids = [occ.extrude([face], 0.0, WIDTH, 0.0)[1] for face in faces]
        occ.fragment(solids[:1], solids[1:])
        occ.synchronize()

        heights = {tag: occ.getCenterOfMass(3, tag)[2] for _, tag in gmsh.model.getEntities(3)}
        low, high = sorted(heights, key=heights.__getitem__)
        gmsh.model.addPhysicalGroup(3, [low], name="lower")
        gmsh.model.addPhysicalGroup(3, [high], name="upper")
        planes = {
            "x0": (0, 0.0),
            "x1": (0, LENGTH),
            "y0": (1, 0.0),
            "y1": (1, WIDTH),
            "bottom": (2, 0.0),
            "top": (2, HEIGHT),
        }
        outside = set()
        for name, (axis, value) in planes.items():
            tags = on_plane(2, axis, value)
            outside.update(tags)
            gmsh.model.addPhysicalGroup(2, tags, name=name)
        seam = [tag for _, tag in gmsh.model.getEntities(2) if tag not in outside]
        gmsh.model.addPhysicalGroup(2, seam, name="seam")

        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_wedge, "Mesh two blocks that meet on an inclined plane.")
    write_from(parser, write_wedge)


if __name__ == "__main__":
    main()
