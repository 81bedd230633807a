"""Compare the design load with the proven bounds of the bodies."""

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.standing_words import standing_in_words
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.design_factor import DesignFactor


def designed(
    zeta: float | None, name: str, limit: LimitLoad, body: BodyBounds | None
) -> DesignFactor | None:
    """Return how many times the design load is carried; None without one, or where no load is.

    Where the least load factor that is carried is above it, no multiple is reported: more of the
    load is wanted then, and not less. Where that is not proven, nor is it that it is carried.

    Args:
        zeta: Load factor of the design load.
        name: Name of the combination of loads that it is, where it has one.
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    if zeta is None or standing_in_words(limit, body):
        return None
    if body is None:
        return DesignFactor.of(zeta, None, None, limit.estimate, name)
    lower, upper = (bound.value if bound.strict else None for bound in body.limits)
    least = body.least
    if least is not None:
        if least.none_below is not None and least.none_below > zeta:
            return None
        if least.carried is None or least.carried > zeta:
            lower = None
    return DesignFactor.of(zeta, lower, upper, limit.estimate, name)
