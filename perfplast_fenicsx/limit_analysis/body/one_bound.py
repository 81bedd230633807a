"""Compute one bound of how many times loads are carried, without the other bound."""

from collections.abc import Callable
from dataclasses import replace

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.bound_words import taken_as
from perfplast_fenicsx.limit_analysis.body.flow_problem import split_of
from perfplast_fenicsx.limit_analysis.body.limit_bounds import (
    admitted,
    mechanism_bound,
    with_displacements,
)
from perfplast_fenicsx.limit_analysis.body.parts_of_cells import on_parts
from perfplast_fenicsx.limit_analysis.body.proven_bounds import proven
from perfplast_fenicsx.limit_analysis.body.radenkovic_pair import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.stress.static_bound import strict_lower_bound
from perfplast_fenicsx.problem.problem import Problem

Steps = Callable[[InteriorStep], None]
"""Called on every rank after each step of the interior point method."""


NOT_ASKED = "it was not requested"
"""Why the other bound is missing."""


def upper_bound(problem: Problem, rtol: float = 1e-4, steps: Steps | None = None) -> BodyBounds:
    """Return an upper bound and its mechanism, without a lower one. Collective.

    Args:
        problem: See :func:`limit_bounds.limit_bounds`.
        rtol: Relative distance to the best upper bound on its mesh.
        steps: Called after each step.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`.
    """
    problem = admitted(problem, rtol)
    _, above = weaker_and_stronger(problem)
    bounds = with_displacements(above, mechanism_bound(above, rtol, steps)[0])
    return proven(replace(bounds, lower=_other("lower"), taken=taken_as(problem)))


def lower_bound(
    problem: Problem, beside: BodyBounds, rtol: float = 1e-4, steps: Steps | None = None
) -> BodyBounds:
    """Return a lower bound and its stress, without an upper one. Collective.

    Args:
        problem: See :func:`limit_bounds.limit_bounds`.
        beside: Bounds for the same loads, with nearly the same strengths. Its mechanism measures
            the residuals of the stress, and remains the reported one; its question is used.
        rtol: Relative distance to the best lower bound on its mesh.
        steps: Called after each step.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`.
    """
    problem = admitted(problem, rtol)
    below, _ = weaker_and_stronger(problem)
    static = strict_lower_bound(below, rtol, steps, beside.question)
    on, stress = below, static.stress if static.bound.value is not None else None
    split = split_of(problem)
    if split is not None:
        on = below.on(split)
        stress = stress if stress is None else on_parts(stress, split)
    elif problem.bodies.gdim == 3:  # without a split, parts of cells are not cells of any mesh
        stress = None
    found = replace(
        beside,
        problem=on,
        lower=static.bound,
        upper=_other("upper"),
        static=static,
        stress=stress,
        shares=None,
        certificates={} if static.certificate is None else vars(static.certificate),
        steps=len(static.steps),
        factorisations=static.factorisations,
        weaker=None,
        taken=taken_as(problem),
    )
    return proven(found)


def _other(kind: str) -> Bound:
    """Return a placeholder for the bound that is not computed."""
    return Bound(None, kind, Scope.MESH, (NOT_ASKED,))
