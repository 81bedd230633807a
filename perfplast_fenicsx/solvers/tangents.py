"""Provide the tangent of an iterate as the operator of its contact programs."""

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


class Tangent(Protocol):
    """The tangent Σ^{o,ρ}(ε(u)) of some fields."""

    def at(self, rho: float) -> Any:
        """Return an operator for this ρ and the present strains, valid until the next call.

        Collective.
        """
        ...


MakeTangent: TypeAlias = Callable[[QuadratureFields], Tangent]
"""Function that creates the tangent of fields; collective."""


class JumpTangent:
    """The tangent of all bodies as one operator in jump unknowns."""

    def __init__(self, fields: QuadratureFields) -> None:
        """Compile the form. Collective."""
        self._stiffness = Stiffness(fields)
        self._operator = ContactOperator(fields.problem, self._stiffness.matrix)

    def at(self, rho: float) -> ContactOperator:
        """Return the operator, see :meth:`Tangent.at`."""
        self._stiffness.assemble(rho)
        self._operator.add_springs(None)
        return self._operator
