"""The stress of each load and temperature in bodies that never yield, by one factorisation.

Where stresses are known at the vertices of cells (:mod:`linear_stresses`), those of the finite
elements are linear there and in balance with the loads; temperatures are taken as linear in each
cell.
"""

from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.shakedown.linear_stresses import StressPoints
from perfplast_fenicsx.limit_analysis.shakedown.point_laws import PointLaws
from perfplast_fenicsx.limit_analysis.shakedown.point_operator import PointOperator, Strains
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.initial_strain import initial_strain
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


def elastic_stresses(
    problem: Problem,
    names: Sequence[str],
    points: StressPoints,
    operator: PointOperator,
    laws: PointLaws,
) -> tuple[Floats, Floats]:
    """Stresses of what varies, each with the factor 1, and of the constant loads. Collective.

    Temperatures that are not named, and stresses that are there at first, are in balance with
    nothing, and so are left to the residual stress.

    Args:
        problem: The bodies and their loads.
        names: Names of loads and temperatures that vary.
        points: Points of the stresses.
        operator: At those where they do work.
        laws: At the former.

    Returns:
        Shapes (num_names, count, m) and (count, m).

    Raises:
        SingularStiffness: If the bodies cannot be held.
    """
    given = problem.given
    constant = [load for load in given.loads if load.constant]
    with ExitStack() as made:
        bodies = PointOperator(problem)
        made.callback(bodies.destroy)
        bodies.assemble(PointLaws.of(problem).hooke)
        strains = Strains(points.known)
        told = (points.known, bodies, strains, operator, laws)
        found = []
        for name in names:
            loads = [load for load in given.loads if called(load) == name]
            warmed = [a for a in given.initial if isinstance(a, Temperature) and called(a) == name]
            found.append(_stress(loads, warmed, *told))
        return np.array(found), _stress(constant, [], *told)


def _stress(
    loads: Sequence[Load],
    warmed: Sequence[Temperature],
    problem: Problem,
    bodies: PointOperator,
    strains: Strains,
    operator: PointOperator,
    laws: PointLaws,
) -> Floats:
    """C(ε(u) − e₀) in balance with loads, shape (count, m). Collective."""
    load = work_vector(problem.V, problem.tagged_mesh, loads)
    fem_petsc.set_bc(load, problem.bcs)
    right, change = operator.create_vector(), operator.create_vector()
    operator.reduced(load, right)
    strain: Floats = np.zeros((operator.count, operator.size))
    if warmed:
        spaces = Spaces(problem.degree, problem.V, problem.S, problem.Q, problem.dx)
        told = (problem.tagged_mesh, spaces, problem.given.materials, problem.laws)
        thermal = initial_strain(*told, warmed)
        if thermal is not None:
            strain = -thermal.x.array[: strain.size].reshape(strain.shape)
    operator.forces(_product(laws.hooke, strain), change)
    right.axpy(-1.0, change)
    bodies.solve(right, change)
    u = fem.Function(problem.V)
    operator.displace(change, u)
    found = _product(laws.hooke, strain + strains(u))
    for vector in (load, right, change):
        vector.destroy()
    return found


def _product(hooke: Floats, strain: Floats) -> Floats:
    found: Floats = np.einsum("nij,nj->ni", hooke, strain)
    return found


def check_names(problem_loads: Sequence[Load], warmed: Sequence[str], names: Sequence[str]) -> None:
    """Make sure that what varies is there, and that what grows varies.

    Args:
        problem_loads: The loads.
        warmed: Names of temperatures.
        names: Names of what varies.

    Raises:
        InputError: Naming what does not fit.
    """
    growing = [called(load) for load in problem_loads if not load.constant]
    constant = [called(load) for load in problem_loads if load.constant]
    for name in names:
        if name in constant:
            raise InputError(
                f"'{name}' varies, but it is a constant load; take constant = true from it, or"
                " leave it out."
            )
        if name not in growing and name not in warmed:
            raise InputError(
                f"'{name}' varies, but there is no load and no change of temperature of this name;"
                f" {nearest(name, [*growing, *warmed])}"
            )
    for name in growing:
        if name not in names:
            raise InputError(
                f"the load '{name}' has no range; give one, or constant = true to a load that"
                " stays."
            )
