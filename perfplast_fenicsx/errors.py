"""Report bad input in one sentence, the same on every rank.

Every mistake of a user ends in an :class:`InputError`. A fault that only some ranks can see is
first shared by :func:`raise_together`, so that no rank raises while another waits in a collective
call.

Every place that refuses or warns has a code in ``codes.csv``, which ``docs/refusals.py`` keeps.
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

if TYPE_CHECKING:  # reading results for pictures does not start MPI
    from mpi4py import MPI

T = TypeVar("T")

HAND_ON = ("__init__", "raise_together", "on_all_ranks", "on_rank0", "alone")
"""Functions of this module that raise the errors of others."""

LONGEST_MESSAGE = 3000
"""Largest number of characters of a message; a longer one is cut in the middle."""

SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitudes of numbers other than 0 whose squares and products can be computed with."""


UNLISTED = "unlisted"
"""Code of a refusal or warning that comes from no place in ``codes.csv``, as from an extension."""

NAMED_PLACE = re.compile(r"[^:;\n]*?(?:\.[A-Za-z]\w*'?|\]|--[a-z-]+)(?: \d+)?(?:, [^:;\n]*)?: ")
"""The beginning of a message that names a file, a table or an option."""

NAMED_FIELD = re.compile(r"(\w+) = |.*?(?<!\w)'([^']+)'(?!\w)")
"""The beginning of a message that names a field, or a thing in quotes."""


class InputError(ValueError):
    """Input that cannot be used; the message is one sentence with place, value and remedy.

    A message may quote any text. Therefore control characters are written as escapes, and very long
    messages are cut.
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
        """Return the code of the refusal, which stays when its words change."""
        return code_of(*self._raised_in, str(self))

    @property
    def where(self) -> str:
        """Return the file, table and field that the message names, as far as it names them."""
        message, found = str(self), []
        while named := NAMED_PLACE.match(message):
            found.append(named.group()[:-2])
            message = message[named.end() :]
        if field := NAMED_FIELD.match(message):
            found.append(field[1] or field[2])
        return ", ".join(found)

    @property
    def remedy(self) -> str:
        """Return the last part of the message, which names a remedy; empty if it names none."""
        _, mark, remedy = str(self).rpartition("; ")
        return remedy.rstrip(".") if mark else ""

    def table(self) -> dict[str, str]:
        """Return message, code, place and remedy for JSON."""
        named = {"code": self.code, "where": self.where, "remedy": self.remedy}
        return {"message": str(self), **named}


def code_of(module: str, function: str, message: str) -> str:
    """Return the code of a refusal or warning; of several in a function the most similar one's.

    Args:
        module: Name of the module, without the package.
        function: Name of the function in it.
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
    """Return the code of a warning; of one that repeats an error the error's."""
    for argument in record.args if isinstance(record.args, tuple) else ():
        if isinstance(argument, InputError):
            return argument.code
    module = record.name.removeprefix(f"{__package__}.")
    return code_of(module, record.funcName or "", record.getMessage())


@cache
def _codes() -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return codes and texts by module and function."""
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    with (Path(__file__).parent / "codes.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            place = (row["module"], row["function"])
            found.setdefault(place, []).append((row["code"], row["text"]))
    return found


def _raising_function() -> tuple[str, str]:
    """Return module and function that made an error; those that hand it on do not count."""
    frame = sys._getframe(2)
    while frame.f_back is not None:
        name, module = frame.f_code.co_name, frame.f_globals["__name__"]
        hands_on = module == __name__ and name in HAND_ON
        if not hands_on and (name == "<module>" or not name.startswith("<")):
            break
        frame = frame.f_back
    return frame.f_globals["__name__"].removeprefix(f"{__package__}."), frame.f_code.co_name


def place_of(x: Iterable[float]) -> str:
    """Return a point for a message, such as ``(1, 0.25)``.

    Args:
        x: Coordinates of the point.
    """
    return f"({', '.join(f'{coordinate + 0.0:.6g}' for coordinate in x)})"


def visible(text: str, lines: bool = False) -> str:
    """Return a text with escapes instead of control characters, which a terminal would execute.

    Args:
        text: Any text.
        lines: Whether the text may have several lines; line ends then remain.
    """
    return "".join(
        shown if shown.isprintable() or (lines and shown == "\n") else ascii(shown)[1:-1]
        for shown in text
    )


def check_magnitude(field: str, value: float) -> None:
    """Refuse a number that is so large or small that results would overflow or vanish.

    Numbers that are not finite are left to checks that know their meaning.

    Raises:
        InputError: With the field and the value.
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
        InputError: With the field, the value and the choices.
    """
    if value not in choices:
        raise InputError(f"{field} = {value!r} is unknown; choose one of {', '.join(choices)}.")


def check_finite(what: str, value: float) -> None:
    """Refuse a prescribed load or work that is not finite.

    Raises:
        InputError: With the name and the value.
    """
    if not math.isfinite(value):
        raise InputError(f"{what} = {value} is not finite; give a number.")


def check_end(tolerance: float, max_iterations: int) -> None:
    """Refuse limits with which no iteration could end.

    Raises:
        InputError: With the field and the value.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} is not between 0 and 1; try 1e-8.")
    if max_iterations < 1:
        raise InputError(f"max_iterations = {max_iterations} is less than 1; give at least one.")


def raise_together(comm: "MPI.Intracomm", fault: "str | InputError | None") -> None:
    """Raise on every rank if any rank has found a fault. Collective.

    Args:
        comm: Communicator whose ranks decide together.
        fault: The fault that this rank found, or None. The lowest rank's fault is reported.

    Raises:
        InputError: With the same message and code on every rank.
    """
    own = InputError(fault) if isinstance(fault, str) else fault
    told = None if own is None else (str(own), own._raised_in)
    found = [one for one in comm.allgather(told) if one is not None]
    if found:
        error = InputError(found[0][0])
        error._raised_in = found[0][1]
        raise error


def on_all_ranks(comm: "MPI.Intracomm", action: Callable[[], T]) -> T:
    """Run an action on every rank, and raise its InputError on all ranks if any has one.

    Collective.

    Args:
        comm: The ranks.
        action: A function that does not communicate with other ranks.

    Returns:
        The result of the action.

    Raises:
        InputError: The error of the action, on every rank; that of the lowest rank if there are
            several.
    """
    fault = None
    try:
        result = action()
    except InputError as error:
        fault = error
    raise_together(comm, fault)
    return result


def on_rank0(comm: "MPI.Intracomm", action: Callable[[], T]) -> T | None:
    """Run an action on rank 0, and raise its InputError on all ranks. Collective.

    Args:
        comm: The ranks.
        action: A function that does not communicate with other ranks.

    Returns:
        The result of the action on rank 0, None on the others.

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
