"""Compute the strain of a direction and integrals along it, for line search and increments."""

import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.compat import evaluate, interpolation_points
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.integrals import Integral
from perfplast_fenicsx.problem.assembled.law_on_cells import LawOnCells, integrate
from perfplast_fenicsx.problem.fields.energy_norms import strain_norm2, stress_norm2
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.profiling import phase


class Direction:
    """A direction δu from the displacement u of some fields.

    Attributes:
        du: The direction.
        de: Its strain ε(δu).
        beta: Step length in ``slope``.
        slope: ⟨Σ(ε(u + β δu)), ε(δu)⟩, the derivative of Ψ along δu.
        change_norm2: ‖Σ(ε(u + δu)) − σ‖² in the energy norm.
        moved_stress_norm2: ‖Σ(ε(u + δu))‖².
        du_norm2: ‖δu‖² in the energy norm.
        moved_norm2: ‖u + δu‖².
    """

    def __init__(self, fields: QuadratureFields) -> None:
        """Create a direction of zero and compile the integrals. Collective."""
        problem, e, s = fields.problem, fields.e, fields.stress
        S = problem.S
        self._cells = problem.cells
        self.du, self.de = fem.Function(problem.V), fem.Function(S)
        self.beta = fem.Constant(problem.tagged_mesh.mesh, default_scalar_type(1))
        self._strain = fem.Expression(
            problem.kinematics.strain(self.du), interpolation_points(S.element)
        )
        de = self.de

        def ended(on: LawOnCells) -> Expr:
            return on.law.stress(e + de, on.old)

        def power(on: LawOnCells) -> Expr:
            return ufl.dot(on.law.stress(e + self.beta * de, on.old), de)

        self.slope = Integral(problem.comm, integrate(problem.laws, power))
        self.change_norm2 = stress_norm2(problem, lambda on: ended(on) - s)
        self.moved_stress_norm2 = stress_norm2(problem, ended)
        self.du_norm2 = strain_norm2(problem, de)
        self.moved_norm2 = strain_norm2(problem, e + de)

    @phase("return map")
    def update(self) -> None:
        """Update ε(δu) from δu. The ghosts of δu must be up to date."""
        evaluate(self._strain, self.de, self._cells)
