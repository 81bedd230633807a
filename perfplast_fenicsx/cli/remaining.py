"""The levels that a run still has to solve, and how long they may take."""

from collections.abc import Sequence


def remaining(planned: int | None, seconds: Sequence[float]) -> str:
    """Return the levels that are left and about how long they take, in words.

    Args:
        planned: Levels of the whole run; None where it chooses them as it goes.
        seconds: Time of each level so far (s).

    Returns:
        Such as ``2 levels left, about 1:40``; without a time before the first level has ended, and
        nothing where nothing is known or left.
    """
    left = 0 if planned is None else planned - len(seconds)
    if left < 1:
        return ""
    time = _time_left(left, seconds)
    return f"{left} level{'s' if left > 1 else ''} left" + (f", about {time}" if time else "")


def next_level(planned: int | None, seconds: Sequence[float]) -> str:
    """Return the level that is being solved, such as ``level 3/5, 1:40 left``.

    Args:
        planned: Levels of the whole run; None where it chooses them as it goes.
        seconds: Time of each level so far (s).
    """
    number = len(seconds) + 1
    if planned is None or planned < number:
        return f"level {number}"
    time = _time_left(planned - len(seconds), seconds)
    return f"level {number}/{planned}" + (f", {time} left" if time else "")


def _time_left(levels: int, seconds: Sequence[float]) -> str:
    # Levels by which the next ones are judged: those near collapse take longer than the first.
    most_recent = 3
    recent = seconds[-most_recent:]
    return clock(levels * sum(recent) / len(recent)) if recent else ""


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds, or hours too."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
