"""Check whether the case and the mesh are the same.

A restart uses this check before it continues.
"""

import copy
import hashlib
import json
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import Any

import numpy as np

from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap
from perfplast_fenicsx.io.case.schema import Table, shown
from perfplast_fenicsx.io.results.parallel_hdf5 import checksum, set_checksum
from perfplast_fenicsx.mesh.global_ordering import Ordering, block, node_ordering, with_ghosts
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.spatial_fields import PointValues, varying

NOTHING = object()

CONTENT = "content"
"""Key of the hash of a file's content, next to its name in ``file``."""


def case_hash(table: Table) -> str:
    """Return the SHA-256 of the data of a case file, independent of layout and comments."""
    text = json.dumps(table, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def with_contents(table: Table, materials: Mapping[str, object]) -> Table:
    """Return a case with the hash of each data file next to its name.

    Args:
        table: Content of the case file.
        materials: Its materials, by the names of the bodies.
    """
    found = copy.deepcopy(table)
    for body, material in materials.items():
        for key, field in varying(material).items():
            if isinstance(field, PointValues):
                found["material"][body][key][CONTENT] = field.net.digest
    return found


def first_difference(now: Table, then: Table) -> str | None:
    """Return in words where a case differs from an earlier one; None if it does not.

    Additional load levels at the end are not a difference.
    """
    entries, earlier = dict(_entries(now)), dict(_entries(then))
    levels = ("loading.values",)  # lists to which a restart may append
    for key in (*entries, *earlier):
        new, old = entries.get(key, NOTHING), earlier.get(key, NOTHING)
        if key.endswith(f".{CONTENT}") and new != old:
            file = entries[key.removesuffix(CONTENT) + "file"]
            return f"the content of '{file}' differs from that"
        if new is NOTHING:
            return f"{key} is not given, but was {shown(old)}"
        if old is NOTHING:
            return f"{key} = {shown(new)}, but was not given"
        if new != old and not (key in levels and _goes_on(new, old)):
            return _changed(key, new, old)
    return None


def _goes_on(new: object, old: object) -> bool:
    """Return whether a list is an earlier list with more entries at its end."""
    both = isinstance(new, list) and isinstance(old, list)
    return both and len(new) > len(old) and new[: len(old)] == old  # type: ignore[arg-type,index]


def _changed(key: str, new: object, old: object) -> str:
    """Return a text on the changed value; for lists on the first changed entry."""
    if not (isinstance(new, list) and isinstance(old, list)):
        return f"{key} = {shown(new)}, but was {shown(old)}"
    pairs = enumerate(zip_longest(new, old, fillvalue=NOTHING), start=1)
    number, (now, then) = next((n, both) for n, both in pairs if both[0] != both[1])
    if now is NOTHING:
        return f"{key} has {len(new)} entries, but had {len(old)}"
    if then is NOTHING:
        return (
            f"{key} has {len(new)} entries, but had {len(old)}; the first additional one "
            f"is {shown(now)}"
        )
    return f"{key}: entry {number} is {shown(now)}, but was {shown(then)}"


def mesh_hash(tagged_mesh: TaggedMesh, cells: Ordering) -> str:
    """Return a hash of points, cells and tags, the same on any number of ranks. Collective."""
    mesh = tagged_mesh.mesh
    comm, tdim, dofs = mesh.comm, mesh.topology.dim, geometry_dofmap(mesh)
    index_map = mesh.geometry.index_map()
    owned = mesh.topology.index_map(tdim).size_local
    nodes = node_ordering(mesh, dofs, index_map)
    number = with_ghosts(index_map, nodes.numbers())
    body = np.zeros(len(dofs), dtype=np.int64)
    body[tagged_mesh.cell_tags.indices] = tagged_mesh.cell_tags.values
    x = mesh.geometry.x[: index_map.size_local]

    tags = tagged_mesh.facet_tags
    ours = tags.indices < mesh.topology.index_map(tdim - 1).size_local
    corners = number[entity_nodes(mesh, tdim - 1, tags.indices[ours])[:, :tdim]]
    facets = np.column_stack([np.sort(corners, axis=1), tags.values[ours]]).astype(np.int64)
    names = sorted(tagged_mesh.volumes.items()), sorted(tagged_mesh.surfaces.items())
    sums = [
        checksum(comm, block(nodes, x)),
        checksum(comm, block(cells, number[dofs[:owned]])),
        checksum(comm, block(cells, body[:owned])),
        set_checksum(comm, facets),
    ]
    return hashlib.sha256(json.dumps([sums, names]).encode()).hexdigest()


def _entries(table: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield values of nested tables by names such as ``material.upper.young``, ``load[2].on``."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield from _entries(value, f"{place}.{key}" if place else key)
    elif isinstance(table, list) and table and all(isinstance(item, dict) for item in table):
        for number, item in enumerate(table, start=1):
            yield from _entries(item, f"{place}[{number}]" if len(table) > 1 else place)
    else:
        yield place, table
