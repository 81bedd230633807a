"""Report wrong input in one sentence that is the same on every rank.

Every fault of the input raises an :class:`InputError`. If only some ranks can see a fault,
:func:`raise_together` raises the error on all ranks. So no rank raises an error while another rank
waits in a collective call.

Every place that refuses input or warns has a code in ``codes.csv``, which ``docs/refusals.py``
maintains.
"""

import csv
import difflib
import logging
import math
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # so that reading results for pictures does not start MPI
    from mpi4py import MPI

T = TypeVar("T")

HAND_ON = ("__init__", "raise_together", "on_all_ranks", "on_rank0", "alone")
"""Functions of this module that raise errors of their callers."""

LONGEST_MESSAGE = 3000
"""Largest number of characters of a message; a longer message is cut in the middle."""

SMALLEST, LARGEST = 1e-30, 1e30
"""Limits of the magnitude of nonzero numbers, whose squares and products must not overflow."""


UNLISTED = "unlisted"
"""Code of a refusal or warning that is not in ``codes.csv``, for example from an extension."""

NAMED_PLACE = re.compile(r"[^:;\n]*?(?:\.[A-Za-z]\w*'?|\]|--[a-z-]+)(?: \d+)?(?:, [^:;\n]*)?: ")
"""Beginning of a message that names a file, a table or an option."""

NAMED_FIELD = re.compile(r"(\w+) = |.*?(?<!\w)'([^']+)'(?!\w)")
"""Beginning of a message that names a field, or an object in quotes."""


class InputError(ValueError):
    """An error for input that cannot be used: one sentence with place, value and remedy.

    A message may quote any text. The class therefore replaces control characters by escapes, and
    cuts very long messages.
    """

    def __init__(self, message: str) -> None:
        if len(message) > LONGEST_MESSAGE:
            keep = LONGEST_MESSAGE // 2 - 10
            message = f"{message[:keep]} [...] {message[-keep:]}"
        super().__init__(visible(message))
        self._raised_in: tuple[str, str] = _raising_function()
        inner = sys.exception()
        if isinstance(inner, InputError) and str(inner).rstrip(".") in str(self):
            self._raised_in = inner._raised_in

    @property
    def code(self) -> str:
        """Return the code of the refusal, which remains the same when the message is edited."""
        return code_of(*self._raised_in, str(self))

    @property
    def where(self) -> str:
        """Return the file, table and field that the message names; empty if it names no place."""
        message, found = str(self), []
        while named := NAMED_PLACE.match(message):
            found.append(named.group()[:-2])
            message = message[named.end() :]
        if field := NAMED_FIELD.match(message):
            found.append(field[1] or field[2])
        return ", ".join(found)

    @property
    def remedy(self) -> str:
        """Return the part after the last semicolon, which is a remedy; empty if there is none."""
        _, mark, remedy = str(self).rpartition("; ")
        return remedy.rstrip(".") if mark else ""

    def table(self) -> dict[str, str]:
        """Return the message, its code, place and remedy, for JSON."""
        named = {"code": self.code, "where": self.where, "remedy": self.remedy}
        return {"message": str(self), **named}


def code_of(module: str, function: str, message: str) -> str:
    """Return the code of the text in ``codes.csv`` that is most similar to a message.

    Only texts of the same function are compared.

    Args:
        module: Name of the module, without the package.
        function: Name of the function in the module.
        message: The message.
    """
    words = set(re.findall("[A-Za-z]{3,}", message))

    def likeness(text: str) -> tuple[float, int]:
        own = re.findall("[A-Za-z]{3,}", text)
        share = sum(word in words for word in own) / len(own) if own else 0.5
        return share, len(own)

    listed = _codes().get((module, function), [])
    return max(listed, key=lambda row: likeness(row[1]), default=(UNLISTED, ""))[0]


def code_of_record(record: logging.LogRecord) -> str:
    """Return the code of a warning; if the warning repeats an error, the code of the error."""
    for argument in record.args if isinstance(record.args, tuple) else ():
        if isinstance(argument, InputError):
            return argument.code
    module = record.name.removeprefix(f"{__package__}.")
    return code_of(module, record.funcName or "", record.getMessage())


@cache
def _codes() -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return the codes and texts of messages, by module and function."""
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    with (Path(__file__).parent / "codes.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            place = (row["module"], row["function"])
            found.setdefault(place, []).append((row["code"], row["text"]))
    return found


def _raising_function() -> tuple[str, str]:
    """Return the module and function that made an error, skipping functions that pass it on."""
    frame = sys._getframe(2)
    while frame.f_back is not None:
        name, module = frame.f_code.co_name, frame.f_globals["__name__"]
        hands_on = module == __name__ and name in HAND_ON
        if not hands_on and (name == "<module>" or not name.startswith("<")):
            break
        frame = frame.f_back
    return frame.f_globals["__name__"].removeprefix(f"{__package__}."), frame.f_code.co_name


def place_of(x: Iterable[float]) -> str:
    """Return a point in the form of messages, such as ``(1, 0.25)``.

    Args:
        x: Coordinates of the point.
    """
    return f"({', '.join(f'{coordinate + 0.0:.6g}' for coordinate in x)})"


def visible(text: str, lines: bool = False) -> str:
    """Return a text in which escapes replace control characters, which a terminal would execute.

    Args:
        text: Any text.
        lines: Whether the text may have several lines; then line ends remain.
    """
    return "".join(
        shown if shown.isprintable() or (lines and shown == "\n") else ascii(shown)[1:-1]
        for shown in text
    )


def check_magnitude(field: str, value: float) -> None:
    """Refuse a number whose size would make results overflow or vanish.

    The function accepts numbers that are not finite; other checks decide whether they are valid.

    Raises:
        InputError: If the number is refused; the message has the field and the value.
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
        InputError: If the value is refused; the message names the field, the value and the choices.
    """
    if value not in choices:
        raise InputError(f"{field} = {value!r} is unknown; choose one of {', '.join(choices)}.")


def check_finite(what: str, value: float) -> None:
    """Refuse a prescribed load factor or work that is not finite.

    Raises:
        InputError: If the value is refused; the message has its name and the value.
    """
    if not math.isfinite(value):
        raise InputError(f"{what} = {value} is not finite; give a finite number.")


def check_end(tolerance: float, max_iterations: int) -> None:
    """Refuse a tolerance outside (0, 1), and a number of iterations below 1.

    Raises:
        InputError: If a limit is refused; the message has the field and the value.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} is not between 0 and 1; try 1e-8.")
    if max_iterations < 1:
        raise InputError(f"max_iterations = {max_iterations} is less than 1; give at least one.")


def raise_together(comm: "MPI.Intracomm", fault: "str | InputError | None") -> None:
    """Raise an error on every rank if any rank has found a fault. Collective.

    Args:
        comm: Communicator of the ranks that decide together.
        fault: The fault that this rank found, or None. The error reports the lowest rank's fault.

    Raises:
        InputError: If any rank has found a fault; with the same message and code on every rank.
    """
    own = InputError(fault) if isinstance(fault, str) else fault
    told = None if own is None else (str(own), own._raised_in)
    found = [one for one in comm.allgather(told) if one is not None]
    if found:
        error = InputError(found[0][0])
        error._raised_in = found[0][1]
        raise error


def on_all_ranks(comm: "MPI.Intracomm", action: Callable[[], T]) -> T:
    """Run an action on every rank; if it raises InputError on any rank, raise it on all ranks.

    Collective.

    Args:
        comm: The ranks.
        action: A function that does not communicate with other ranks.

    Returns:
        The result of the action.

    Raises:
        InputError: If the action raised it on any rank; if on several, the error of the lowest
            rank.
    """
    fault = None
    try:
        result = action()
    except InputError as error:
        fault = error
    raise_together(comm, fault)
    return result


def on_rank0(comm: "MPI.Intracomm", action: Callable[[], T]) -> T | None:
    """Run an action on rank 0; if it raises InputError, raise it on all ranks. Collective.

    Args:
        comm: The ranks.
        action: A function that does not communicate with other ranks.

    Returns:
        The result of the action on rank 0, and None on the other ranks.

    Raises:
        InputError: If the action raised it.
    """

    def alone() -> T | None:
        return action() if comm.rank == 0 else None

    return on_all_ranks(comm, alone)


def nearest(word: object, known: Iterable[str]) -> str:
    """Return the remedy for an unknown word: the most similar known word, or all known words."""
    words = list(known)
    close = difflib.get_close_matches(str(word)[:100], words, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(words) or 'none'}."
