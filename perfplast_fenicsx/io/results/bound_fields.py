"""Compute fields of bounds: the stress of the lower bound, and contributions to the gap."""

import basix.ufl
import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, matrices
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, JointProof
from perfplast_fenicsx.limit_analysis.facets.bound_body import bound_body
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.problem.problem import Problem


def bound_fields(body: BodyBounds) -> dict[str, fem.Function]:
    """Return piecewise constant functions by name. Collective.

    Returns:
        ``lower_bound_stress`` is the mean stress of each cell (3×3), if there is a lower bound.
        ``gap_share`` is the contribution of each given cell to the gap, repeated in its parts after
        a split. For rigid blocks, ``contact_pressure`` is the pressure of the forces on joints.
    """
    fields = dict[str, fem.Function]()
    if body.joints is not None:
        fields |= _of_joints(body.problem, body.joints)
    tagged_mesh = body.problem.tagged_mesh
    if body.stress is not None:
        means = body.stress.mean(axis=1)
        if tagged_mesh.axisymmetric:  # coefficients of rσ
            vertices, points = corners(tagged_mesh.mesh)
            means /= points[vertices][..., 0].mean(axis=1)[:, None]
        fields["lower_bound_stress"] = _tensors(body, means)
    if body.shares is not None:
        scalars = fem.functionspace(tagged_mesh.mesh, ("DG", 0))
        shares = fem.Function(scalars, name="gap_share")
        total = body.problem.comm.allreduce(float(body.shares.sum()))
        of_cells = body.shares
        if isinstance(tagged_mesh, AlfeldSplit):
            of_cells = of_cells[tagged_mesh.parents]
        cells = scalars.dofmap.list[: len(of_cells), 0]
        shares.x.array[cells] = of_cells / (total if total > 0 else 1.0)
        shares.x.scatter_forward()
        fields["gap_share"] = shares
    return fields


def _of_joints(problem: Problem, joints: JointProof) -> dict[str, fem.Function]:
    """Return the pressure of forces at vertices, divided by their tributary areas. Collective."""
    mesh, body = problem.tagged_mesh.mesh, bound_body(problem)
    space = fem.functionspace(mesh, ("Lagrange", 1))
    pressure, areas = fem.Function(space, name="contact_pressure"), fem.Function(space)
    chosen = np.flatnonzero(np.isin(body.geometry.exterior, body.facets.in_contact))
    outer = body.geometry.exterior[chosen]
    d = body.vertices.shape[2]
    around = np.array([[j for j in range(d + 1) if j != i] for i in range(d + 1)])
    nodes = space.dofmap.list[body.geometry.cell[outer][:, None], around[body.geometry.side[outer]]]
    shares = np.broadcast_to(body.geometry.areas(outer)[:, None] / d, nodes.shape)
    pushes = -np.einsum("fvi,fi->fv", joints.best.forces[chosen], body.geometry.normals(outer))
    for field, values in ((pressure, pushes), (areas, shares)):
        np.add.at(field.x.array, nodes, values)
        field.x.scatter_reverse(la.InsertMode.add)
        field.x.scatter_forward()
    pressure.x.array[:] /= np.where(areas.x.array > 0, areas.x.array, 1.0)
    return {"contact_pressure": pressure}


def _tensors(body: BodyBounds, mandel: Floats) -> fem.Function:
    """Return Mandel vectors of the cells as 3×3 tensors."""
    mesh = body.problem.tagged_mesh.mesh
    space = fem.functionspace(mesh, basix.ufl.element("DG", mesh.basix_cell(), 0, shape=(3, 3)))
    function = fem.Function(space, name="lower_bound_stress")
    values = function.x.array.reshape(-1, 9)
    values[space.dofmap.list[: len(mandel), 0]] = matrices(mandel).reshape(-1, 9)
    function.x.scatter_forward()
    return function
