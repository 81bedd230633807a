"""Compose sentences on the bounds of a body."""

from collections.abc import Iterable, Sequence

from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_in_words
from perfplast_fenicsx.limit_analysis.facets.enclosed_pores import pores_in_words
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question, Standing
from perfplast_fenicsx.materials.nonassociated_flow import flow_words
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down, rounded_up


def sentence(words: str) -> str:
    """Return a clause with a capital and without its full stop."""
    return words[0].upper() + words[1:]


def sentences(clauses: Iterable[str]) -> str:
    """Return clauses as sentences that follow another one; an empty string without clauses."""
    return "".join(f" {sentence(words)}." for words in clauses)


def proven_words(lower: Bound, upper: Bound, question: Question, why_not: Sequence[str]) -> str:
    """Return a sentence on what both bounds prove.

    Args:
        lower: The lower bound.
        upper: The upper bound.
        question: The loads whose factor is bounded.
        why_not: Why a bound is not strict.
    """
    reasons = f" ({'; '.join(why_not)})" if why_not else ""
    body = "The body that the mesh fills"
    if question is Question.STANDS:
        known = [bound.value if bound.strict else None for bound in (lower, upper)]
        stands = Standing(*known)
        return f"{body} {stands.verdict}: {stands.in_words()}; this is strict{reasons}."
    if UNLIMITED in lower.why_not and UNLIMITED in upper.why_not:
        return f"{sentence(UNLIMITED)}."
    if upper.strict and upper.value is not None and upper.value < 0:
        body = f"Without load the constant loads are not carried. {body}"
    if lower.strict and upper.strict:
        return f"{body} collapses between {lower.shown} and {upper.shown}; both bounds are strict."
    if upper.strict:
        return f"{body} collapses at {upper.shown} at most, strictly{reasons}."
    if lower.strict:
        return f"{body} carries {lower.shown} at least, strictly{reasons}."
    return f"Nothing is proven for the body that the mesh fills{reasons}."


def least_words(carried: float | None, none_below: float | None, lower: float | None) -> str:
    """Return a sentence on the proven bounds of the least load factor.

    Args:
        carried: A load factor near the least one that is provably carried.
        none_below: Proven lower bound of the least load factor.
        lower: A lower bound of the largest load factor, which is carried too.
    """
    told = []
    if carried is not None and lower is not None:
        first, last = min(carried, lower), max(carried, lower)
        ends = f"from {rounded_up(first)} to {rounded_down(last)}"
        told.append(f"load factors {ends} are carried for certain")
    elif carried is not None:
        told.append(f"the load factor {rounded_up(carried)} is carried for certain")
    if none_below is not None:
        told.append(f"none below {rounded_down(none_below)} is carried")
    if not told:
        return "Nothing is proven for the least load factor that is carried."
    words = f"{' and '.join(told)}; this is strict."
    words = sentence(words)
    if none_below is not None and none_below > 0:
        return f"{words} Without load the constant loads are not carried."
    if carried is None or (carried > 0 and (lower is None or lower > 0)):
        return f"{words} Whether the constant loads are carried without load is not decided."
    return words


def taken_as(problem: Problem) -> tuple[str, ...]:
    """Return clauses on the idealisation of bodies and loads. Collective.

    They concern associated ground, surfaces that share one polygon, and pore pressures and
    strengths that are not linear in each cell.
    """
    told = (
        flow_words(problem.given.materials),
        problem.tagged_mesh.taken,
        pores_in_words(problem),
        profiles_in_words(problem),
    )
    return tuple(clause for clauses in told for clause in clauses)
