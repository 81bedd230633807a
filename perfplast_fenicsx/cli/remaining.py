"""Estimate the levels that a run still has to solve, and their time."""

from collections.abc import Sequence


def remaining(planned: int | None, seconds: Sequence[float]) -> str:
    """Return the remaining levels and their approximate time, in words.

    Args:
        planned: Number of levels of the whole run; None if it chooses them itself.
        seconds: Time of each level so far (s).

    Returns:
        Such as ``2 levels left, about 1:40``; without a time before the end of the first level, and
        empty if nothing is known or left.
    """
    left = 0 if planned is None else planned - len(seconds)
    if left < 1:
        return ""
    time = _time_left(left, seconds)
    return f"{left} level{'s' if left > 1 else ''} left" + (f", about {time}" if time else "")


def next_level(planned: int | None, seconds: Sequence[float]) -> str:
    """Return the level in progress, such as ``level 3/5, 1:40 left``.

    Args:
        planned: Number of levels of the whole run; None if it chooses them itself.
        seconds: Time of each level so far (s).
    """
    number = len(seconds) + 1
    if planned is None or planned < number:
        return f"level {number}"
    time = _time_left(planned - len(seconds), seconds)
    return f"level {number}/{planned}" + (f", {time} left" if time else "")


def _time_left(levels: int, seconds: Sequence[float]) -> str:
    # Number of last levels from which the next times are estimated: levels near collapse take
    # longer than the first.
    most_recent = 3
    recent = seconds[-most_recent:]
    return clock(levels * sum(recent) / len(recent)) if recent else ""


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds, with hours if needed."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
