"""Compute slip and friction on contact surfaces as output fields."""

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_matrix
from perfplast_fenicsx.contact.rows.constraints import entries_of, matrix_of_entries
from perfplast_fenicsx.problem.judged.certificate import friction_forces
from perfplast_fenicsx.problem.judged.state import Level, slipped
from perfplast_fenicsx.problem.problem import Problem


class FrictionFields:
    """Fields that are linear on surfaces with friction and zero elsewhere.

    Attributes:
        fields: ``slip`` (length), u_a − u_b along the surface since the beginning, on both
            surfaces; and ``friction_stress``, the friction on each surface, with opposite signs.
    """

    def __init__(self, problem: Problem, vertices: fem.FunctionSpace) -> None:
        """Create the map from values at places of friction to vertices. Collective.

        Args:
            problem: The bodies.
            vertices: Space of linear functions.
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
            areas: ∫ψ of each owned vertex over the contact surfaces.
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
        """Return values at places distributed to nodes and then to vertices. Collective."""
        on_rows, on_nodes = self._shares.createVecLeft(), self._shares.createVecRight()
        on_rows.array[self._problem.friction.pair] = of_places
        self._shares.multTranspose(on_rows, on_nodes)
        values = self._gathered(on_nodes.array_r)
        for vector in (on_rows, on_nodes):
            vector.destroy()
        return values

    def _gathered(self, of_nodes: Floats) -> Floats:
        """Return Σ_k f_k ψ_j(x_k) for each owned vertex j. Collective."""
        on_vertices, on_nodes = self._to_nodes.createVecs()
        on_nodes.array[:] = of_nodes
        self._to_nodes.multTranspose(on_nodes, on_vertices)
        values: Floats = on_vertices.array.copy()
        for vector in (on_vertices, on_nodes):
            vector.destroy()
        return values
