"""Compute output fields: stress, plastic zone, contact pressure, slip, and fields of bounds."""

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, matrices
from perfplast_fenicsx.compat import evaluate, interpolation_matrix, interpolation_points
from perfplast_fenicsx.contact.rows.constraints import entries_of, matrix_of_entries
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, JointProof
from perfplast_fenicsx.limit_analysis.facets.bound_body import bound_body
from perfplast_fenicsx.materials.mandel import tensor
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.mesh.straight_geometry import corners, facets_of
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.judged.certificate import friction_forces
from perfplast_fenicsx.problem.judged.state import Level, slipped
from perfplast_fenicsx.problem.problem import Problem


class FrictionFields:
    """Slip and friction stress: linear on surfaces with friction, and zero elsewhere.

    Attributes:
        fields: ``slip`` (length) is the tangential displacement of the primary surface relative to
            the secondary surface or to the obstacle since the start, with the same values on both
            surfaces. ``friction_stress`` has opposite signs on the two surfaces.
    """

    def __init__(self, problem: Problem, vertices: fem.FunctionSpace) -> None:
        """Create the map from values at friction points to vertices. Collective.

        Args:
            problem: The bodies.
            vertices: Space of the linear functions.
        """
        self._problem = problem
        gdim = problem.bodies.gdim
        mesh = vertices.mesh
        space = fem.functionspace(mesh, ("P", 1, (gdim,)))
        names = ("slip", "friction_stress")
        self.fields = {name: fem.Function(space, name=name) for name in names}
        self._nodes = fem.functionspace(mesh, ("P", problem.degree))
        self._to_nodes = interpolation_matrix(vertices, self._nodes)
        shares = problem.constraints.shares
        row, column, value = entries_of(shares)
        rows, columns = shares.getSizes()
        positive = (row, column, np.maximum(value, 0.0))
        self._shares = matrix_of_entries(problem.comm, rows, columns, [positive])

    def update(self, level: Level, areas: Floats) -> None:
        """Update the fields from a level. Collective.

        Args:
            level: The level.
            areas: ∫ψ over the contact surfaces for each owned vertex.
        """
        problem, friction = self._problem, self._problem.friction
        y = problem.create_vector()
        forces = friction_forces(problem, level.stress, level.state.zeta)
        slip = np.einsum("ni,nij->nj", slipped(problem, level.state), friction.direction)
        on_nodes = problem.sliding.B.createVecLeft()
        on_nodes.array[:] = -forces[friction.index >= 0]
        problem.sliding.B.multTranspose(on_nodes, y)
        pulls = y.array_r.reshape(-1, slip.shape[1])
        weight = self._at_vertices(friction.area)
        weight = np.where(weight > 0, weight, 1.0)
        for axis in range(slip.shape[1]):
            mean = self._at_vertices(friction.area * slip[:, axis]) / weight
            self._set("slip", axis, mean)
            self._set("friction_stress", axis, self._gathered(pulls[:, axis]) / areas)
        for function in self.fields.values():
            function.x.scatter_forward()
        for vector in (y, on_nodes):
            vector.destroy()

    def _set(self, name: str, axis: int, values: Floats) -> None:
        array = self.fields[name].x.array.reshape(-1, self._problem.bodies.gdim)
        array[: len(values), axis] = values

    def _at_vertices(self, of_places: Floats) -> Floats:
        """Return sums at owned vertices of values that friction points distribute. Collective."""
        on_rows, on_nodes = self._shares.createVecLeft(), self._shares.createVecRight()
        on_rows.array[self._problem.friction.pair] = of_places
        self._shares.multTranspose(on_rows, on_nodes)
        values = self._gathered(on_nodes.array_r)
        for vector in (on_rows, on_nodes):
            vector.destroy()
        return values

    def _gathered(self, of_nodes: Floats) -> Floats:
        """Return Σ_k f_k ψ_j(x_k) for each owned vertex j. Collective.

        The values f_k belong to the nodes x_k, and ψ_j are the linear shape functions.
        """
        on_vertices, on_nodes = self._to_nodes.createVecs()
        on_nodes.array[:] = of_nodes
        self._to_nodes.multTranspose(on_nodes, on_vertices)
        values: Floats = on_vertices.array.copy()
        for vector in (on_vertices, on_nodes):
            vector.destroy()
        return values


class OutputFields:
    """Computes the output fields of load levels, with expressions that are compiled once.

    Attributes:
        fields: Functions by name, updated by :meth:`update`. ``displacement`` (length); ``stress``
            (3×3, mean in each cell); ``plastic`` (fraction of the points in each cell that are
            plastic); ``yield_ratio`` (gauge of the law's yield set: largest value in each cell, 0
            in elastic bodies); ``contact_pressure`` (linear on the contact surfaces and 0
            elsewhere; positive where bodies push each other; at an edge between two contact faces
            the mean of both). Internal variables of the laws by name, as the mean in each cell:
            numbers, or Mandel vectors as tensors (3×3). With friction, also the fields of
            :class:`output_fields.FrictionFields`.
        at_points: ``stress`` (3×3), ``yield_ratio`` and, for levels, ``plastic`` (1 or 0) at the
            quadrature points after the last update, shape (num_cells, points per cell, ...).
        resultants: Force of each contact on its primary surface, followed by the force of each
            obstacle on its surface, shape (num_contacts, gdim). The array is the same on every
            rank.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the expressions of all fields. Collective."""
        self._problem, self._e = problem, fem.Function(problem.S)
        mesh, e, s = problem.tagged_mesh.mesh, self._e, fem.Function(problem.S)
        cell, size = mesh.basix_cell(), problem.S.dofmap.index_map_bs

        def piecewise_constant(*shape: int) -> fem.FunctionSpace:
            return fem.functionspace(mesh, basix.ufl.element("DG", cell, 0, shape=shape or None))

        scalars, tensors = piecewise_constant(), piecewise_constant(3, 3)
        self._nodes = fem.functionspace(mesh, basix.ufl.element("P", cell, problem.degree))
        vertices = fem.functionspace(mesh, basix.ufl.element("P", cell, 1))
        spaces = {
            "displacement": problem.V,
            "stress": tensors,
            "plastic": scalars,
            "yield_ratio": scalars,
            "contact_pressure": vertices,
        }
        self.fields = {name: fem.Function(space, name=name) for name, space in spaces.items()}
        self.at_points: dict[str, Floats] = {}
        self.resultants: Floats = np.zeros((0, mesh.geometry.dim))

        shapes = {(): scalars, (size,): tensors}
        for name, variable in problem.history.items():
            space = shapes[variable.function_space.value_shape]
            self.fields[name] = fem.Function(space, name=name)
        u, e0 = self.fields["displacement"], problem.initial_strain
        seen = problem.kinematics.strain(u)
        at = interpolation_points(problem.S.element)
        self._strain = fem.Expression(seen if e0 is None else seen - e0, at)
        self._mean = fem.Function(piecewise_constant(size))
        self._tensor = fem.Expression(tensor(self._mean), interpolation_points(tensors.element))
        self._at_points = fem.Function(problem.Q)
        self._stress = s
        laws, Q = problem.laws, problem.Q
        self._plastic = LawExpression(laws, Q, lambda on: on.law.plastic(e, on.old))
        self._ratio = LawExpression(laws, Q, lambda on: on.law.yields.gauge(s))
        self._to_nodes = interpolation_matrix(vertices, self._nodes)
        self._areas = self._contact_areas(vertices)
        self._friction = FrictionFields(problem, vertices) if problem.friction.count else None
        if self._friction is not None:
            self.fields |= self._friction.fields

    def update(self, level: Level) -> dict[str, fem.Function]:
        """Update all fields from a level before the next level begins. Collective."""
        self.fields["displacement"].x.array[:] = level.state.u.x.array
        evaluate(self._strain, self._e, self._problem.cells)
        self._plastic.interpolate(self._at_points)
        plastic = by_cell(self._at_points)
        self.fields["plastic"].x.array[:] = plastic.mean(axis=1)
        self.of_stress(level.stress, level.contact_forces)
        self.at_points["plastic"] = plastic
        if self._friction is not None:
            self._friction.update(level, self._areas)
        for name, variable in level.state.history.items():
            self._remember(name, variable)
        return self.fields

    def _remember(self, name: str, variable: fem.Function) -> None:
        """Update the field of an internal variable with its mean in each cell."""
        dofmap = variable.function_space.dofmap
        width = dofmap.index_map_bs
        means = variable.x.array.reshape(-1, width)[dofmap.list].mean(axis=1)
        if width == 1:
            self.fields[name].x.array[:] = means.ravel()
        else:
            self._mean.x.array[:] = means.ravel()
            self.fields[name].interpolate(self._tensor)

    def of_stress(self, sigma: fem.Function, contact_forces: Floats) -> dict[str, fem.Function]:
        """Update the fields that depend on the stress, and return them. Collective.

        Args:
            sigma: Stress as Mandel vectors at the quadrature points.
            contact_forces: Contact forces of the pairs whose host node this rank owns, shape
                (num_pairs,).
        """
        stress, size = self._stress.x.array, self._mean.function_space.dofmap.index_map_bs
        stress[:] = sigma.x.array
        points = self._problem.S.dofmap.list
        by_point = stress.reshape(-1, size)[points]
        self._mean.x.array[:] = by_point.mean(axis=1).ravel()
        self.fields["stress"].interpolate(self._tensor)
        self._ratio.interpolate(self._at_points)
        ratio = by_cell(self._at_points)
        self.fields["yield_ratio"].x.array[:] = ratio.max(axis=1)
        self.at_points = {"stress": matrices(by_point), "yield_ratio": ratio}
        self._contact(contact_forces)
        names = ("stress", "yield_ratio", "contact_pressure")
        return {name: self.fields[name] for name in names}

    def _contact(self, forces: Floats) -> None:
        """Compute the pressure p and the resultants from the forces λ of the contact pairs.

        The force at node k is f_k = Σ_i s_ik λ_i, where s_ik is the node's share of the force of
        row i. The pressure at vertex j is Σ_k f_k ψ_j(x_k) / ∫ψ_j with the linear shape functions
        ψ_j. So the force at a midside node is divided equally between the ends of its edge. Hence p
        is exact for a constant pressure, and ∫p equals Σλ on either side. For matching nodes p is
        nowhere negative.
        """
        constraints, comm = self._problem.constraints, self._problem.comm
        on_pairs, on_nodes = constraints.shares.createVecLeft(), fem.Function(self._nodes)
        on_pairs.array[:] = forces
        constraints.shares.multTranspose(on_pairs, on_nodes.x.petsc_vec)
        on_pairs.destroy()
        pressure = self.fields["contact_pressure"].x
        self._to_nodes.multTranspose(on_nodes.x.petsc_vec, pressure.petsc_vec)
        pressure.petsc_vec.array[:] /= self._areas
        pressure.scatter_forward()

        resultants = np.zeros((len(constraints.sources), constraints.normal.shape[1]))
        np.add.at(resultants, constraints.surface, -forces[:, None] * constraints.normal)
        self.resultants = comm.allreduce(resultants)

    def _contact_areas(self, vertices: fem.FunctionSpace) -> Floats:
        """Return ∫ψ_j over contact surfaces for each owned vertex j; 1 at vertices off them."""
        tagged_mesh, tags = self._problem.tagged_mesh, self._problem.contact_tags
        if not tags:
            return np.ones(vertices.dofmap.index_map.size_local)
        section = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
        ds = self._problem.kinematics.measure(section)
        vector = fem.assemble_vector(fem.form(ufl.TestFunction(vertices) * ds(tags)))
        vector.scatter_reverse(la.InsertMode.add)
        areas = vector.array[: vertices.dofmap.index_map.size_local].copy()
        return np.where(areas > 0, areas, 1.0)


def dissipation(problem: Problem, v: fem.Function) -> fem.Function:
    """Return the plastic work of a velocity field as its mean in each cell. Collective.

    The plastic work is the support function of the law's yield set, evaluated at the strain rate.
    It is 0 in elastic bodies.

    Args:
        problem: The bodies.
        v: The velocity, with up-to-date ghosts.
    """
    rate, at_points = problem.kinematics.strain(v), fem.Function(problem.Q)
    work = LawExpression(problem.laws, problem.Q, lambda on: on.law.yields.support(rate))
    work.interpolate(at_points)
    cells = fem.functionspace(problem.tagged_mesh.mesh, ("DG", 0))
    mean = fem.Function(cells, name="dissipation")
    mean.x.array[:] = by_cell(at_points).mean(axis=1)
    return mean


def bound_fields(body: BodyBounds) -> dict[str, fem.Function]:
    """Return the fields of bounds by name. Collective.

    Returns:
        Piecewise constant functions. ``lower_bound_stress`` (3×3), if there is a lower bound, is
        the mean stress in each cell. ``gap_share`` is the share of each cell in the gap; if cells
        were split, all parts of a cell have its value. For rigid blocks there is also
        ``contact_pressure``, computed from the forces on joints and linear in each cell.
    """
    fields = dict[str, fem.Function]()
    if body.joints is not None:
        fields |= _of_joints(body.problem, body.joints)
    tagged_mesh = body.problem.tagged_mesh
    if body.stress is not None:
        means = body.stress.mean(axis=1)
        if tagged_mesh.axisymmetric:  # the coefficients are those of r σ, not of σ
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
    """Return the pressure at vertices: force divided by tributary area. Collective."""
    mesh, body = problem.tagged_mesh.mesh, bound_body(problem)
    space = fem.functionspace(mesh, ("Lagrange", 1))
    pressure, areas = fem.Function(space, name="contact_pressure"), fem.Function(space)
    chosen = np.flatnonzero(np.isin(body.geometry.exterior, body.facets.in_contact))
    outer = body.geometry.exterior[chosen]
    d = body.vertices.shape[2]
    corners = facets_of(d)[body.geometry.side[outer]]
    nodes = space.dofmap.list[body.geometry.cell[outer][:, None], corners]
    shares = np.broadcast_to(body.geometry.areas(outer)[:, None] / d, nodes.shape)
    pushes = -np.einsum("fvi,fi->fv", joints.best.forces[chosen], body.geometry.normals(outer))
    for field, values in ((pressure, pushes), (areas, shares)):
        np.add.at(field.x.array, nodes, values)
        field.x.scatter_reverse(la.InsertMode.add)
        field.x.scatter_forward()
    pressure.x.array[:] /= np.where(areas.x.array > 0, areas.x.array, 1.0)
    return {"contact_pressure": pressure}


def _tensors(body: BodyBounds, mandel: Floats) -> fem.Function:
    """Return the piecewise constant 3×3 tensor field with the given Mandel vectors."""
    mesh = body.problem.tagged_mesh.mesh
    space = fem.functionspace(mesh, basix.ufl.element("DG", mesh.basix_cell(), 0, shape=(3, 3)))
    function = fem.Function(space, name="lower_bound_stress")
    values = function.x.array.reshape(-1, 9)
    values[space.dofmap.list[: len(mandel), 0]] = matrices(mandel).reshape(-1, 9)
    function.x.scatter_forward()
    return function
