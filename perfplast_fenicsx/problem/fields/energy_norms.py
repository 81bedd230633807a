"""The energy norms ‖σ‖² = ∫ σ:C⁻¹σ of stresses and ‖e‖² = ∫ e:Ce of strains, and what is small."""

import ufl
from dolfinx import fem

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.integrals import Integral
from perfplast_fenicsx.problem.assembled.law_on_cells import LawOnCells, OfLaw, integrate
from perfplast_fenicsx.problem.problem import Problem

RIGID = 1e-5
"""Where the norm of strains is below this share of :func:`jagged_norm2` bodies move as if rigid.
Their strain and stress is next to rounding, and nothing is measured by it."""


def stress_norm2(problem: Problem, stress: OfLaw) -> Integral:
    """‖σ‖² of a stress that each law gives; compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        s = stress(on)
        return ufl.dot(on.law.elastic.compliance(s), s)

    return Integral(problem.comm, integrate(problem.laws, square))


def strain_norm2(problem: Problem, strain: Expr) -> Integral:
    """‖e‖² of a strain; compiled once. Collective."""

    def square(on: LawOnCells) -> Expr:
        return ufl.dot(on.law.elastic.hooke(strain), strain)

    return Integral(problem.comm, integrate(problem.laws, square))


def stiffness_of_nodes(problem: Problem) -> float:
    """Return a node's stiffness (force/length) against all others, the mean of them. Collective.

    √(stiffness · energy) is the norm of the forces by which the stress of an energy pulls at nodes
    from all sides, which may balance each other.
    """
    return stiffness_of_all(problem) / problem.V.dofmap.index_map.size_global


def stiffness_of_all(problem: Problem) -> float:
    """∫ 2μ/h², by which :func:`jagged_norm2` is at most this times the largest |u|². Collective."""
    h2 = abs(ufl.JacobianDeterminant(problem.tagged_mesh.mesh)) ** (
        2 / problem.tagged_mesh.mesh.geometry.dim
    )
    stiffness = integrate(problem.laws, lambda on: 2 * on.law.elastic.shear / h2)
    return Integral(problem.comm, stiffness)()


def jagged_norm2(problem: Problem, u: fem.Function) -> Integral:
    """‖u‖² if neighbouring nodes moved against each other, ∫ 2μ|u|²/h²; compiled once. Collective.

    Rounding errors of ε(u) are relative to this norm, however smooth u is.
    """
    mesh = problem.tagged_mesh.mesh
    h2 = abs(ufl.JacobianDeterminant(mesh)) ** (2 / mesh.geometry.dim)

    def square(on: LawOnCells) -> Expr:
        return 2 * on.law.elastic.shear * ufl.inner(u, u) / h2

    return Integral(problem.comm, integrate(problem.laws, square))
