"""Read TOML files, convert tables into dataclasses, and report every fault in one sentence.

The dataclass of a table is its schema: field names are keys, annotations are types, field defaults
are defaults, and ``__post_init__`` checks the ranges. There is no second definition.
"""

import dataclasses
import errno
import re
import stat
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec

from perfplast_fenicsx.errors import InputError, check_magnitude, nearest
from perfplast_fenicsx.spatial_fields import SpatialField, Strength

T = TypeVar("T")
Table = dict[str, Any]

_WORDS: dict[Any, str] = {
    float: "a number",
    SpatialField: "a formula, a table of [coordinate, value] pairs or a .csv or .vtu file",
    int: "a whole number",
    str: "a string",
    bool: "true or false",
}


@contextmanager
def at(place: str) -> Iterator[None]:
    """Put ``place`` before the message of an InputError that the block raises."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def convert(table: Table, schema: type[T], place: str) -> T:
    """Return an instance of a dataclass from a table.

    Args:
        table: The table, as TOML has read it.
        schema: A dataclass, frozen or not.
        place: Place of the table for messages, e.g. ``"case.toml, [material.upper]"``.

    Raises:
        InputError: For an unknown or missing key, a value of a wrong type, or a value that the
            dataclass refuses.
    """
    fields = {field.name: field for field in dataclasses.fields(schema)}  # type: ignore[arg-type]
    for key in table:
        if key not in fields:
            raise InputError(f"{place}: there is no key '{key}' here; {nearest(key, fields)}")
    hints = typing.get_type_hints(schema)
    values = {}
    for key, field in fields.items():
        if key in table:
            values[key] = _converted(table[key], key, hints[key], place)
        elif field.default is field.default_factory is dataclasses.MISSING:
            told = described(hints[key], key, _is_top(place))
            raise InputError(f"{place}: '{key}' is missing; give {told}.")
    with at(place):
        return schema(**values)


def choose(
    table: Table, key: str, choices: Mapping[str, T], place: str, default: str | None = None
) -> tuple[str, T, Table]:
    """Return the name ``table[key]``, the choice with this name, and the table without ``key``.

    Raises:
        InputError: If the key is missing and has no default, or if its value is not one of the
            choices.
    """
    if key not in table and default is None:
        listed = _either([shown(choice) for choice in choices])
        raise InputError(f"{place}: '{key}' is missing; give {key} = {listed}.")
    name = table.get(key, default)
    if not isinstance(name, str) or name not in choices:
        raise InputError(f"{place}: {key} = {shown(name)} is unknown; {nearest(name, choices)}")
    return name, choices[name], {other: table[other] for other in table if other != key}


def shown(value: object) -> str:
    """Return a value in TOML's notation, cut to 60 characters."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, Mapping):
        text = "{" + ", ".join(f"{key} = {shown(item)}" for key, item in value.items()) + "}"
    elif isinstance(value, list):
        text = "[" + ", ".join(map(shown, value)) + "]"
    else:
        text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _converted(value: object, key: str, hint: Any, place: str) -> Any:
    if SpatialField in typing.get_args(hint) and isinstance(value, SpatialField):
        return value
    try:
        converted = msgspec.convert(value, type=float if hint == Strength else hint)
    except msgspec.ValidationError as error:
        told = described(hint, key, _is_top(place))
        raise InputError(f"{place}: {key} = {shown(value)} cannot be used; give {told}.") from error
    with at(place):
        for number in converted if isinstance(converted, list) else [converted]:
            if isinstance(number, float):
                check_magnitude(key, number)
    return converted


def _is_top(place: str) -> bool:
    """Return whether a place is a whole file, and not a table in it."""
    return "[" not in place


def described(hint: Any, key: str, top: bool = False) -> str:
    """Return a description of a field's type in words.

    Args:
        hint: The annotation of a field.
        key: The name of the field.
        top: Whether the field is at the top level of a file, where the heading of its table is its
            name.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is Literal:
        return _either([shown(argument) for argument in arguments])
    if origin in (typing.Union, types.UnionType):
        known = [argument for argument in arguments if argument is not types.NoneType]
        return _either([described(argument, key, top) for argument in known])
    if origin in (list, Sequence):
        if typing.get_origin(arguments[0]) is dict or dataclasses.is_dataclass(arguments[0]):
            if top:
                return f"tables, each under its own heading [[{key}]]"
            return f"a list of tables, {key} = [{{...}}]"
        return _list_of(described(arguments[0], key))
    if origin is dict and arguments[-1] is float:
        return f"a table of numbers, {key} = {{NAME = 1.0}}"
    if typing.get_origin(arguments[-1]) is dict:
        return f"tables with a name, headed [{key}.NAME]"
    return f"a table, headed [{key}]" if top else f"a table, {key} = {{...}}"


def _list_of(item: str) -> str:
    """Return the description of a list, from the description of one item."""
    if re.fullmatch(r"a (whole )?(number|string)", item):
        return f"a list of {item.removeprefix('a ')}s"
    if item.startswith("a list of "):
        return item.replace("a list", "a list of lists", 1)
    return f"a list whose items are each {item}"


def _either(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


LARGEST_FILE = 1_000_000
"""Largest size of a case file (bytes)."""


def read_text(path: Path) -> str:
    """Return the text of a case file. Not collective.

    Raises:
        InputError: If the file is not regular, cannot be read, is larger than :data:`LARGEST_FILE`,
            or is not text in UTF-8.
    """
    try:
        content = _content(path)
    except (OSError, ValueError) as error:  # names that no file can have raise a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the case file '{path}' cannot be read ({reason.lower()}); check its name."
        ) from error
    if len(content) > LARGEST_FILE:
        raise InputError(
            f"'{path}' has more than {LARGEST_FILE} bytes; give a case file (TOML), and keep large "
            "data in a mesh file."
        )
    try:
        return content.decode("utf-8-sig")  # some Windows editors write a byte order mark first
    except UnicodeDecodeError as error:
        raise InputError(
            f"'{path}' is not a text file in UTF-8; give a case file (TOML)."
        ) from error


def _content(path: Path) -> bytes:
    """Return the first bytes of a file: at most one byte more than allowed."""
    mode = path.stat().st_mode  # opening a FIFO would wait for a writer
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "no regular file")
    with path.open("rb") as file:
        return file.read(LARGEST_FILE + 1)


COMMA = re.compile(r"=\s*([+-]?\d+),(\d+)\s*(#.*)?$")
"""Pattern of a line that ends with a number with a decimal comma."""

WINDOWS = re.compile(r'=\s*"([^"]*\\[^"]*)"')
"""Pattern of a string in double quotes that contains a backslash, as in a Windows path."""


def _remedy(text: str, reason: str) -> str:
    """Return a remedy for a TOML error, which depends on the line with the error."""
    at = re.search(r"line (\d+)", reason)
    lines = text.splitlines()
    line = lines[int(at[1]) - 1] if at and int(at[1]) <= len(lines) else ""
    if comma := COMMA.search(line):
        return f"write a decimal point, {comma[1]}.{comma[2]} for {comma[1]},{comma[2]}"
    if path := WINDOWS.search(line):
        return f"write / for \\ in paths, \"{path[1].replace(chr(92), '/')}\", or 'single quotes'"
    return "correct this line"


def parse(text: str, name: str) -> Table:
    """Return the table that a TOML text contains.

    Args:
        text: Text of the file.
        name: Name of the file for messages.

    Raises:
        InputError: If the text is not valid TOML, is nested too deeply, or has an integer of more
            than 64 bits, at which msgspec fails without a message.
    """
    try:
        table = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(
            f"{name} is nested too deeply to be read; a case needs only a few levels of nesting."
        ) from error
    except ValueError as error:  # TOMLDecodeError is a ValueError
        # this advice is for programmers, not for authors of cases
        reason = str(error).partition("; use sys.")[0]
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
                f"{name}: {key} = {hex(value)[:20]}... has {value.bit_length()} bits, but at most "
                "64 are supported; write a smaller integer, or a number with an exponent such as "
                "1e30."
            )
    return table
