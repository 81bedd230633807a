"""Hide the differences between DOLFINx 0.9 and later versions that concern this package.

The tests pass with 0.9 and 0.11; only a part of them was run with 0.10 (docs/howto/install.md).

Calls avoid three more differences by a form that is the same for all versions:

- ``create_mesh(comm, cells, x=..., e=...)`` with keywords, because the order of ``x`` and ``e``
  changed in 0.10;
- ``dolfinx.graph.adjacencylist(data)`` for ``meshtags_from_entities``, because the list is a C++
  object in 0.9 and a Python object in later versions;
- ``assemble_matrix(A, a, bcs, 1.0)`` with the diagonal's value as a positional argument, because
  the argument's name is ``diagonal`` in 0.9 and ``diag`` in later versions.

:mod:`tagged_mesh` distributes gmsh's arrays. It does not use ``dolfinx.io.gmshio``
(``dolfinx.io.gmsh`` from 0.10 on, with another return value), whose checks stop one rank while the
others wait.
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
    """Return the interpolation points of an element, at which an ``Expression`` is evaluated.

    Args:
        element: ``V.element`` of a function space.

    Returns:
        Points, shape (num_points, tdim). DOLFINx has a method for the points up to 0.9, and a
        property from 0.10 on.
    """
    points = element.interpolation_points
    return points() if callable(points) else points


def geometry_dofmap(mesh: Mesh) -> Ints:
    """Return the local geometry nodes of each local cell, shape (num_cells, nodes_per_cell).

    The nodes are ``geometry.dofmap`` up to 0.10, and the first entry of the list
    ``geometry.dofmaps`` in 0.11. Version 0.11 still has the old name, but warns when it is used.
    """
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    return dofmaps[0] if isinstance(dofmaps, list) else mesh.geometry.dofmap


def coordinate_map(mesh: Mesh) -> Any:
    """Return the coordinate element of the cells.

    The element is ``geometry.cmap`` up to 0.10, and the first entry of the list ``geometry.cmaps``
    in 0.11.
    """
    cmaps = getattr(mesh.geometry, "cmaps", None)
    return cmaps[0] if isinstance(cmaps, list) else mesh.geometry.cmap


def entity_nodes(mesh: Mesh, dim: int, entities: Ints) -> Ints:
    """Return the local geometry nodes of entities, shape (num_entities, nodes_per_entity).

    Not collective.

    The function ``entities_to_geometry`` of 0.9 ends the process if ``entities`` is empty, which is
    common on some ranks. The number of closure dofs is counted here, because 0.11 has no
    ``num_entity_closure_dofs``.

    Args:
        mesh: The mesh, with the connectivities between ``dim`` and the dimension of the cells.
        dim: Dimension of the entities.
        entities: Local indices of the entities.
    """
    if entities.size:
        return entities_to_geometry(mesh, dim, entities)
    size = len(coordinate_map(mesh).create_dof_layout().entity_closure_dofs(dim, 0))
    return np.empty((0, size), dtype=np.int32)


def create_vector(V: fem.FunctionSpace) -> PETSc.Vec:
    """Return a zero vector for the unknowns of a space. Collective.

    The function calls PETSc itself, because DOLFINx's own function is
    ``dolfinx.la.create_petsc_vector`` in 0.9, but ``dolfinx.la.petsc.create_vector`` from 0.10 on.

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

    DOLFINx makes the matrix on the communicator of the mesh, so the function copies the matrix.

    Args:
        V: Space of the interpolated functions, for the columns.
        W: Target space, for the rows.
    """
    made = fem_petsc.interpolation_matrix(V, W)
    made.assemble()
    sizes, entries, comm = made.getSizes(), made.getValuesCSR(), lasting(V.mesh.comm)
    lasts = PETSc.Mat().createAIJ(sizes, made.getBlockSizes(), csr=entries, comm=comm)
    made.destroy()
    return lasts


def evaluate(expression: fem.Expression, function: fem.Function, cells: Ints) -> None:
    """Evaluate an expression into a function, at the points of given cells. Not collective.

    ``Function.interpolate`` does the same, but builds its dispatch on types in each call. The
    dispatch takes 0.2 ms, as long as the evaluation in 2 000 cells. The C++ method has another name
    from 0.10 on.

    Args:
        expression: Expression compiled for the interpolation points of the function's element.
        function: Function of a space on the expression's mesh.
        cells: Local indices of the cells.
    """
    target = function._cpp_object
    method = getattr(target, "interpolate_expr", None) or target.interpolate
    method(expression._cpp_object, cells, cells)


def sent_to(ranks: Ints) -> Callable[..., Any]:
    """Return a partitioner that sends cells to given ranks.

    The partitioner returns a C++ object: the result of ``adjacencylist`` up to 0.9, and a member of
    this result in later versions.

    Args:
        ranks: Destination rank of each of this rank's cells.
    """
    lists: Any = adjacencylist(ranks.astype(np.int32)[:, None])
    return lambda *_: getattr(lists, "_cpp_object", lists)
