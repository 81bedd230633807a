"""Test variants of a problem: other data on the same bodies, without another contact search."""

from dataclasses import replace

from mpi4py import MPI

import pytest

from perfplast_fenicsx import InitialStress, Newton, Problem, Support, VonMises
from perfplast_fenicsx.problem import problem as problem_module
from perfplast_fenicsx.problem.problem import variant
from tests.models import punch_problem

STRONG = VonMises(young=1e5, poisson=0.2, yield_stress=700.0)


def loaded(problem: Problem, zeta: float) -> float:
    """Return the largest displacement at a load factor."""
    return float(Newton(problem).solve(zeta).report.max_displacement)


def test_other_materials_are_those_of_a_new_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = punch_problem(4)
    initial = [InitialStress("base", (0.0, 0.0, -5.0, 0.0, 0.0, 0.0))]
    given = replace(problem.given, initial=initial)
    materials = {"base": STRONG, "punch": STRONG}
    new = Problem.from_given(problem.tagged_mesh, replace(given, materials=materials))
    known = loaded(new, 150.0)
    problem = Problem.from_given(problem.tagged_mesh, given)
    before = loaded(problem, 150.0)
    monkeypatch.delattr(problem_module, "find_constraints")
    other = variant(problem, materials=materials)
    assert loaded(other, 150.0) == pytest.approx(known, rel=1e-8)
    assert loaded(problem, 150.0) == pytest.approx(before, rel=1e-8)
    assert abs(known - before) > 0.05 * before
    assert other.given.materials == materials


def test_what_levels_change_is_of_each_variant_alone() -> None:
    problem = punch_problem(2)
    pushed = Support("top", "z", -0.01, constant=False)
    given = replace(problem.given, supports=[*problem.given.supports, pushed], loads=[])
    problem = Problem.from_given(problem.tagged_mesh, given)
    other = variant(problem)
    other.move_to(2.0)
    furthest = [
        problem.comm.allreduce(float(abs(one.prescribed).max(initial=0.0)), MPI.MAX)
        for one in (problem, other)
    ]
    assert furthest == pytest.approx([0.0, 0.02])
    assert (problem.moved_to, other.moved_to) == (0.0, 2.0)
