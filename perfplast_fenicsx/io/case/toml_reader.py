"""TOML files as tables, with bounds: a file may be anything that somebody has put there.

Python's parser has no bounds of its own. It fails on deep nesting, and the time for a
dotted key is quadratic in its parts.
"""

import errno
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table

LARGEST_FILE = 1_000_000
"""Bytes of a file."""

DEEPEST = 20
"""Tables and lists within each other, and parts of a dotted key."""

_PART = r"""(?:"[^"\n]*+"|'[^'\n]*+'|[A-Za-z0-9_-]++)"""
_KEY = re.compile(rf"{_PART}(?:[ \t]*+\.[ \t]*+{_PART})*+")
_PARTS = re.compile(_PART)
_INT64 = range(-(2**63), 2**63)


def read_text(path: Path) -> str:
    """The text of a file that is to be TOML. Not collective.

    Raises:
        InputError: If it is no regular file, cannot be read, is very large or no text.
    """
    try:
        content = _content(path)
    except (OSError, ValueError) as error:  # the latter for a name that no file can have
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
        return content.decode()
    except UnicodeDecodeError as error:
        raise InputError(
            f"'{path}' is not a text file in UTF-8; give a case file (TOML)."
        ) from error


def _content(path: Path) -> bytes:
    """The first bytes, one more than are allowed."""
    mode = path.stat().st_mode  # opening a FIFO would wait for its other end
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "no regular file")
    with path.open("rb") as file:
        return file.read(LARGEST_FILE + 1)


def parse(text: str, name: str) -> Table:
    """TOML as a table.

    Args:
        text: The file's.
        name: Of the file, for the message.

    Raises:
        InputError: If the text is not TOML, or TOML that no case needs: nested more than
            :data:`DEEPEST` deep, or with whole numbers of more than 64 bits.
    """
    too_deep = InputError(
        f"{name} nests tables, lists or keys more than {DEEPEST} deep; a case file needs no more"
        " than four."
    )
    for dotted in _KEY.findall(text):
        if dotted.count(".") > DEEPEST and len(_PARTS.findall(dotted)) > DEEPEST:
            raise too_deep
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        reason = str(error)[:1].lower() + str(error)[1:]
        raise InputError(f"{name} is not valid TOML: {reason}; correct this place.") from error
    except RecursionError as error:
        raise too_deep from error
    except ValueError as error:  # Python reads no number of more than 4300 digits, no 30 February
        reason = str(error).partition(";")[0]
        raise InputError(f"{name} has a value that is none: {reason}; correct it.") from error
    entries: list[tuple[str, Any, int]] = [(key, value, 1) for key, value in table.items()]
    while entries:
        key, value, depth = entries.pop()
        if depth > DEEPEST:
            raise too_deep
        if isinstance(value, dict):
            entries += [(below, item, depth + 1) for below, item in value.items()]
        elif isinstance(value, list):
            entries += [(key, item, depth + 1) for item in value]
        elif isinstance(value, int) and value not in _INT64:
            raise InputError(
                f"{name}: {key} = {hex(value)[:20]}... has {value.bit_length()} bits, but whole"
                " numbers have 64; write a smaller one, or 1e30 for a large number."
            )
    return table
