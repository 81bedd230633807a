"""Read the keywords of an ``.inp`` file of Abaqus or CalculiX, with options and data lines."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.proof.stored_file import check_regular

MOST_BYTES = 4_000_000_000
"""Largest total size of all files (bytes), so that no huge file is read into memory."""

MOST_TIMES, MOST_INCLUDED = 100, 5000
"""Number of times that one file may be included, and all files together."""


@dataclass(frozen=True)
class Keyword:
    """A line that begins with a star, and the data lines that follow.

    Attributes:
        name: Name without the star, in capitals, with single spaces.
        options: Values of options by name in capitals; "" for options without a value.
        lines: Lines of data, without comments and blank lines.
        number: Number of the line.
    """

    name: str
    options: dict[str, str]
    lines: list[str] = field(repr=False)
    number: int

    def option(self, name: str, default: str = "") -> str:
        """Return the value of an option in capitals, as all known values are."""
        return self.options.get(name, default).upper()

    def rows(self) -> list[list[str]]:
        """Return the data lines as cells without blanks, and without empty cells at the end."""
        found = []
        for line in self.lines:
            cells = [cell.strip() for cell in line.split(",")]
            while cells and not cells[-1]:
                cells.pop()
            found.append(cells)
        return found


def number_of(cell: str, keyword: Keyword) -> float:
    """Return the number in a cell, 0 for an empty one.

    Raises:
        InputError: If it is not a number, or not finite.
    """
    try:
        value = float(cell.upper().replace("D", "E") or 0)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has '{cell[:30]}' where a number is expected."
        )
    return value


def read_keywords(path: Path) -> list[Keyword]:
    """Return the keywords of a file and of its included files, in their order.

    Raises:
        InputError: If a file cannot be read, is not an ``.inp`` file, or includes one from another
            folder.
    """
    found = list(_keywords(path, _Included(path.resolve().parent, [path.resolve()])))
    if not found:
        raise InputError(f"'{path}' has no keywords (lines with *), so it is not an .inp file.")
    return found


@dataclass
class _Included:
    """A record of the files that were read so far.

    Attributes:
        folder: Folder that must contain all files.
        open: Files that are being read, each included by the previous one.
        times: Number of inclusions of each file.
        size: Number of bytes read so far.
    """

    folder: Path
    open: list[Path]
    times: Counter[Path] = field(default_factory=Counter)
    size: int = 0

    def add(self, path: Path) -> None:
        """Count a file that is about to be read.

        Raises:
            InputError: If it is not a regular file, or if too much is read.
            OSError: If the system refuses.
        """
        check_regular(path)
        self.size += path.stat().st_size
        if self.size > MOST_BYTES:
            raise InputError(f"'{path}' has more than {MOST_BYTES:.0e} bytes, which is too large.")


def _keywords(path: Path, so_far: _Included) -> Iterator[Keyword]:
    now: Keyword | None = None
    for number, line in _lines(path, so_far):
        if not line.startswith("*"):
            if now is None:
                raise InputError(
                    f"'{path}', line {number} ('{line[:30]}'): there are data before the first "
                    "keyword, so this is not an .inp file."
                )
            now.lines.append(line)
            continue
        if now is not None:
            yield now
        now = _keyword(line, number)
        if now.name == "INCLUDE":
            yield from _included(now, path, so_far)
            now = None
    if now is not None:
        yield now


def _included(keyword: Keyword, path: Path, so_far: _Included) -> Iterator[Keyword]:
    """Return the keywords of another file."""
    name = keyword.options.get("INPUT", "").strip("\"'")
    other = (path.parent / name).resolve()
    if not name or not other.is_relative_to(so_far.folder):
        raise InputError(
            f"'{path}', line {keyword.number}: *INCLUDE of '{name}', which lies outside of the"
            " model's folder; put the file beside the model."
        )
    if other in so_far.open:
        raise InputError(f"'{path}', line {keyword.number}: files include each other in a ring.")
    so_far.times[other] += 1
    if so_far.times[other] > MOST_TIMES or so_far.times.total() > MOST_INCLUDED:
        raise InputError(
            f"'{path}', line {keyword.number}: *INCLUDE of '{name}', though a file may be included"
            f" {MOST_TIMES} times, and all together {MOST_INCLUDED} times; put their lines into"
            " one file."
        )
    so_far.open.append(other)
    yield from _keywords(other, so_far)
    so_far.open.pop()


def _lines(path: Path, so_far: _Included) -> Iterator[tuple[int, str]]:
    """Yield lines without comments and blank lines; lines that a comma continues are joined."""
    try:
        so_far.add(path)
        with path.open(encoding="utf-8-sig", errors="surrogateescape") as file:
            begun, first = "", 0
            for number, raw in enumerate(file, start=1):
                line = raw.strip()
                if not line or line.startswith("**"):
                    continue
                if "\0" in line:
                    raise InputError(
                        f"'{path}', line {number}: this is not text, so the file is not an .inp"
                        " file."
                    )
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
