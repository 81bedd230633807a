"""Mesh an octant of a unit cube between rough platens, with a platen, in layers of tetrahedra.

The octant of the cube is (−HALF, 0)²×(0, HALF). There the diagonals of gmsh's layers follow the
slip lines, and bounds are closer by a third than in (0, HALF)³. Volumes are ``cube`` and
``platen``, one body with shared nodes whose common face has no name. Surfaces are ``x0``, ``y0``,
``z0`` (the symmetry planes; x0 and y0 of both volumes) and ``top`` of the platen. Without the
platen ``top`` belongs to the cube. Half of the octant is the part y ≤ x, with the plane of symmetry
``diagonal`` instead of ``y0``. Its cubes are divided along the diagonals that point to the middle
of the whole cube.
"""

from pathlib import Path

import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.kuhn import Kuhn, layers
from meshes.naming import name, name_planes
from meshes.shapes import add_box
from meshes.tetrahedra import ON_DIAGONAL, in_sector, on, write_tetrahedra
from perfplast_fenicsx.mesh import gmsh_session

HALF, PLATEN = 0.5, 0.1
"""Edge of the octant; thickness of the platen, which is one layer."""


def write_rough_cube(
    path: str | Path,
    size: float = 0.125,
    order: int = 1,
    platen: bool = True,
    half: bool = False,
) -> None:
    """Mesh the octant and the platen and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length; the edge of the octant is approximately a multiple of it.
        order: Degree of the geometry, 1 or 2.
        platen: Whether there is a platen.
        half: Whether to mesh half of the octant.
    """
    if half:
        _write_half(path, max(1, round(HALF / size)), order, platen)
        return
    with gmsh_session() as gmsh:
        cube = add_box([-HALF, -HALF, 0.0], [HALF, HALF, HALF])
        bodies = {"cube": [cube[1]]}
        if platen:
            above = add_box([-HALF, -HALF, HALF], [HALF, HALF, PLATEN])
            _, ((cube,), (above,)) = gmsh.model.occ.fragment([cube], [above])
            bodies = {"cube": [cube[1]], "platen": [above[1]]}
        gmsh.model.occ.synchronize()

        name(3, bodies)
        sides = {"x0": (0, 0.0), "y0": (1, 0.0), "z0": (2, 0.0)}
        name_planes(2, sides | {"top": (2, HALF + PLATEN if platen else HALF)})
        parts = max(1, round(HALF / size))
        for _, curve in gmsh.model.getEntities(1):
            length = gmsh.model.occ.getMass(1, curve)
            gmsh.model.mesh.setTransfiniteCurve(
                curve, (parts if length > (HALF + PLATEN) / 2 else 1) + 1
            )
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(surface)
        for _, volume in gmsh.model.getEntities(3):
            gmsh.model.mesh.setTransfiniteVolume(volume)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        # Not write_split, which would separate the platen from the cube.
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))


def _write_half(path: str | Path, count: int, order: int, platen: bool) -> None:
    """Write half of the octant, with ``count`` cubes along an edge."""
    along = -HALF + HALF * np.arange(count + 1) / count
    up = np.append(along + HALF, HALF + PLATEN)[: count + 1 + platen]
    x, cells = Kuhn((layers(along), layers(along), layers(up, "-")), in_sector).cells()
    above = x[cells].mean(axis=1)[:, 2] > HALF
    bodies = {"cube": cells[~above]}
    if platen:
        bodies["platen"] = cells[above]
    surfaces = {"x0": on(0, 0.0), "diagonal": ON_DIAGONAL, "z0": on(2, 0.0), "top": on(2, up[-1])}
    with gmsh_session():
        write_tetrahedra(path, x, bodies, surfaces, order)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_rough_cube, "Mesh an octant of a cube and a platen on it.")
    parser.add_argument("--no-platen", dest="platen", action="store_false", help="the cube alone")
    parser.add_argument("--half", action="store_true", help="half of the octant, with y ≤ x")
    write_from(parser, write_rough_cube)


if __name__ == "__main__":
    main()
