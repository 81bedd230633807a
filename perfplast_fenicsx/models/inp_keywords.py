"""The keywords of an ``.inp`` file of Abaqus or CalculiX, with their options and data lines."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from perfplast_fenicsx.errors import InputError

MOST_BYTES = 4_000_000_000
"""Largest size of a file, so that what is no text of people's making is not taken into memory."""


@dataclass(frozen=True)
class Keyword:
    """A line with a star, and the data lines behind it.

    Attributes:
        name: Without the star, in capitals, single spaces.
        options: By name in capitals; "" for those without a value.
        lines: Of data, without comments and blank lines.
        number: Of the line.
    """

    name: str
    options: dict[str, str]
    lines: list[str] = field(repr=False)
    number: int

    def option(self, name: str, default: str = "") -> str:
        """The value of an option, in capitals, since the program knows no others."""
        return self.options.get(name, default).upper()

    def rows(self) -> list[list[str]]:
        """The data lines as cells without blanks, but for empty ones at the end."""
        found = []
        for line in self.lines:
            cells = [cell.strip() for cell in line.split(",")]
            while cells and not cells[-1]:
                cells.pop()
            found.append(cells)
        return found


def number_of(cell: str, keyword: Keyword) -> float:
    """The number of a cell, 0 of an empty one.

    Raises:
        InputError: If it is none, or not finite.
    """
    try:
        value = float(cell.upper().replace("D", "E") or 0)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has '{cell[:30]}' where a number is wanted."
        )
    return value


def read_keywords(path: Path) -> list[Keyword]:
    """The keywords of a file and of those that it includes, in their order.

    Raises:
        InputError: If a file cannot be read, is no such file, or includes one from elsewhere.
    """
    found: list[Keyword] = []
    for keyword in _keywords(path, path.resolve().parent, 0):
        found.append(keyword)
    if not found:
        raise InputError(f"'{path}' has no keywords (lines with *); it is no .inp file.")
    return found


def _keywords(path: Path, folder: Path, depth: int) -> Iterator[Keyword]:
    now: Keyword | None = None
    for number, line in _lines(path):
        if not line.startswith("*"):
            if now is None:
                raise InputError(
                    f"'{path}', line {number} ('{line[:30]}'): data stand before the first keyword;"
                    " it is no .inp file."
                )
            now.lines.append(line)
            continue
        if now is not None:
            yield now
        now = _keyword(line, number)
        if now.name == "INCLUDE":
            yield from _included(now, path, folder, depth)
            now = None
    if now is not None:
        yield now


def _included(keyword: Keyword, path: Path, folder: Path, depth: int) -> Iterator[Keyword]:
    """What another file has."""
    name = keyword.options.get("INPUT", "").strip("\"'")
    other = (path.parent / name).resolve()
    if not name or not other.is_relative_to(folder):
        raise InputError(
            f"'{path}', line {keyword.number}: *INCLUDE of '{name}', which lies outside of the"
            " model's folder; put the file beside the model."
        )
    deepest = 5  # files that include each other are followed so far
    if depth >= deepest:
        raise InputError(f"'{path}', line {keyword.number}: files include each other in a ring.")
    yield from _keywords(other, folder, depth + 1)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines without comments and blank ones, those that a comma continues put together."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"'{path}' has more than {MOST_BYTES:.0e} bytes; that is too much.")
        with path.open(encoding="utf-8-sig", errors="surrogateescape") as file:
            begun, first = "", 0
            for number, raw in enumerate(file, start=1):
                line = raw.strip()
                if not line or line.startswith("**"):
                    continue
                if "\0" in line:
                    raise InputError(f"'{path}', line {number}: it is no text, and no .inp file.")
                if begun:
                    line, number = begun + line, first
                if line.startswith("*") and line.endswith(","):
                    begun, first = line, number
                    continue
                begun = ""
                yield number, line
            if begun:
                yield first, begun
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}; check the path.") from error


def _keyword(line: str, number: int) -> Keyword:
    name, *given = line[1:].split(",")
    options = {}
    for one in given:
        key, equals, value = one.partition("=")
        if key.strip():
            options[" ".join(key.upper().split())] = value.strip() if equals else ""
    return Keyword(" ".join(name.upper().split()), options, [], number)
