"""Convert an XDMF file of DOLFINx, with tags of cells and facets, to a gmsh file.

    python3 meshes/from_xdmf.py blocks.xdmf blocks.msh --bodies bodies lower=1 --surfaces sides a=3

``bodies`` and ``sides`` are the names of the tags in the XDMF file; the following arguments name
the values of the tags. Cells are straight tetrahedra, or triangles in a plane. One process.
"""

import argparse
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh import gmsh_session

SIMPLEX = {2: 1, 3: 2, 4: 4}
"""Gmsh's element type of a simplex by its number of nodes."""

Tags = tuple[npt.NDArray, npt.NDArray]
"""Nodes of the tagged entities, shape (n, nodes); values, shape (n,)."""


def read_grid(source: Path, name: str, items: Sequence[str]) -> list[npt.NDArray]:
    """Return arrays of a grid in an XDMF file.

    Args:
        source: The XDMF file.
        name: Name of the grid.
        items: Paths of its elements that contain a DataItem.

    Raises:
        InputError: If the grid does not exist, or if its arrays cannot be read.
    """
    try:
        grids = {grid.get("Name"): grid for grid in ET.parse(source).iter("Grid")}
        if name not in grids:
            found = ", ".join(str(other) for other in grids)
            raise InputError(f"'{source}' has no grid '{name}'; it has {found}")
        arrays = []
        for item in items:
            text = grids[name].findtext(f"{item}/DataItem") or ""
            file, _, place = text.strip().partition(":")
            with h5py.File(source.parent / file, "r") as data:
                arrays.append(np.asarray(data[place]))
    except (OSError, ET.ParseError, KeyError) as error:
        raise InputError(f"'{source}' cannot be read ({error}); write it by DOLFINx") from error
    return arrays


def write_msh(
    target: Path,
    points: npt.NDArray[np.float64],
    parts: Sequence[tuple[Tags, Mapping[str, int]]],
) -> None:
    """Write nodes and named simplices as a gmsh file.

    Args:
        target: The .msh file.
        points: Coordinates, shape (n, 3).
        parts: Tags of cells and tags of facets, each with the tag values by name.

    Raises:
        InputError: If no entity has the value for a name.
    """
    with gmsh_session() as gmsh:
        for (nodes, values), names in parts:
            kind, dim = SIMPLEX[nodes.shape[1]], nodes.shape[1] - 1
            for name, value in names.items():
                chosen = nodes[values == value]
                if not len(chosen):
                    known = ", ".join(map(str, np.unique(values)))
                    raise InputError(
                        f"nothing has the value {value} of '{name}'; there is {known}."
                    )
                entity = gmsh.model.addDiscreteEntity(dim)
                if not gmsh.model.mesh.getMaxNodeTag():  # all nodes belong to the first body
                    every = np.arange(1, len(points) + 1)
                    gmsh.model.mesh.addNodes(dim, entity, every, points.ravel())
                gmsh.model.mesh.addElementsByType(entity, kind, [], (chosen + 1).ravel())
                gmsh.model.addPhysicalGroup(dim, [entity], name=name)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(target))


def main(argv: Sequence[str] | None = None) -> None:
    """Convert a file."""
    parser = argparse.ArgumentParser(description="A gmsh file from an XDMF file of DOLFINx.")
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--mesh", default="mesh", help="name of the mesh (mesh)")
    for what in ("bodies", "surfaces"):
        parser.add_argument(f"--{what}", nargs="+", required=True, metavar=("TAGS", "NAME=VALUE"))
    arguments = parser.parse_args(argv)
    try:
        [points] = read_grid(arguments.source, arguments.mesh, ["Geometry"])
        coordinates = np.zeros((len(points), 3))
        coordinates[:, : points.shape[1]] = points
        parts = []
        for tags, *names in (arguments.bodies, arguments.surfaces):
            nodes, values = read_grid(arguments.source, tags, ["Topology", "Attribute"])
            pairs = dict(name.split("=", 1) for name in names)
            parts.append(((nodes, values.ravel()), {key: int(v) for key, v in pairs.items()}))
        write_msh(arguments.target, coordinates, parts)
    except (InputError, ValueError) as error:
        sys.exit(f"from_xdmf: {error}")


if __name__ == "__main__":
    main()
