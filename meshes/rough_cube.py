"""An octant of a unit cube between rough platens, with the platen on it, in layers of tetrahedra.

The cube's octant is (−HALF, 0)²×(0, HALF), in which the diagonals of gmsh's layers suit the slip
lines: bounds are closer by a third than in (0, HALF)³. Volumes ``cube`` and ``platen``, one body of
shared nodes whose common face has no name; surfaces ``x0``, ``y0``, ``z0`` (the symmetry planes, x0
and y0 of both) and ``top``, which is the platen's. Without the platen ``top`` is the cube's. Half
of the octant is what has y ≤ x, with the plane of symmetry ``diagonal`` in place of ``y0``, in
cubes that are cut along their diagonals to the middle of the whole.
"""

import itertools
from pathlib import Path

import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.mitred import Place, on, on_mitre, write_body
from meshes.naming import name, name_planes
from meshes.shapes import add_box
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
    """Mesh the octant and the platen and write a .msh file. On one process.

    Args:
        path: The file to write.
        size: Edge length, of which the octant's edge is about a multiple.
        order: Degree of the geometry, 1 or 2.
        platen: Whether there is one.
        half: Whether it is half of the octant.
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
        layers = max(1, round(HALF / size))
        for _, curve in gmsh.model.getEntities(1):
            length = gmsh.model.occ.getMass(1, curve)
            gmsh.model.mesh.setTransfiniteCurve(
                curve, (layers if length > (HALF + PLATEN) / 2 else 1) + 1
            )
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(surface)
        for _, volume in gmsh.model.getEntities(3):
            gmsh.model.mesh.setTransfiniteVolume(volume)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        # Not write_split, which would take the platen off the cube.
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))


def _write_half(path: str | Path, count: int, order: int, platen: bool) -> None:
    """Write half of the octant, of so many cubes along an edge."""
    along = -HALF + HALF * np.arange(count + 1) / count
    up = np.append(along + HALF, HALF + PLATEN)[: count + 1 + platen]
    shape = (count + 1, count + 1, len(up))
    corners = np.stack(np.meshgrid(*(np.arange(n - 1) for n in shape), indexing="ij"), axis=-1)
    corners = corners.reshape(-1, 3)
    parts, layers = [], []
    for x, y, z in itertools.permutations(range(3)):  # when a path goes along each axis
        steps = np.arange(4)[:, None] > np.array([x, y, z])
        places = corners[:, None] + np.where([True, True, False], steps, ~steps)
        inside = (places[..., 1] <= places[..., 0]).all(axis=1)
        parts.append(places[inside])
        layers.append(corners[inside, 2])
    places, layer = np.concatenate(parts), np.concatenate(layers)
    numbers = np.ravel_multi_index(tuple(np.moveaxis(places, -1, 0)), shape)
    used, cells = np.unique(numbers, return_inverse=True)
    i, j, k = np.unravel_index(used, shape)
    points = np.column_stack([along[i], along[j], up[k]])
    cells = cells.reshape(numbers.shape)
    turned = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    bodies = {"cube": cells[layer < count]}
    if platen:
        bodies["platen"] = cells[layer == count]
    surfaces: dict[str, list[Place]] = {"x0": [on(0, 0.0)], "diagonal": [on_mitre]}
    surfaces |= {"z0": [on(2, 0.0)], "top": [on(2, float(up[-1]))]}
    with gmsh_session():
        write_body(path, bodies, points, surfaces, order)


def main() -> None:
    """Write the mesh that the command line asks for."""
    parser = mesh_parser(write_rough_cube, "Mesh an octant of a cube and a platen on it.")
    parser.add_argument("--no-platen", dest="platen", action="store_false", help="the cube alone")
    parser.add_argument("--half", action="store_true", help="half of the octant, with y ≤ x")
    write_from(parser, write_rough_cube)


if __name__ == "__main__":
    main()
