"""Write a factor of safety in words, for the run that finds it and for later readers."""

from perfplast_fenicsx.rounding import rounded_down, rounded_up


def factor_words(
    lower: float | None, upper: float | None, estimate: bool, many: bool = False
) -> list[str]:
    """Return a clause for each known factor: whether the bodies stand or fall with it.

    Args:
        lower: Factor with which the bodies stand; None if it is not known.
        upper: Factor at which they fall; None if it is not known.
        estimate: Whether both are estimates, computed for other bodies.
        many: Whether the sentence has a plural subject.
    """
    ending, sides = "" if many else "s", []
    if lower is not None:
        certain = "" if estimate else " for certain"
        sides.append(f"stand{ending} with F = {rounded_down(lower)}{certain}")
    if upper is not None:
        latest = "" if estimate else " at the latest"
        sides.append(f"fall{ending} at F = {rounded_up(upper)}{latest}")
    return sides
