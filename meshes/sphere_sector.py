"""Mesh a 120th of a thick spherical shell, between planes of symmetry of an icosahedron.

The corners of the sector lie on axes of two-, three- and five-fold symmetry. The volume is
``shell``. Surfaces are ``inner``, ``outer``, ``x0``, ``y0``, and ``oblique``, the plane of symmetry
that is parallel to no axis. As in :mod:`meshes.thick_sphere` facets are flat, and the images of the
sector form a polyhedron. Vertices lie on the spheres. Vertices of a *circumscribed* surface lie
further out, so that its facets do not cut the sphere.
"""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.tetrahedra import Booleans, Place, on, prisms, right_handed, write_tetrahedra
from meshes.thick_sphere import INNER, OUTER
from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.mesh import gmsh_session

GOLDEN = (1 + math.sqrt(5)) / 2
CORNERS = np.array([[0.0, 0.0, 1.0], [1 / GOLDEN, 0.0, GOLDEN], [0.0, 1.0, GOLDEN]])
"""Points on the axes of two-, three- and five-fold symmetry."""
SIDE = 0.65
"""Angle of the longest side, from the three-fold to the five-fold axis (radians)."""


def write_sphere_sector(
    path: str | Path, size: float = 0.1, order: int = 1, circumscribed: str = "inner"
) -> None:
    """Write the sector as a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length at the inner radius, which is 1; it grows in proportion to the radius.
        order: Degree of the geometry, 1 or 2.
        circumscribed: Surface that is circumscribed, ``inner`` or ``outer``.
    """
    x, triangles = _divided(max(1, round(SIDE / size)))
    layers = max(1, round(math.log(OUTER / INNER) / size))
    radii = np.geomspace(INNER, OUTER, layers + 1)
    a, b, c = x[triangles].swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    nearest = float(np.abs(np.einsum("fi,fi->f", a, normals)).min())
    radii[0 if circumscribed == "inner" else -1] /= nearest * (1 - 1e-12)
    points = (radii[:, None, None] * x).reshape(-1, 3)
    ends = [np.sort(triangles) + layer * len(x) for layer in range(layers + 1)]
    cells = right_handed(points, np.concatenate([prisms(*two) for two in pairwise(ends)]))
    oblique = tuple(np.cross(CORNERS[1], CORNERS[2]))

    def sphere(radius: float) -> Place:
        def there(facets: Floats) -> Booleans:
            away = np.linalg.norm(facets, axis=2)
            return np.asarray(np.isclose(away, radius).all(axis=1))

        return there

    with gmsh_session():
        surfaces = {"x0": on(0, 0.0), "y0": on(1, 0.0), "oblique": on(oblique, 0.0)}
        surfaces |= {"inner": sphere(radii[0]), "outer": sphere(radii[-1])}
        write_tetrahedra(path, points, {"shell": cells}, surfaces, order)


def _divided(parts: int) -> tuple[Floats, Longs]:
    """Return points of the unit sphere and triangles, ``parts`` along each side of the sector."""
    steps = [(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    number = {step: k for k, step in enumerate(steps)}
    one, two, three = CORNERS / np.linalg.norm(CORNERS, axis=1)[:, None]
    shares = np.array(steps) / parts
    x = one + shares[:, :1] * (two - one) + shares[:, 1:] * (three - one)
    triangles = []
    for i, j in steps:
        if i + j < parts:
            triangles.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < parts - 1:
            triangles.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return x / np.linalg.norm(x, axis=1)[:, None], np.array(triangles)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_sphere_sector, "Mesh a 120th of a thick spherical shell.")
    parser.add_argument(
        "--circumscribed", choices=("inner", "outer"), help="surface that does not cut its sphere"
    )
    write_from(parser, write_sphere_sector)


if __name__ == "__main__":
    main()
