"""Check levels: certificates, distances, a curve, and an algorithm that gives up."""

import dataclasses
import math
from collections.abc import Sequence
from functools import cache

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from perfplast_fenicsx import Level, NewtonOptions, Problem, State, load_path
from perfplast_fenicsx.problem.assembled.spaces import Integral
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.solvers.newton import WorkNewton
from perfplast_fenicsx.solvers.newton_options import Monitor
from tests.models import two_blocks_problem

TIGHT = NewtonOptions(tolerance=1e-10)
SERIAL = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="counts solves; slow on many ranks")
PLATE_LIMIT = 2 / math.sqrt(3) * 450 * 5 / 2000
TWO_BLOCKS_LIMIT = {2: 328.78, 4: 325.72, 8: 324.58}
"""Levels at which the curves on these meshes level off, by :func:`limit_search.limit_load`. The
continuum collapses near 75: linear tetrahedra lock."""


def stress_function(problem: Problem, state: State) -> fem.Function:
    """Return Σ(ε(u)) as Mandel vectors."""
    fields = QuadratureFields(problem)
    fields.u.x.array[:] = state.u.x.array
    fields.update()
    return fields.stress


def stress_distance(problem: Problem, one: State, other: State) -> float:
    """Return ‖σ₁ − σ₂‖/‖σ₁‖ in L²."""
    a, b = (stress_function(problem, state) for state in (one, other))
    change, size = (Integral(problem.comm, ufl.dot(s, s) * problem.dx)() for s in (b - a, a))
    return math.sqrt(change / size)


def converged(levels: Sequence[Level]) -> Sequence[Level]:
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-6
        assert level.report.max_penetration < 1e-12
    return levels


def energy(level: Level) -> float:
    """Return E(α) = Ψ(ε(u)), from J_ζ = Ψ − ζα."""
    return level.iterations[-1].energy + level.state.zeta * level.state.alpha


@cache
def curve() -> tuple[Problem, State, list[Level]]:
    """Return a problem, its state at first yield, and levels up to the plateau."""
    problem = two_blocks_problem(2)
    solver = WorkNewton(problem, TIGHT)
    first = solver.first_yield()
    alphas = first.alpha * np.geomspace(0.2, 300.0, 34)
    return problem, first, [*converged(list(load_path(solver, alphas)))]


def points(levels: Sequence[Level]) -> tuple[np.ndarray, np.ndarray]:
    states = [level.state for level in levels]
    return np.array([s.alpha for s in states]), np.array([s.zeta for s in states])


class Timid(WorkNewton):
    """An algorithm that gives up if the work grows by more than a factor."""

    boldest = 2.1

    def solve(
        self, value: float, start: State | None = None, monitor: Monitor | None = None
    ) -> Level:
        level = super().solve(value, start, monitor)
        last = getattr(self, "last", value)
        if value > self.boldest * last:
            report = dataclasses.replace(level.report, converged=False, reason="too far")
            return dataclasses.replace(level, report=report)
        self.last = value
        return level
