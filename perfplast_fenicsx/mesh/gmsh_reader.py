"""Open gmsh sessions, and read .msh files by gmsh in a separate process.

This module does not use MPI.
"""

import json
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from types import ModuleType

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.environment import environment_for_gmsh
from perfplast_fenicsx.errors import LARGEST, InputError, place_of

NO_GMSH = (
    "gmsh's Python module cannot be loaded; install it (pip install gmsh, or Debian's package "
    "python3-gmsh), then test it with perfplast doctor."
)


CONVERT = "convert it with meshio, as docs/howto/mesh_formats.md shows under 'Other formats'"
MODEL = "convert it to a mesh and a case with perfplast mesh"

REMEDIES = {
    **dict.fromkeys((".e", ".exo"), CONVERT),
    **dict.fromkeys((".inp", ".med", ".unv", ".bdf", ".nas", ".fem", ".vtu", ".vtk"), MODEL),
    **dict.fromkeys(
        (".xdmf", ".h5"), "convert it with meshes/from_xdmf.py (docs/howto/mesh_formats.md)"
    ),
    **dict.fromkeys(
        (".step", ".stp", ".brep", ".iges", ".igs", ".geo"),
        "give it as file under [geometry] instead of [mesh], or mesh it with perfplast mesh",
    ),
    ".py": "perfplast does not run programs; run it yourself, and give the mesh that it writes",
}
"""Remedies for other kinds of files, by suffix."""


@dataclass(frozen=True)
class Block:
    """Elements of one type in one entity; ``nodes`` has gmsh's node tags, a row per element."""

    dim: int
    entity: int
    groups: list[int]
    kind: int
    nodes: Longs


@dataclass(frozen=True)
class Content:
    """The content of a mesh file, which :mod:`perfplast_fenicsx.mesh.gmsh_dump` has read.

    Attributes:
        blocks: The elements in blocks.
        groups: Dimension, tag and name of the physical groups.
        types: Name and number of nodes of each element type.
        tags: Tags of the nodes, shape (num_nodes,).
        coordinates: Coordinates of the nodes, shape (num_nodes, 3).
    """

    blocks: list[Block]
    groups: list[tuple[int, int, str]]
    types: dict[int, tuple[str, int]]
    tags: Longs
    coordinates: Floats


def read_content(path: Path) -> Content:
    """Return the content of a file, which gmsh reads in a separate process.

    Raises:
        InputError: If the file is missing or is not a .msh file, or if gmsh is not installed,
            reports an error or crashes.
    """
    _check_header(path)
    program = Path(__file__).with_name("gmsh_dump.py")
    with tempfile.TemporaryDirectory() as folder:
        # Gmsh selects the format by the name of the file, and would run a script FILE.msh.opt next
        # to it.
        alone, target = Path(folder) / "mesh.msh", Path(folder) / "mesh.npz"
        alone.symlink_to(path.absolute())
        command = [sys.executable, "-P", str(program), str(alone), str(target)]
        try:
            done = subprocess.run(
                command,
                env=environment_for_gmsh(Path(folder)),
                cwd=folder,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
            )
        except OSError as error:
            raise InputError(f"gmsh cannot be started to read '{path}': {error}.") from error
        if b"    import gmsh" in done.stderr:  # the traceback shows this line
            raise InputError(NO_GMSH)
        if not target.exists() or done.returncode:
            end = f"exit status {done.returncode}"
            if done.returncode < 0:
                end = signal.strsignal(-done.returncode) or end
            raise InputError(
                f"gmsh cannot read '{path}': it crashed ({end.lower()}), so the file may be "
                "damaged; save the mesh again."
            )
        with np.load(target) as arrays:
            about = json.loads(str(arrays["about"]))
            if about["fault"] is not None:
                fault = about["fault"].replace(str(alone), str(path))
                raise InputError(
                    f"gmsh cannot read '{path}' ({fault.rstrip('.')}); save the mesh again."
                )
            blocks = [
                Block(dim, entity, groups, kind, arrays[f"block_{number}"].astype(np.int64))
                for number, (dim, entity, groups, kind) in enumerate(about["blocks"])
            ]
            types = {int(kind): tuple(properties) for kind, properties in about["types"].items()}
            nodes = (arrays["tags"].astype(np.int64), arrays["coordinates"])
            return Content(blocks, about["groups"], types, *nodes)


def windows_path(path: Path) -> str:
    """Return a remedy for a missing file, for example for backslashes in its path."""
    name = str(path)
    if not name.isprintable():  # Python reads a tab and a line break in "C:\temp\new.msh"
        return (
            "in double quotes \\ is an escape character: write / in the path, or put the path in "
            "single quotes"
        )
    return "write / for \\ in the path" if "\\" in name else "check the path"


def _check_header(path: Path) -> None:
    # Gmsh would run any other text file as a script, and would wait for the writer of a FIFO.
    try:
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise InputError(f"mesh file '{path}' is not a regular file; save the mesh from gmsh.")
        with path.open("rb") as file:
            head = file.read(11)
    except FileNotFoundError as error:
        raise InputError(f"mesh file '{path}' does not exist; {windows_path(path)}.") from error
    except (OSError, ValueError) as error:  # a name that no file can have raises a ValueError
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"mesh file '{path}' cannot be read ({reason}); check its name and permissions."
        ) from error
    if not head.startswith((b"$MeshFormat", b"$Comments")):
        remedy = REMEDIES.get(path.suffix.lower(), "save the mesh from gmsh as .msh")
        raise InputError(f"'{path}' is not a gmsh .msh file; {remedy}.")


# polynomial degree by gmsh's element type, for each dimension
SIMPLICES = {1: {1: 1, 8: 2}, 2: {2: 1, 9: 2}, 3: {4: 1, 11: 2}}
_ENTITY = ("point", "curve", "surface", "volume")
_SIMPLEX = ("points", "lines", "triangles", "tetrahedra")


@dataclass(frozen=True)
class GmshMesh:
    """Named simplices of one .msh file; the nodes are numbered 0, 1, … without gaps.

    Attributes:
        gdim: 3 for tetrahedra, 2 for triangles.
        degree: Degree of the geometry, 1 or 2.
        points: Node coordinates, shape (num_nodes, 3).
        cells: Nodes of each cell in gmsh's order, shape (num_cells, nodes_per_cell).
        cell_values: Tag of each cell, shape (num_cells,); 0 for a cell without a name.
        facets: Nodes of each named facet, shape (num_facets, nodes_per_facet).
        facet_values: Tag of each named facet, shape (num_facets,): the tag of its physical group,
            or a separate tag if the facet is in several groups.
        facet_count: Number of named facets in the file, including those that belong to no cell.
        volumes: Tags of the cells by name.
        surfaces: Tags of the facets by name; several tags if some facets are also in other groups.
            A group without a name has its number as name.
        remarks: Remarks on omitted parts of the file, one sentence each.
    """

    gdim: int
    degree: int
    points: Floats
    cells: Longs
    cell_values: Ints
    facets: Longs
    facet_values: Ints
    facet_count: int
    volumes: dict[str, int]
    surfaces: dict[str, int | tuple[int, ...]]
    remarks: tuple[str, ...] = ()

    def without_arrays(self) -> "GmshMesh":
        """Return the same mesh with empty arrays, for ranks that do not read the file."""
        arrays = ("points", "cells", "cell_values", "facets", "facet_values")
        return replace(self, **{name: getattr(self, name)[:0] for name in arrays})


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """Open a silent gmsh session with an empty model; afterwards restore a session that was open.

    Raises:
        InputError: If gmsh's Python module is not installed.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise InputError(NO_GMSH) from error
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
    """Return the simplices of the largest dimension in a .msh file, and their named facets.

    Args:
        path: A .msh file with physical groups: tetrahedra, or triangles in a plane z = const.
        gdim: 3 or 2 to accept only a mesh of this dimension; None to accept both.

    Raises:
        InputError: If the file is missing or is not a .msh file, if it has no simplices of this
            dimension or no physical group of bodies, if it has other elements, repeated names, or a
            body in two groups, or if nodes, cells or facets are not valid.
    """
    content = read_content(Path(path))
    gdim = _dimension(content, path, gdim)
    volumes = _names(content, path, gdim)
    if not volumes:
        entity = _ENTITY[gdim]
        raise InputError(
            f"'{path}' has no physical {entity}; define a physical {entity} for each body in gmsh."
        )
    names = _names(content, path, gdim - 1)
    blocks = [block for block in content.blocks if block.dim == gdim]
    degree, cells = _elements(content, path, gdim)
    cell_values = _values(blocks, [_body_of(block, content, path) for block in blocks])
    blocks = [block for block in content.blocks if block.dim == gdim - 1]
    _, facets = _elements(content, path, gdim - 1)
    surfaces, tags_of_blocks = _surface_tags(names, blocks)
    facet_values = _values(blocks, tags_of_blocks)
    tags, coordinates = content.tags, content.coordinates
    named = facet_values > 0
    facets, facet_values = _once(facets[named], facet_values[named])
    # Nodes that belong to no cell, such as nodes of geometry points, are omitted.
    used = np.unique(cells)
    order = np.argsort(tags)
    if not np.isin(used, tags).all():
        raise InputError(
            f"elements in '{path}' refer to nodes that the file does not contain; save the whole "
            "mesh."
        )
    points = coordinates[order[np.searchsorted(tags[order], used)]]
    if gdim == 2 and np.ptp(points[:, 2]) > 1e-12 * np.ptp(points):
        raise InputError(
            f"'{path}' is read as a plane mesh, but its nodes have different z coordinates; draw "
            "the model in a plane z = constant."
        )
    cells = np.searchsorted(used, cells)
    _check_cells(path, points, cells, gdim)
    _check_facets(path, points, cells, gdim)
    corners = np.sort(facets[:, :gdim], axis=1)
    doubled = len(corners) - len(np.unique(corners, axis=0))
    if doubled:
        raise InputError(
            f"{doubled} of the {len(facets)} named surface elements in '{path}' occur twice, in "
            "different surfaces; mesh the model again."
        )
    on_cells = np.isin(facets, used).all(axis=1)
    return GmshMesh(
        gdim=gdim,
        degree=degree,
        points=points,
        cells=cells,
        cell_values=cell_values,
        facets=np.searchsorted(used, facets[on_cells]),
        facet_values=facet_values[on_cells],
        facet_count=facet_values.size,
        volumes={name: tag for name, tag in volumes.items() if tag in cell_values},
        surfaces=surfaces,
        remarks=tuple(_left_out(content, path, gdim, {*surfaces}, cell_values)),
    )


def _check_cells(path: str | Path, points: Floats, cells: Longs, gdim: int) -> None:
    """Raise an error for coordinates that are not finite or too large, and for flat cells."""
    wrong = np.flatnonzero(~(np.abs(points) <= LARGEST).all(axis=1))  # true also for NaN
    if wrong.size:
        raise InputError(
            f"'{path}' has {wrong.size} nodes whose coordinates are not finite or too large, such "
            f"as {place_of(points[wrong[0]])}; save the mesh again."
        )
    first = points[cells[:, 0], :gdim]
    edges = points[cells[:, 1 : gdim + 1], :gdim] - first[:, None]
    longest = np.abs(edges).max(axis=(1, 2), initial=0)
    if (longest > 0).all():
        # A cell counts as flat if its volume, relative to the cube of its longest edge, is below
        # this value.
        least_volume = 1e-12
        flat = np.abs(np.linalg.det(edges / longest[:, None, None])) < least_volume
    else:
        flat = longest == 0
    if flat.any():
        at = place_of(first[np.argmax(flat)])
        raise InputError(
            f"{np.count_nonzero(flat)} cells in '{path}' are degenerate (zero area or volume), the "
            f"first at {at}; mesh the bodies again."
        )


def _check_facets(path: str | Path, points: Floats, cells: Longs, gdim: int) -> None:
    """Raise an error for facets of more than two cells, on which DOLFINx fails."""
    places = [np.delete(np.arange(gdim + 1), place) for place in range(gdim + 1)]
    facets = np.sort(np.concatenate([cells[:, place] for place in places]), axis=1)
    # rows are coded as single numbers, which sort much faster
    if float(len(points)) ** gdim < 2.0**63:
        numbers = facets @ len(points) ** np.arange(gdim, dtype=np.int64)
        _, first, counts = np.unique(numbers, return_index=True, return_counts=True)
    else:
        _, first, counts = np.unique(facets, axis=0, return_index=True, return_counts=True)
    if (counts > 2).any():
        middle = points[facets[first[np.argmax(counts)]], :gdim].mean(axis=0)
        at = place_of(middle)
        raise InputError(
            f"{np.count_nonzero(counts > 2)} facets in '{path}' belong to more than two cells (one "
            f"is at {at}), so cells are repeated or overlap; mesh the bodies again."
        )


def _dimension(content: Content, path: str | Path, gdim: int | None) -> int:
    """Return the dimension of the mesh, after checking it against ``gdim`` if given."""
    dims = [block.dim for block in content.blocks]
    if not dims:
        raise InputError(f"'{path}' has no elements; mesh the model in gmsh before you save it.")
    if max(dims) < 2 or gdim not in (None, max(dims)):
        needed = _SIMPLEX[gdim] if gdim else "triangles or tetrahedra"
        raise InputError(
            f"'{path}' is a mesh of {_SIMPLEX[max(dims)]}, but {needed} are needed; "
            "mesh the bodies with them."
        )
    return max(dims)


def _names(content: Content, path: str | Path, dim: int) -> dict[str, int]:
    """Return the tags of the physical groups of a dimension by name.

    A group without a name has its tag as name.

    Raises:
        InputError: If two groups have the same name.
    """
    names: dict[str, int] = {}
    for tag, name in [(tag, name or str(tag)) for of, tag, name in content.groups if of == dim]:
        if name in names:
            raise InputError(
                f"physical {_ENTITY[dim]}s {names[name]} and {tag} of '{path}' are both named "
                f"'{name}'; join them into one group."
            )
        names[name] = tag
    return names


def _elements(content: Content, path: str | Path, dim: int) -> tuple[int, Longs]:
    """Return the degree and the node tags of all elements of dimension ``dim``."""
    blocks = [block for block in content.blocks if block.dim == dim]
    types = {block.kind for block in blocks}
    if len(types) > 1 or not types <= SIMPLICES[dim].keys():
        names = ", ".join(content.types[kind][0] for kind in sorted(types))
        raise InputError(
            f"'{path}' has elements of type {names}, but all must be {_SIMPLEX[dim]} of one "
            "degree, 1 or 2; mesh the model again."
        )
    kind = types.pop() if types else min(SIMPLICES[dim])
    size = content.types[kind][1] if blocks else dim + 1
    nodes = [np.empty((0, size), dtype=np.int64), *(block.nodes for block in blocks)]
    return SIMPLICES[dim][kind], np.concatenate(nodes)


def _values(blocks: Sequence[Block], tags: Sequence[int]) -> Ints:
    """Return the tag of each element from the tags of the blocks."""
    counts = [len(block.nodes) for block in blocks]
    return np.repeat(np.array(tags, dtype=np.int32), np.array(counts, dtype=np.int64))


def _body_of(block: Block, content: Content, path: str | Path) -> int:
    """Return the physical group of a block of cells; 0 if the block is in no group.

    Raises:
        InputError: If the cells are in several groups.
    """
    if len(block.groups) > 1:
        known = {tag: name or str(tag) for of, tag, name in content.groups if of == block.dim}
        names = " and ".join(f"'{known[tag]}'" for tag in block.groups)
        raise InputError(
            f"{_ENTITY[block.dim]} {block.entity} of '{path}' is in the physical groups {names}, "
            "but a body has only one name; keep it in one group."
        )
    return block.groups[0] if block.groups else 0


def _surface_tags(
    names: dict[str, int], blocks: Sequence[Block]
) -> tuple[dict[str, int | tuple[int, ...]], list[int]]:
    """Return the tags of each surface, and the tag of each block (0 if it is in no group).

    Blocks that are in the same combination of several groups share a separate tag.

    Args:
        names: Tags of the physical groups by name.
        blocks: Blocks of facets.
    """
    kinds = [tuple(sorted(block.groups)) for block in blocks]
    new = count(max(names.values(), default=0) + 1)
    tags: dict[tuple[int, ...], int] = {(): 0}
    tags.update({(tag,): tag for tag in names.values()})
    for kind in kinds:
        if kind not in tags:
            tags[kind] = next(new)
    there = {kind for kind, block in zip(kinds, blocks, strict=True) if len(block.nodes)}
    found: dict[str, int | tuple[int, ...]] = {}
    for name, group in names.items():
        parts = tuple(sorted(tags[kind] for kind in there if group in kind))
        if parts:
            found[name] = parts[0] if len(parts) == 1 else parts
    return found, [tags[kind] for kind in kinds]


def _once(facets: Longs, values: Ints) -> tuple[Longs, Ints]:
    """Return facets and tags without repetition; old files list a facet once for each group."""
    rows = np.column_stack([np.sort(facets, axis=1), values])
    first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
    return facets[first], values[first]


def _left_out(
    content: Content, path: str | Path, gdim: int, surfaces: set[str], cell_values: Ints
) -> Iterator[str]:
    """Yield a remark for each dimension with physical groups that name nothing in the mesh."""
    for dim in range(gdim + 1):
        names = {name or str(tag): tag for of, tag, name in content.groups if of == dim}
        if dim == gdim:
            names = {name: tag for name, tag in names.items() if tag not in cell_values}
        if dim == gdim - 1:
            names = {name: tag for name, tag in names.items() if name not in surfaces}
        if not names:
            continue
        why = (
            "has no elements"
            if dim >= gdim - 1
            else f"is ignored, because supports and loads act on {_ENTITY[gdim - 1]}s"
        )
        listed = ", ".join(f"'{name}'" for name in names)
        yield f"the physical {_ENTITY[dim]} {listed} of '{path}' {why}"
