"""Mesh a quarter of a thick tube in plane strain with straight sides, inside or around the tube.

The radii are 1 and 2, and both circles have equally many sides. The *lesser* polygon lies in the
tube. The tube carries any pressure that this polygon carries: the pressure itself is an admissible
stress in the rest of the tube. The *larger* polygon contains the tube, so its mechanisms are
mechanisms of the tube. The volume is ``tube``; curves are ``inner``, ``outer``, ``x0`` and ``y0``
(the symmetry lines).
"""

import math
from pathlib import Path

import numpy as np

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from perfplast_fenicsx.mesh import gmsh_session, write_split

INNER, OUTER = 1.0, 2.0
"""Inner and outer radius."""
LINE, TRIANGLE = 1, 2
"""Gmsh's types of elements."""


def write_tube_polygon(
    path: str | Path, lesser: bool = False, size: float = 0.05, order: int = 1
) -> None:
    """Mesh a quarter of the tube and write a .msh file. Not collective.

    Args:
        path: The file to write.
        lesser: Whether the polygon lies in the tube; otherwise it contains the tube.
        size: Approximate length of the sides at the inner radius. Quadrilaterals with equal length
            and width are divided into four by their diagonals.
        order: Degree of the geometry, 1 or 2.
    """
    sides = max(1, round(math.pi / 2 * INNER / size))
    rings = max(1, int(math.log(OUTER / INNER) / (math.pi / 2 / sides)))
    around = 1 / math.cos(math.pi / (4 * sides))
    inner, outer = (INNER * around, OUTER) if lesser else (INNER, OUTER * around)
    turn = np.linspace(0.0, math.pi / 2, sides + 1)
    radius = inner * (outer / inner) ** np.linspace(0.0, 1.0, rings + 1)
    x = radius[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    x[:, -1, 0] = 0.0  # removes the rounding error of the cosine
    number = np.arange(x[..., 0].size).reshape(rings + 1, sides + 1)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    middle = number.size + np.arange(rings * sides).reshape(rings, sides)
    points = np.concatenate(
        [x.reshape(-1, 2), x.reshape(-1, 2)[np.array(corners)].mean(axis=0).reshape(-1, 2)]
    )
    cells = [
        np.stack([a, b, middle], axis=-1)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    curves = {"inner": number[0], "outer": number[-1], "y0": number[:, 0], "x0": number[:, -1]}
    with gmsh_session() as gmsh:
        model = gmsh.model
        lines = {label: model.addDiscreteEntity(1) for label in curves}
        tube = model.addDiscreteEntity(2, boundary=list(lines.values()))
        tags = np.arange(1, len(points) + 1)
        model.mesh.addNodes(2, tube, tags, np.pad(points, ((0, 0), (0, 1))).ravel())
        model.mesh.addElementsByType(tube, TRIANGLE, [], np.stack(cells).ravel() + 1)
        for label, chain in curves.items():
            ends = np.stack([chain[:-1], chain[1:]], axis=1)
            model.mesh.addElementsByType(lines[label], LINE, [], ends.ravel() + 1)
        name(2, {"tube": [tube]})
        name(1, {label: [line] for label, line in lines.items()})
        model.mesh.setOrder(order)
        write_split(path)


def main() -> None:
    """Write the mesh that the command line describes."""
    parser = mesh_parser(write_tube_polygon, "Mesh a quarter of a tube with straight sides.")
    parser.add_argument("--lesser", action="store_true", help="a polygon that lies in the tube")
    write_from(parser, write_tube_polygon)


if __name__ == "__main__":
    main()
