"""Define the tangent as a bilinear form on displacements or on another space of the same cells."""

from typing import Any

import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.problem import Problem


class TangentForm:
    """The form ⟨Σ^{o,ρ}(ε(u)) ε(·), ε(·)⟩ of some fields.

    Attributes:
        form: The compiled form.
    """

    def __init__(self, fields: QuadratureFields, space: fem.FunctionSpace) -> None:
        """Compile the form. Collective.

        Args:
            fields: Fields at whose strain the tangent is taken.
            space: Space of trial and test functions.
        """
        self._problem: Problem = fields.problem
        self._rho = fem.Constant(self._problem.tagged_mesh.mesh, default_scalar_type(1))
        self._stored: list[tuple[fem.Function, LawExpression]] = []
        strain = self._problem.kinematics.strain
        trial, test = (strain(f(space)) for f in (ufl.TrialFunction, ufl.TestFunction))
        terms = [
            ufl.dot(on.law.tangent(self._store(on, fields.e), trial), test) * on.dx
            for on in self._problem.laws
        ]
        self.form: Any = fem.form(sum(terms[1:], start=terms[0]))

    def update(self, rho: float) -> None:
        """Update the form to the present strains, with this ρ."""
        self._rho.value = rho
        for function, expression in self._stored:
            expression.interpolate(function)

    def _store(self, on: LawOnCells, e: fem.Function) -> dict[str, fem.Function]:
        """Return functions for the fields of a law's tangent, with the law's shapes."""
        problem, stored = self._problem, {}
        for name, value in on.law.tangent_fields(e, on.old, self._rho).items():
            space = problem.space_at_points(value.ufl_shape)
            stored[name] = fem.Function(space, name=name)
            self._stored.append((stored[name], LawExpression([on], space, {on: value}.__getitem__)))
        return stored
