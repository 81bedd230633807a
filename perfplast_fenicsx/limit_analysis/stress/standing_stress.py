"""Compute a lower bound, or show where a mesh is too coarse to carry the permanent loads."""

from collections.abc import Callable
from dataclasses import replace

from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.statements.bound import Scope
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import StaticBound, strict_lower_bound
from perfplast_fenicsx.limit_analysis.stress.static_form import StaticForm
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down


def bound_by_stress(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    question: Question,
    form: StaticForm | None,
) -> StaticBound:
    """Return a lower bound, or the cells with too few stresses if there is none. Collective.

    With permanent loads, a mesh may have no stress in equilibrium within yield at any load factor,
    although the body has one. The multiple of the permanent loads that it carries shows which cells
    must be smaller.

    Args:
        problem: The bodies and their loads, as for :func:`static_bound.strict_lower_bound`.
        rtol: Relative distance of the bound from the best one on this mesh.
        monitor: Called on every rank after each step.
        question: The loads whose factor is sought.
        form: Form of the problem, if it has been made.
    """
    static = strict_lower_bound(problem, rtol, monitor, question, form)
    doubted = static.bound.value is None or static.bound.doubts
    if not doubted or question is Question.STANDS:
        return static
    if not problem.loads.has_dead() or static.verdict is not Verdict.STALLED:
        return static
    stands = strict_lower_bound(problem, rtol, monitor, Question.STANDS, form)
    times = stands.bound.value
    if times is None or stands.bound.doubts or times >= 1:
        return static
    why = (
        f"stresses that are linear in the cells carry the constant loads {rounded_down(times)}"
        " times at most, at any load factor; refine the mesh"
    )
    return replace(
        static,
        bound=replace(static.bound, value=None, of=Scope.MESH, why_not=(why,), doubts=()),
        reason=why,
        dissipation=stands.dissipation,
        steps=static.steps + stands.steps,
        factorisations=static.factorisations + stands.factorisations,
    )
