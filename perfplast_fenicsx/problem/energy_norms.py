"""The energy norms ‖σ‖² = ∫ σ:C⁻¹σ of stresses and ‖e‖² = ∫ e:Ce of strains."""

import ufl

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.integrals import Integral
from perfplast_fenicsx.problem.law_on_cells import LawOnCells, OfLaw, integrate
from perfplast_fenicsx.problem.problem import Problem


def stress_norm2(problem: Problem, stress: OfLaw) -> Integral:
    """‖σ‖² of a stress that each law tells of; compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        s = stress(on)
        return ufl.dot(on.law.elastic.compliance(s), s)

    return Integral(problem.comm, integrate(problem.laws, square))


def strain_norm2(problem: Problem, strain: Expr) -> Integral:
    """‖e‖² of a strain; compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        return ufl.dot(on.law.elastic.hooke(strain), strain)

    return Integral(problem.comm, integrate(problem.laws, square))
