"""Compare the design load with the proven bounds of the bodies."""

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.standing_words import standing_in_words
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import DesignFactor


def designed(
    zeta: float | None, name: str, limit: LimitLoad, body: BodyBounds | None
) -> DesignFactor | None:
    """Return how many times the design load is carried; None without a design load or a bound.

    If the least load factor is above the design load, the function reports no multiple: more load
    is needed, not less. If the design load is not proven to be carried, it is not reported as
    carried.

    Args:
        zeta: Load factor of the design load.
        name: Name of the combination of loads, if it has one.
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
