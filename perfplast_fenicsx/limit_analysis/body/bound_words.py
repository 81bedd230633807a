"""What bounds prove of a body, in a sentence."""

from collections.abc import Sequence

from perfplast_fenicsx.limit_analysis.conic.natural_units import UNLIMITED
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.statements.standing import Standing


def proven_words(lower: Bound, upper: Bound, question: Question, why_not: Sequence[str]) -> str:
    """What is proven.

    Args:
        lower: The lower bound.
        upper: The upper one.
        question: Of which loads the factor is bounded.
        why_not: Why one of them is not strict.
    """
    reasons = f" ({'; '.join(why_not)})" if why_not else ""
    body = "The body that the mesh fills"
    if question is Question.STANDS:
        known = [bound.value if bound.strict else None for bound in (lower, upper)]
        stands = Standing(*known)
        return f"{body} {stands.verdict}: {stands.in_words()}; this is strict{reasons}."
    if UNLIMITED in lower.why_not and UNLIMITED in upper.why_not:
        return f"{UNLIMITED[0].upper()}{UNLIMITED[1:]}."
    if upper.strict and upper.value is not None and upper.value < 0:
        body = f"Without load the constant loads are not carried. {body}"
    if lower.strict and upper.strict:
        return f"{body} collapses between {lower.shown} and {upper.shown}; both bounds are strict."
    if upper.strict:
        return f"{body} collapses at {upper.shown} at most, strictly{reasons}."
    if lower.strict:
        return f"{body} carries {lower.shown} at least, strictly{reasons}."
    return f"Nothing is proven of the body that the mesh fills{reasons}."
