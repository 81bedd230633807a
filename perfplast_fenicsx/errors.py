"""Bad input: one sentence, the same on every rank.

Everything that a user can get wrong ends in an :class:`InputError`. What only some ranks can see is
first put together by :func:`raise_together`, so that no rank raises while another waits in a
collective call.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # what reads results for pictures starts no MPI
    from mpi4py import MPI

T = TypeVar("T")

LONGEST_MESSAGE = 3000
"""Characters of a message; of a longer one the middle is left out."""

SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitudes of numbers other than 0 whose squares and products can be computed with."""


class InputError(ValueError):
    """Input that cannot be used; the message is one sentence with place, value and remedy.

    What is quoted in it may be anything, so that control characters are written as escapes, and
    what is very long is cut.
    """

    def __init__(self, message: str) -> None:
        if len(message) > LONGEST_MESSAGE:
            keep = LONGEST_MESSAGE // 2 - 10
            message = f"{message[:keep]} [...] {message[-keep:]}"
        super().__init__(visible(message))


def place_of(x: Iterable[float]) -> str:
    """Return a point for a message, such as ``(1, 0.25)``.

    Args:
        x: Its coordinates.
    """
    return f"({', '.join(f'{coordinate + 0.0:.6g}' for coordinate in x)})"


def visible(text: str, lines: bool = False) -> str:
    """Return a text with escapes in place of control characters, which a terminal would obey.

    Args:
        text: Any.
        lines: Whether it may have several lines; a line's end is then left as it is.
    """
    return "".join(
        shown if shown.isprintable() or (lines and shown == "\n") else ascii(shown)[1:-1]
        for shown in text
    )


def check_magnitude(field: str, value: float) -> None:
    """Refuse a number that is so large or small that results would overflow or vanish.

    What is not finite is left to those who know what the number stands for.

    Raises:
        InputError: Naming the field and the value.
    """
    size = abs(value)
    if math.isfinite(size) and size and not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"{field} = {value:.6g} is too {'large' if size > 1 else 'small'} to compute with; use"
            f" units in which it lies between {SMALLEST:g} and {LARGEST:g}."
        )


def check_choice(field: str, value: str, choices: Sequence[str]) -> None:
    """Refuse a value that is not one of the choices.

    Raises:
        InputError: Naming the field, the value and the choices.
    """
    if value not in choices:
        raise InputError(f"{field} = {value!r} is unknown; choose one of {', '.join(choices)}.")


def check_finite(what: str, value: float) -> None:
    """Refuse a prescribed load or work that is no number.

    Raises:
        InputError: Naming it and the value.
    """
    if not math.isfinite(value):
        raise InputError(f"{what} = {value} is not finite; give a number.")


def check_end(tolerance: float, max_iterations: int) -> None:
    """Refuse bounds with which no iteration could end.

    Raises:
        InputError: Naming the field and the value.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} is not between 0 and 1; try 1e-8.")
    if max_iterations < 1:
        raise InputError(f"max_iterations = {max_iterations} is less than 1; give at least one.")


def raise_together(comm: "MPI.Intracomm", message: str | None) -> None:
    """Raise on every rank if any rank has found a fault. Collective.

    Args:
        comm: Communicator whose ranks decide together.
        message: The fault that this rank found, or None. The lowest rank's fault is reported.

    Raises:
        InputError: With the same message on every rank.
    """
    found = [text for text in comm.allgather(message) if text is not None]
    if found:
        raise InputError(found[0])


def on_all_ranks(comm: "MPI.Intracomm", action: Callable[[], T]) -> T:
    """Do on every rank what may find bad input on some, which every rank then raises. Collective.

    Args:
        comm: The ranks.
        action: A function that communicates with no other rank.

    Returns:
        What it returned.

    Raises:
        InputError: The error of the action, on every rank; of several the lowest rank's.
    """
    fault = None
    try:
        result = action()
    except InputError as error:
        fault = str(error)
    raise_together(comm, fault)
    return result


def on_rank0(comm: "MPI.Intracomm", action: Callable[[], T]) -> T | None:
    """Do on rank 0 what may find bad input, which every rank then raises. Collective.

    Args:
        comm: The ranks.
        action: A function that communicates with no other rank.

    Returns:
        What it returned on rank 0, None on the others.

    Raises:
        InputError: The error of the action, on every rank.
    """

    def alone() -> T | None:
        return action() if comm.rank == 0 else None

    return on_all_ranks(comm, alone)


def nearest(word: object, known: Iterable[str]) -> str:
    """Return the remedy for an unknown word: the nearest known one, or all of them."""
    words = list(known)
    close = difflib.get_close_matches(str(word)[:100], words, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(words)}."
