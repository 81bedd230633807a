"""Mesh the upper half of a quarter of a square plate of side 2 with flat tetrahedra.

The plate is (−1, 1)²×(−t/2, t/2), and the mesh fills (0, 1)²×(0, t/2). Half of the load acts on
each face, so stress and strain of the bent plate are odd in z. The volume is ``plate``. Surfaces
are ``x0``, ``y0`` and ``z0`` (the planes of symmetry, and the middle plane), ``edge`` (both outer
sides) and ``top``.
"""

from pathlib import Path

import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name, name_planes
from meshes.shapes import add_box
from perfplast_fenicsx.mesh import gmsh_session, on_plane


def write_thin_plate(
    path: str | Path,
    size: float = 0.125,
    order: int = 1,
    thickness: float = 0.1,
    layers: int = 1,
    column: float = 0.125,
) -> None:
    """Mesh the eighth and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Length of the longest edges in the plane of the plate.
        order: Degree of the geometry, 1 or 2.
        thickness: Thickness of the whole plate.
        layers: Number of layers of elements, from the middle to the top.
        column: Width of the outermost elements. Each further column towards the middle is twice
            as wide, up to ``size``.
    """
    places = _columns(size, column)
    with gmsh_session() as gmsh:
        half = thickness / 2
        plate = add_box([0.0, 0.0, 0.0], [1.0, 1.0, half])
        gmsh.model.occ.synchronize()
        name(3, {"plate": [plate[1]]})
        name_planes(2, {"x0": (0, 0.0), "y0": (1, 0.0), "z0": (2, 0.0), "top": (2, half)})
        name(2, {"edge": [*on_plane(2, 0, 1.0), *on_plane(2, 1, 1.0)]})
        for _, curve in gmsh.model.getEntities(1):
            upright = gmsh.model.occ.getMass(1, curve) < (1 + half) / 2
            count = layers if upright else len(places) - 1
            gmsh.model.mesh.setTransfiniteCurve(curve, count + 1)
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(surface)
        for _, volume in gmsh.model.getEntities(3):
            gmsh.model.mesh.setTransfiniteVolume(volume)
        gmsh.model.mesh.generate(3)
        even = np.linspace(0.0, 1.0, len(places))
        tags, flat, _ = gmsh.model.mesh.getNodes()
        points = flat.reshape(-1, 3)
        points[:, :2] = np.interp(points[:, :2], even, places)
        for tag, point in zip(tags, points, strict=True):
            gmsh.model.mesh.setNode(tag, point, [])
        gmsh.model.mesh.setOrder(order)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))


def _columns(size: float, column: float) -> list[float]:
    """Return the limits of the columns of elements, from the middle to the edge at 1."""
    graded = [1.0]
    while column < size and graded[-1] > size:
        graded.append(graded[-1] - column)
        column *= 2
    even = np.linspace(0.0, graded[-1], max(1, round(graded[-1] / size)) + 1)
    return [float(place) for place in [*even[:-1], *graded[::-1]]]


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_thin_plate, "Mesh the upper half of a quarter of a thin plate.")
    parser.add_argument("--thickness", type=float, help="of the whole plate")
    parser.add_argument("--layers", type=int, help="of elements in half of the thickness")
    parser.add_argument("--column", type=float, help="width of the outermost elements")
    write_from(parser, write_thin_plate)


if __name__ == "__main__":
    main()
