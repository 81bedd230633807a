"""Split each cell of a mesh from its centre into one part per facet (Alfeld split).

On such split tetrahedra, quadratic velocities can preserve the volume everywhere, and linear
stresses can satisfy equilibrium everywhere (P. Alfeld, A trivariate Clough–Tocher scheme for
tetrahedral data, Comput. Aided Geom. Des. 1 (1984), 169). Facets of the given mesh are not divided,
so matching surfaces still match.
"""

from dataclasses import dataclass, field

import basix.ufl
import numpy as np
import ufl
from dolfinx import la
from dolfinx.mesh import create_mesh

from perfplast_fenicsx.arrays import Ints, Longs
from perfplast_fenicsx.compat import sent_to
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, cell_meshtags, distributed_tags


@dataclass(frozen=True, eq=False, repr=False)
class AlfeldSplit(TaggedMesh):
    """A mesh whose cells are parts of the cells of another mesh; the names are the same.

    Attributes:
        parents: Local index of the parent cell of each local cell.
    """

    parents: Ints = field(kw_only=True)


def alfeld_split(tagged_mesh: TaggedMesh) -> AlfeldSplit:
    """Return the mesh with each cell split from its centre; the parts stay on the cell's rank.

    Collective.

    Args:
        tagged_mesh: Triangles or tetrahedra with straight sides, without ghost cells.

    Raises:
        InputError: If cells are curved.
    """
    mesh = tagged_mesh.mesh
    if has_curved_cells(mesh):
        raise InputError(
            "cells are curved, but only straight cells can be split; save the mesh with "
            "first-order elements."
        )
    comm, topology = mesh.comm, mesh.topology
    tdim = topology.dim
    vertices, points = corners(mesh)
    count = len(vertices)
    centres = points[vertices].mean(axis=1)
    owned = topology.index_map(0).size_local
    x = np.concatenate([points[:owned], centres])
    first = comm.exscan(len(x)) or 0
    numbers = la.vector(topology.index_map(0), 1, dtype=np.int64)
    numbers.array[:owned] = first + np.arange(owned)
    numbers.scatter_forward()
    nodes: Longs = np.repeat(numbers.array[vertices][:, None], tdim + 1, axis=1)
    part = np.arange(tdim + 1)
    nodes[:, part, part] = first + owned + np.arange(count)[:, None]
    first_cell = (tdim + 1) * (comm.exscan(count) or 0)
    element = basix.ufl.element(
        "Lagrange", topology.cell_name(), 1, shape=(mesh.geometry.dim,), dtype=x.dtype
    )
    cells = nodes.reshape(-1, tdim + 1)
    here = sent_to(np.full(len(cells), comm.rank))
    split = create_mesh(comm, cells, x=x, e=ufl.Mesh(element), partitioner=here)
    parents: Ints = ((split.topology.original_cell_index - first_cell) // (tdim + 1)).astype(
        np.int32
    )
    tags = np.zeros(count, dtype=np.int32)
    tagged = tagged_mesh.cell_tags.indices < count
    tags[tagged_mesh.cell_tags.indices[tagged]] = tagged_mesh.cell_tags.values[tagged]
    mine = tagged_mesh.facet_tags.indices < topology.index_map(tdim - 1).size_local
    topology.create_connectivity(tdim - 1, 0)
    to_vertices = topology.connectivity(tdim - 1, 0).array.reshape(-1, tdim)
    facets = numbers.array[to_vertices[tagged_mesh.facet_tags.indices[mine]]]
    return AlfeldSplit(
        mesh=split,
        cell_tags=cell_meshtags(split, tags[parents]),
        facet_tags=distributed_tags(
            split, tdim - 1, facets, tagged_mesh.facet_tags.values[mine].astype(np.int32)
        ),
        volumes=tagged_mesh.volumes,
        surfaces=tagged_mesh.surfaces,
        section=tagged_mesh.section,
        taken=tagged_mesh.taken,
        parents=parents,
    )
