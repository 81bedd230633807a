"""Read TOML files as tables; refuse other files, binary files and invalid TOML."""

import errno
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table

LARGEST_FILE = 1_000_000
"""Largest size of a file (bytes)."""


def read_text(path: Path) -> str:
    """Return the text of a file that should be TOML. Not collective.

    Raises:
        InputError: If it is not a regular file, cannot be read, is very large or is not text.
    """
    try:
        content = _content(path)
    except (OSError, ValueError) as error:  # ValueError occurs for names that no file can have
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the case file '{path}' cannot be read ({reason.lower()}); check its name."
        ) from error
    if len(content) > LARGEST_FILE:
        raise InputError(
            f"'{path}' has more than {LARGEST_FILE} bytes; give a case file (TOML), and large data"
            " as a mesh file."
        )
    try:
        return content.decode("utf-8-sig")  # Windows editors begin files with a byte order mark
    except UnicodeDecodeError as error:
        raise InputError(
            f"'{path}' is not a text file in UTF-8; give a case file (TOML)."
        ) from error


def _content(path: Path) -> bytes:
    """Return the first bytes, up to one more than allowed."""
    mode = path.stat().st_mode  # opening a FIFO would wait for its other end
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "no regular file")
    with path.open("rb") as file:
        return file.read(LARGEST_FILE + 1)


COMMA = re.compile(r"=\s*([+-]?\d+),(\d+)\s*(#.*)?$")
"""A number with a decimal comma after a key, alone on its line."""

WINDOWS = re.compile(r'=\s*"([^"]*\\[^"]*)"')
"""A text in double quotes with a backslash, as in a Windows path."""


def _remedy(text: str, reason: str) -> str:
    """Return a remedy for TOML that cannot be read, from the line with the fault."""
    at = re.search(r"line (\d+)", reason)
    lines = text.splitlines()
    line = lines[int(at[1]) - 1] if at and int(at[1]) <= len(lines) else ""
    if comma := COMMA.search(line):
        return f"write a decimal point, {comma[1]}.{comma[2]} for {comma[1]},{comma[2]}"
    if path := WINDOWS.search(line):
        return f"write / for \\ in paths, \"{path[1].replace(chr(92), '/')}\", or 'single quotes'"
    return "correct this line"


def parse(text: str, name: str) -> Table:
    """Return TOML text as a table.

    Args:
        text: Text of the file.
        name: Name of the file, which messages use.

    Raises:
        InputError: If the text is not valid TOML, or cannot be used: nested very deep, or with
            integers of more than 64 bits, at which msgspec fails without a message.
    """
    try:
        table = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(
            f"{name} is nested too deeply to be read; a case needs only a few brackets."
        ) from error
    except ValueError as error:  # also a TOMLDecodeError
        reason = str(error).partition("; use sys.")[0]  # the author of a case does not need it
        reason = reason[:1].lower() + reason[1:]
        remedy = _remedy(text, reason)
        raise InputError(f"{name} is not valid TOML: {reason}; {remedy}.") from error
    entries: list[tuple[str, Any]] = list(table.items())
    int64 = range(-(2**63), 2**63)
    while entries:
        key, value = entries.pop()
        if isinstance(value, dict):
            entries += value.items()
        elif isinstance(value, list):
            entries += [(key, item) for item in value]
        elif isinstance(value, int) and value not in int64:
            raise InputError(
                f"{name}: {key} = {hex(value)[:20]}... has {value.bit_length()} bits, but "
                "integers have 64; write a smaller one, or 1e30 for a large number."
            )
    return table
