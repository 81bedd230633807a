"""Compute energy norms ‖σ‖² = ∫ σ:C⁻¹σ of stresses and ‖e‖² = ∫ e:Ce of strains, and thresholds."""

import ufl
from dolfinx import fem

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.integrals import Integral
from perfplast_fenicsx.problem.assembled.law_on_cells import LawOnCells, OfLaw, integrate
from perfplast_fenicsx.problem.problem import Problem

RIGID = 1e-5
"""Share of :func:`jagged_norm2`; bodies with a smaller norm of strains move as if rigid. Their
strain and stress consist mainly of rounding errors and serve as no reference."""


def stress_norm2(problem: Problem, stress: OfLaw) -> Integral:
    """Return ‖σ‖² of a stress that each law gives, as an integral compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        s = stress(on)
        return ufl.dot(on.law.elastic.compliance(s), s)

    return Integral(problem.comm, integrate(problem.laws, square))


def strain_norm2(problem: Problem, strain: Expr) -> Integral:
    """Return ‖e‖² of a strain, as an integral compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        return ufl.dot(on.law.elastic.hooke(strain), strain)

    return Integral(problem.comm, integrate(problem.laws, square))


def stiffness_of_nodes(problem: Problem) -> float:
    """Return the mean stiffness (force/length) of a node while all other nodes are fixed.

    Collective.

    √(stiffness · energy) is the norm of the forces that the stress of an energy exerts on nodes
    from all sides, before they balance.
    """
    return stiffness_of_all(problem) / problem.V.dofmap.index_map.size_global


def stiffness_of_all(problem: Problem) -> float:
    """Return ∫ 2μ/h²; this times the largest |u|² bounds :func:`jagged_norm2`. Collective."""
    h2 = abs(ufl.JacobianDeterminant(problem.tagged_mesh.mesh)) ** (
        2 / problem.tagged_mesh.mesh.geometry.dim
    )
    stiffness = integrate(problem.laws, lambda on: 2 * on.law.elastic.shear / h2)
    return Integral(problem.comm, stiffness)()


def jagged_norm2(problem: Problem, u: fem.Function) -> Integral:
    """Return the integral ∫ 2μ|u|²/h²: ‖u‖² if neighbouring nodes moved against each other.

    Collective.

    Rounding errors of ε(u) are relative to this norm, however smooth u is. The integral is compiled
    once.
    """
    mesh = problem.tagged_mesh.mesh
    h2 = abs(ufl.JacobianDeterminant(mesh)) ** (2 / mesh.geometry.dim)

    def square(on: LawOnCells) -> Expr:
        return 2 * on.law.elastic.shear * ufl.inner(u, u) / h2

    return Integral(problem.comm, integrate(problem.laws, square))
