"""Read the keywords of an ``.inp`` file (Abaqus, CalculiX), with options and data lines."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.proof.stored_file import check_regular

MOST_BYTES = 4_000_000_000
"""Largest total size of all files (bytes); it prevents reading a huge file into memory."""

MOST_TIMES, MOST_INCLUDED = 100, 5000
"""Largest number of inclusions of one file, and of all files together."""


@dataclass(frozen=True)
class Keyword:
    """A line that begins with a star, with the data lines that follow it.

    Attributes:
        name: Name without the star, in upper case, with single spaces.
        options: Values of options by name in upper case; "" for options without a value.
        lines: Data lines, without comments and blank lines.
        number: Number of the line with the keyword.
    """

    name: str
    options: dict[str, str]
    lines: list[str] = field(repr=False)
    number: int

    def option(self, name: str, default: str = "") -> str:
        """Return the value of an option, or ``default`` if it is not given, in upper case."""
        return self.options.get(name, default).upper()

    def rows(self) -> list[list[str]]:
        """Return the cells of each data line, without outer blanks and empty cells at the end."""
        found = []
        for line in self.lines:
            cells = [cell.strip() for cell in line.split(",")]
            while cells and not cells[-1]:
                cells.pop()
            found.append(cells)
        return found


def number_of(cell: str, keyword: Keyword) -> float:
    """Return the number in a cell; 0 for an empty cell.

    Raises:
        InputError: If the cell has no number, or a number that is not finite.
    """
    try:
        value = float(cell.upper().replace("D", "E") or 0)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has '{cell[:30]}' where a number is expected, "
            "so the file is damaged; export it again."
        )
    return value


def read_keywords(path: Path) -> list[Keyword]:
    """Return the keywords of a file and of the files that it includes, in order.

    Raises:
        InputError: If a file cannot be read, is not an ``.inp`` file, or includes a file outside
            its folder.
    """
    found = list(_keywords(path, _Included(path.resolve().parent, [path.resolve()])))
    if not found:
        raise InputError(
            f"'{path}' has no keywords (lines with *), so it is not an .inp file; "
            "give another file."
        )
    return found


@dataclass
class _Included:
    """A record of the files that have been read.

    Attributes:
        folder: Folder that must contain all files.
        open: Files that are being read; each one is included by the file before it.
        times: Number of inclusions of each file.
        size: Number of bytes read so far.
    """

    folder: Path
    open: list[Path]
    times: Counter[Path] = field(default_factory=Counter)
    size: int = 0

    def add(self, path: Path) -> None:
        """Count a file before it is read.

        Raises:
            InputError: If the file is not a regular file, or if all files together are too large.
            OSError: If the file cannot be accessed.
        """
        check_regular(path)
        self.size += path.stat().st_size
        if self.size > MOST_BYTES:
            raise InputError(
                f"with '{path}', the files of the model exceed the limit of {MOST_BYTES:.0e} bytes "
                "in total; give a smaller model."
            )


def _keywords(path: Path, so_far: _Included) -> Iterator[Keyword]:
    now: Keyword | None = None
    for number, line in _lines(path, so_far):
        if not line.startswith("*"):
            if now is None:
                raise InputError(
                    f"'{path}', line {number} ('{line[:30]}'): there are data before the first "
                    "keyword, so this is not an .inp file; give another file."
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
    """Yield the keywords of an included file."""
    name = keyword.options.get("INPUT", "").strip("\"'")
    other = (path.parent / name).resolve()
    if not name or not other.is_relative_to(so_far.folder):
        raise InputError(
            f"'{path}', line {keyword.number}: *INCLUDE of '{name}' names a file outside the "
            "folder of the model; move this file into the folder."
        )
    if other in so_far.open:
        raise InputError(
            f"'{path}', line {keyword.number}: the files include each other in a "
            "cycle; remove this *INCLUDE."
        )
    so_far.times[other] += 1
    if so_far.times[other] > MOST_TIMES or so_far.times.total() > MOST_INCLUDED:
        raise InputError(
            f"'{path}', line {keyword.number}: *INCLUDE of '{name}' exceeds the limit of "
            f"{MOST_TIMES} inclusions of one file, or {MOST_INCLUDED} in total; put the included "
            "lines into one file."
        )
    so_far.open.append(other)
    yield from _keywords(other, so_far)
    so_far.open.pop()


def _lines(path: Path, so_far: _Included) -> Iterator[tuple[int, str]]:
    """Yield lines with numbers, without comments and blank lines; continued lines are joined."""
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
                        f"'{path}', line {number}: the file is not text, so it is not an .inp "
                        "file; give another file."
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
