"""Mesh ground under a square footing 2×2, a quarter or an eighth, with fans around its edges.

The ground is (0, WIDTH)²×(−DEPTH, 0); the footing is the square |x|, |y| ≤ 1 of z = 0. The volume
is ``ground``. Surfaces are ``x0``, ``y0`` (the symmetry planes), ``bottom``, ``sides`` and
``footing``. An eighth is the part y ≤ x, with the plane of symmetry ``diagonal`` instead of ``x0``.
Long cells lie along the edges of the footing, where the solution varies little along the edge. Each
fan of cells extends from the free surface to the ground under the footing.
"""

import math
from pathlib import Path

import gmsh
import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.mitred import mitred, straight_fan
from meshes.shapes import add_outline, add_polygon
from meshes.sizes import generate
from meshes.tetrahedra import ON_DIAGONAL, both, either, on, write_tetrahedra
from perfplast_fenicsx.mesh import gmsh_session

WIDTH, DEPTH = 3.0, 2.0
"""Width and depth of the quarter of the ground."""
RADIUS = 0.2
"""Radius of the fans; half of the footing's width is 1."""
GROWTH = 0.4
"""Growth of the edge length per distance from the fans."""


def write_square_footing(
    path: str | Path,
    size: float = 1.0,
    order: int = 1,
    cells: int = 6,
    layers: int = 1,
    eighth: bool = False,
) -> None:
    """Mesh the ground and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Largest edge length of the section.
        order: Degree of the geometry, 1 or 2.
        cells: Number of cells in each fan.
        layers: Number of layers from the middle of each edge to its end.
        eighth: Whether to mesh an eighth instead of a quarter.
    """
    width = math.pi * RADIUS / cells

    def law(x: float, z: float, _: float) -> float:
        return min(size, width + GROWTH * abs(math.hypot(x - 1, z) - RADIUS))

    with gmsh_session():
        corners = [(0.0, 0.0), (0.0, -DEPTH), (WIDTH, -DEPTH), (WIDTH, 0.0)]
        ground = add_polygon(add_outline(corners))
        fan = straight_fan((1.0, 0.0), RADIUS, [-180.0 * i / cells for i in range(cells + 1)])
        gmsh.model.occ.fragment([(2, ground)], [(2, tag) for tag in fan])
        gmsh.model.occ.synchronize()
        for _, curve in gmsh.model.getEntities(1):
            ends = gmsh.model.getBoundary([(1, curve)], oriented=False)
            values = [gmsh.model.getValue(0, end, []) for _, end in ends]
            away = np.array([math.hypot(x - 1, z) for x, z, _ in values])
            if (np.isclose(away, 0) | np.isclose(away, RADIUS)).all():
                gmsh.model.mesh.setTransfiniteCurve(curve, 2)
        generate(2, law, 1)
        tags, places, _ = gmsh.model.mesh.getNodes()
        _, _, (triangles,) = gmsh.model.mesh.getElements(2)
        points = places.reshape(-1, 3)[np.argsort(tags), :2]
        section = np.searchsorted(np.sort(tags), triangles).reshape(-1, 3)

        far = -np.hypot(points[:, 0] - 1, points[:, 1])
        along = [i / layers for i in range(layers + 1)]
        x, tetrahedra = mitred(points, section, along, far, eighth)
        under = both(on(2, 0.0), lambda facets: facets[:, :, :2].mean(axis=1).max(axis=1) < 1.0)
        surfaces = {"diagonal": ON_DIAGONAL} if eighth else {"x0": on(0, 0.0)}
        surfaces |= {"y0": on(1, 0.0), "bottom": on(2, -DEPTH), "footing": under}
        surfaces["sides"] = either(on(0, WIDTH), on(1, WIDTH))
        write_tetrahedra(path, x, {"ground": tetrahedra}, surfaces, order)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(
        write_square_footing, "Mesh a quarter of the ground under a square footing."
    )
    parser.add_argument("--cells", type=int, help="of each fan")
    parser.add_argument("--layers", type=int, help="from the middle of each edge to its end")
    parser.add_argument("--eighth", action="store_true", help="half of the quarter, with y ≤ x")
    write_from(parser, write_square_footing)


if __name__ == "__main__":
    main()
