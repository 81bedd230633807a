"""Hide the differences between DOLFINx 0.9 and its successors that this package meets.

The tests pass with 0.9 and 0.11; with 0.10 a part of them was run (docs/howto/install.md).

Three more differences are avoided by the form of a call, the same for all versions:

- ``create_mesh(comm, cells, x=..., e=...)`` with keywords, because the order of ``x`` and ``e``
  changed in 0.10;
- ``dolfinx.graph.adjacencylist(data)`` for ``meshtags_from_entities``, a C++ object in 0.9 and a
  Python object later;
- ``assemble_matrix(A, a, bcs, 1.0)`` with the diagonal's value by position, because its name is
  ``diagonal`` in 0.9 and ``diag`` later.

:mod:`tagged_mesh` distributes gmsh's arrays. ``dolfinx.io.gmshio`` is not used (``dolfinx.io.gmsh``
from 0.10, with another return value), since its checks stop one rank and leave the others waiting.
"""

from collections.abc import Callable
from typing import Any

from petsc4py import PETSc

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from dolfinx.graph import adjacencylist
from dolfinx.mesh import Mesh, entities_to_geometry

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.parallel import lasting


def interpolation_points(element: Any) -> Floats:
    """Return the points of the reference cell where an ``Expression`` is evaluated.

    Args:
        element: ``V.element`` of a function space.

    Returns:
        Points, shape (num_points, tdim). DOLFINx has a method up to 0.9, a property from 0.10.
    """
    points = element.interpolation_points
    return points() if callable(points) else points


def geometry_dofmap(mesh: Mesh) -> Ints:
    """Return the local geometry nodes of each local cell, shape (num_cells, nodes_per_cell).

    They are ``geometry.dofmap`` up to 0.10, and the first of the list ``geometry.dofmaps`` in 0.11,
    which still has the other name, but warns of its use.
    """
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    return dofmaps[0] if isinstance(dofmaps, list) else mesh.geometry.dofmap


def coordinate_map(mesh: Mesh) -> Any:
    """Return the coordinate element of the cells.

    It is ``geometry.cmap`` up to 0.10, and the first of the list ``geometry.cmaps`` in 0.11.
    """
    cmaps = getattr(mesh.geometry, "cmaps", None)
    return cmaps[0] if isinstance(cmaps, list) else mesh.geometry.cmap


def entity_nodes(mesh: Mesh, dim: int, entities: Ints) -> Ints:
    """Return local geometry nodes of entities, shape (num_entities, nodes_per_entity).

    Not collective.

    The function ``entities_to_geometry`` of 0.9 ends the process if ``entities`` is empty, as it
    often is on some ranks. (Closure dofs are counted, because 0.11 has no
    ``num_entity_closure_dofs``.)

    Args:
        mesh: The mesh, with the connectivities between ``dim`` and the cells' dimension.
        dim: Dimension of the entities.
        entities: Local indices.
    """
    if entities.size:
        return entities_to_geometry(mesh, dim, entities)
    size = len(coordinate_map(mesh).create_dof_layout().entity_closure_dofs(dim, 0))
    return np.empty((0, size), dtype=np.int32)


def create_vector(V: fem.FunctionSpace) -> PETSc.Vec:
    """Return a vector of zeros for the unknowns of a space. Collective.

    DOLFINx has ``dolfinx.la.create_petsc_vector`` in 0.9, ``dolfinx.la.petsc.create_vector`` from
    0.10.

    Args:
        V: The space.
    """
    unknowns, block = V.dofmap.index_map, V.dofmap.index_map_bs
    size = (unknowns.size_local * block, unknowns.size_global * block)
    ghosts = unknowns.ghosts.astype(PETSc.IntType)
    vector = PETSc.Vec().createGhost(ghosts, size=size, bsize=block, comm=lasting(V.mesh.comm))
    vector.zeroEntries()
    return vector


def interpolation_matrix(V: fem.FunctionSpace, W: fem.FunctionSpace) -> PETSc.Mat:
    """Return the interpolation matrix from one space to another, on a lasting communicator.

    Collective.

    DOLFINx creates its matrix on the communicator of the mesh.

    Args:
        V: Space of the functions that are interpolated: columns.
        W: The other space: rows.
    """
    made = fem_petsc.interpolation_matrix(V, W)
    made.assemble()
    sizes, entries, comm = made.getSizes(), made.getValuesCSR(), lasting(V.mesh.comm)
    lasts = PETSc.Mat().createAIJ(sizes, made.getBlockSizes(), csr=entries, comm=comm)
    made.destroy()
    return lasts


def evaluate(expression: fem.Expression, function: fem.Function, cells: Ints) -> None:
    """Evaluate an expression into a function at the points of some cells. Not collective.

    ``Function.interpolate`` does the same, but defines its dispatch on types at each call. This
    takes 0.2 ms, as long as the evaluation in 2 000 cells. The C++ method has a different name from
    0.10 on.

    Args:
        expression: Expression compiled for the interpolation points of the function's element.
        function: Function of a space on the expression's mesh.
        cells: Local indices.
    """
    target = function._cpp_object
    method = getattr(target, "interpolate_expr", None) or target.interpolate
    method(expression._cpp_object, cells, cells)


def sent_to(ranks: Ints) -> Callable[..., Any]:
    """Return a partitioner that sends cells to given ranks.

    The partitioner returns a C++ object: that of ``adjacencylist`` up to 0.9, a member of it later.

    Args:
        ranks: Destination ranks of this rank's cells.
    """
    lists: Any = adjacencylist(ranks.astype(np.int32)[:, None])
    return lambda *_: getattr(lists, "_cpp_object", lists)
