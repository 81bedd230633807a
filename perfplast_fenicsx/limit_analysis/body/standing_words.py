"""Report in words whether the constant loads alone are carried."""

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question


def standing_in_words(limit: LimitLoad, body: BodyBounds | None = None) -> str | None:
    """Return a sentence on whether constant loads alone are carried; None if more is known.

    Args:
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    known = body is not None and (body.lower.strict or body.upper.strict)
    if body is not None and known and body.question is Question.STANDS:
        return body.in_words()
    if known or limit.standing is None or limit.question is Question.LIMIT:
        return None
    stands = limit.standing
    return f"This mesh {stands.verdict}: {stands.in_words()}; this is no proof for the body."
