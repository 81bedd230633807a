"""Gmsh on one process: a quiet session, and a .msh file as checked arrays. No MPI."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError

# Gmsh element type -> polynomial degree, by dimension.
SIMPLICES = {1: {1: 1, 8: 2}, 2: {2: 1, 9: 2}, 3: {4: 1, 11: 2}}
_ENTITY = ("point", "curve", "surface", "volume")
_SIMPLEX = ("points", "lines", "triangles", "tetrahedra")


@dataclass(frozen=True)
class GmshMesh:
    """Named simplices of one .msh file, nodes numbered 0, 1, … without gaps.

    Attributes:
        gdim: 3 for tetrahedra, 2 for triangles.
        degree: Degree of the geometry, 1 or 2.
        points: Node coordinates, shape (num_nodes, 3).
        cells: Nodes of each cell in gmsh's order, shape (num_cells, nodes_per_cell).
        cell_values: Tag of each cell's name, shape (num_cells,); 0 where it has none.
        facets: Nodes of each named facet, shape (num_facets, nodes_per_facet).
        facet_values: Tag of each named facet's name, shape (num_facets,).
        facet_count: Number of named facets in the file, whether they belong to cells or not.
        volumes: Name to tag of the cells.
        surfaces: Name to tag of the facets.
    """

    gdim: int
    degree: int
    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    cell_values: npt.NDArray[np.int32]
    facets: npt.NDArray[np.int64]
    facet_values: npt.NDArray[np.int32]
    facet_count: int
    volumes: dict[str, int]
    surfaces: dict[str, int]

    def without_arrays(self) -> "GmshMesh":
        """The same with arrays of no rows: what the ranks that read nothing contribute."""
        arrays = ("points", "cells", "cell_values", "facets", "facet_values")
        return replace(self, **{name: getattr(self, name)[:0] for name in arrays})


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """Gmsh, quiet, in an empty model of its own; a gmsh already in use is left as it was.

    Raises:
        InputError: If gmsh's Python module is not installed.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise InputError(
            "gmsh's Python module cannot be loaded; install it (Debian package python3-gmsh)"
        ) from error
    in_use = bool(gmsh.isInitialized())
    if in_use:
        model = gmsh.model.getCurrent()
        terminal = gmsh.option.getNumber("General.Terminal")
    else:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("perfplast")
    try:
        yield gmsh
    finally:
        if in_use:
            gmsh.model.remove()
            gmsh.model.setCurrent(model)
            gmsh.option.setNumber("General.Terminal", terminal)
        else:
            gmsh.finalize()


def read_msh(path: str | Path, gdim: int | None = None) -> GmshMesh:
    """Read the simplices of the largest dimension and their named facets.

    Args:
        path: A .msh file with physical names: tetrahedra, or triangles in a plane z = const.
        gdim: 3 or 2, if only such a mesh will do.

    Raises:
        InputError: If the file is missing, is not gmsh's, has no simplices of that dimension or
            others beside them, or names that are missing, double or on the same entity.
    """
    _check_header(Path(path))
    with gmsh_session() as gmsh:
        gmsh.logger.start()
        try:
            gmsh.merge(str(path))
            faults = [line for line in gmsh.logger.get() if line.startswith("Error")]
        except Exception as error:  # gmsh raises nothing more specific
            raise InputError(f"gmsh cannot read '{path}': {error}") from error
        finally:
            gmsh.logger.stop()  # or the next file would be blamed for this one's faults
        if faults:
            raise InputError(f"gmsh cannot read '{path}': {faults[0].partition(':')[2].strip()}")
        gdim = _dimension(gmsh, path, gdim)
        volumes = _names(gmsh, path, gdim)
        if not volumes:
            entity = _ENTITY[gdim]
            raise InputError(f"'{path}' has no physical {entity}; name each body by one in gmsh")
        surfaces = _names(gmsh, path, gdim - 1)
        degree, cells, cell_values = _elements(gmsh, path, gdim)
        _, facets, facet_values = _elements(gmsh, path, gdim - 1)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
    named = facet_values > 0
    facets, facet_values = facets[named], facet_values[named]
    # Nodes of geometry points, unnamed surfaces, … are left out.
    used = np.unique(cells)
    order = np.argsort(tags)
    points = coordinates.reshape(-1, 3)[order[np.searchsorted(tags[order], used)]]
    if gdim == 2 and np.ptp(points[:, 2]) > 1e-12 * np.ptp(points):
        raise InputError(f"'{path}' is read as a plane mesh but its nodes have different z")
    on_cells = np.isin(facets, used).all(axis=1)
    return GmshMesh(
        gdim=gdim,
        degree=degree,
        points=points,
        cells=np.searchsorted(used, cells),
        cell_values=cell_values,
        facets=np.searchsorted(used, facets[on_cells]),
        facet_values=facet_values[on_cells],
        facet_count=facet_values.size,
        volumes={name: tag for name, tag in volumes.items() if tag in cell_values},
        surfaces={name: tag for name, tag in surfaces.items() if tag in facet_values},
    )


def _check_header(path: Path) -> None:
    # Gmsh itself would run any other text file as a script.
    if not path.exists():
        raise InputError(f"mesh file '{path}' does not exist; check the path")
    try:
        with path.open("rb") as file:
            head = file.read(11)
    except OSError as error:
        raise InputError(f"mesh file '{path}' cannot be read: {error.strerror}") from error
    if not head.startswith((b"$MeshFormat", b"$Comments")):
        raise InputError(f"'{path}' is not a gmsh .msh file; save the mesh from gmsh as .msh")


def _dimension(gmsh: ModuleType, path: str | Path, gdim: int | None) -> int:
    """Dimension of the mesh, which is to be ``gdim`` if that is given."""
    dims = [dim for dim in range(4) if len(gmsh.model.mesh.getElementTypes(dim))]
    if not dims:
        raise InputError(f"'{path}' has no elements; mesh the model in gmsh before saving")
    if max(dims) < 2 or gdim not in (None, max(dims)):
        needed = _SIMPLEX[gdim] if gdim else "triangles or tetrahedra"
        raise InputError(f"'{path}' is a mesh of {_SIMPLEX[max(dims)]} where {needed} are needed")
    return max(dims)


def _names(gmsh: ModuleType, path: str | Path, dim: int) -> dict[str, int]:
    """Name to tag of the physical groups of one dimension."""
    names: dict[str, int] = {}
    for _, tag in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, tag)
        if not name:
            raise InputError(f"physical {_ENTITY[dim]} {tag} of '{path}' has no name; give it one")
        if name in names:
            raise InputError(
                f"physical {_ENTITY[dim]}s {names[name]} and {tag} of '{path}' are both named "
                f"'{name}'; make them one group"
            )
        names[name] = tag
    return names


def _elements(
    gmsh: ModuleType, path: str | Path, dim: int
) -> tuple[int, npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Degree, nodes (gmsh's tags) and physical tags (0 for none) of the elements of a dimension."""
    types: set[int] = set()
    nodes = [np.empty(0, dtype=np.int64)]
    values = [np.empty(0, dtype=np.int32)]
    for _, entity in gmsh.model.getEntities(dim):
        groups = gmsh.model.getPhysicalGroupsForEntity(dim, entity)
        if len(groups) > 1:
            names = " and ".join(f"'{gmsh.model.getPhysicalName(dim, tag)}'" for tag in groups)
            raise InputError(
                f"{_ENTITY[dim]} {entity} of '{path}' is in the physical groups {names}; "
                "an entity can have one name only"
            )
        kinds, tags, connectivity = gmsh.model.mesh.getElements(dim, entity)
        types.update(int(kind) for kind in kinds)
        nodes.extend(array.astype(np.int64) for array in connectivity)
        count = sum(len(array) for array in tags)
        values.append(np.full(count, groups[0] if len(groups) else 0, dtype=np.int32))
    if len(types) > 1 or not types <= SIMPLICES[dim].keys():
        names = ", ".join(gmsh.model.mesh.getElementProperties(kind)[0] for kind in sorted(types))
        raise InputError(
            f"'{path}' has the elements {names}; all must be {_SIMPLEX[dim]} of one degree, 1 or 2"
        )
    kind = types.pop() if types else min(SIMPLICES[dim])
    size = gmsh.model.mesh.getElementProperties(kind)[3]
    return SIMPLICES[dim][kind], np.concatenate(nodes).reshape(-1, size), np.concatenate(values)
