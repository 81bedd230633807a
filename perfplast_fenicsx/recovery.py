"""Fields people look at: stress tensor, plastic zone, contact pressure of a state."""

from petsc4py import PETSc

import basix.ufl
import numpy as np
from dolfinx import fem

from perfplast_fenicsx.certificate import certify
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.fields import Fields
from perfplast_fenicsx.materials import tensor
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.state import State


class Recovery:
    """Makes the output fields of a problem's states; compiled once.

    Attributes:
        fields: name → function, brought up to date by :meth:`update`: ``displacement`` (P1 vector,
            length), ``stress`` (DG0, 3×3), ``plastic`` (DG0, 0 or 1), ``yield_ratio`` (DG0,
            ‖dev σ‖/γ, 0 in elastic bodies), ``contact_pressure`` (P1 on both surfaces, 0 elsewhere,
            positive where the bodies push each other).
    """

    def __init__(self, problem: Problem) -> None:
        """Compile the expressions. Collective."""
        self._problem, self._state = problem, Fields(problem)
        mesh, law, e = problem.assembly.mesh, problem.moduli, self._state.e
        cell = mesh.basix_cell()
        tensors = fem.functionspace(mesh, basix.ufl.element("DG", cell, 0, shape=(3, 3)))
        nodal = fem.functionspace(mesh, basix.ufl.element("P", cell, 1))
        spaces = {
            "displacement": problem.V,
            "stress": tensors,
            "plastic": problem.Q,
            "yield_ratio": problem.Q,
            "contact_pressure": nodal,
        }
        self.fields = {name: fem.Function(space, name=name) for name, space in spaces.items()}
        sources = {
            "stress": tensor(self._state.stress),
            "plastic": law.plastic(e),
            "yield_ratio": law.secant(e) * law.overstress(e),
        }
        self._expressions = {
            name: fem.Expression(source, interpolation_points(spaces[name].element))
            for name, source in sources.items()
        }

    def update(self, state: State) -> dict[str, fem.Function]:
        """Bring all fields to a state. Collective."""
        for u in (self._state.u, self.fields["displacement"]):
            u.x.array[:] = state.u.x.array
        self._state.update()
        for name, expression in self._expressions.items():
            self.fields[name].interpolate(expression)
        self._contact_pressure(state.zeta)
        return self.fields

    def _contact_pressure(self, zeta: float) -> None:
        """Nodal forces over nodal areas, at both nodes of each pair."""
        problem, pairs = self._problem, self._problem.pairs
        pressure = self.fields["contact_pressure"].x
        values = certify(problem, self._state, zeta).forces / pairs.area
        vector = self.fields["contact_pressure"].x.petsc_vec
        pressure.array[:] = 0
        first = problem.V.dofmap.index_map.local_range[0]
        nodes = np.concatenate([pairs.host + first, pairs.guest]).astype(PETSc.IntType)
        vector.setValues(nodes, np.tile(values, 2), addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        pressure.scatter_forward()
