"""Words for a factor of safety, for the run that finds it and for whoever reads it later."""

from perfplast_fenicsx.rounding import rounded_down, rounded_up


def factor_words(
    lower: float | None, upper: float | None, estimate: bool, many: bool = False
) -> list[str]:
    """Return a clause for each known factor: whether the bodies stand or fall with it.

    Args:
        lower: With which they stand; None where it is not known.
        upper: At which they fall; the same.
        estimate: Whether both are of other bodies, and certain of these at neither.
        many: Whether bodies are meant, and not the body.
    """
    ending, sides = "" if many else "s", []
    if lower is not None:
        certain = "" if estimate else " for certain"
        sides.append(f"stand{ending} with F = {rounded_down(lower)}{certain}")
    if upper is not None:
        latest = "" if estimate else " at the latest"
        sides.append(f"fall{ending} at F = {rounded_up(upper)}{latest}")
    return sides
