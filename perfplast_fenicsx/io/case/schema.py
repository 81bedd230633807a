"""Convert TOML tables into dataclasses, and report every fault in one sentence.

A dataclass is the schema of a table: its field names are the keys, its annotations the types, its
defaults the defaults, and its ``__post_init__`` checks the ranges. There is no second definition.
"""

import dataclasses
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal, TypeVar

import msgspec

from perfplast_fenicsx.errors import InputError, check_magnitude, nearest
from perfplast_fenicsx.spatial_fields import SpatialField, Strength

T = TypeVar("T")
Table = dict[str, Any]

_WORDS: dict[Any, str] = {
    float: "a number",
    SpatialField: "a formula, a table of [coordinate, value] pairs or a CSV file",
    int: "a whole number",
    str: "a string",
    bool: "true or false",
}


@contextmanager
def at(place: str) -> Iterator[None]:
    """Prefix the message of an InputError with ``place``."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def convert(table: Table, schema: type[T], place: str) -> T:
    """Return a table as an instance of its dataclass.

    Args:
        table: The table, as TOML has read it.
        schema: A dataclass, frozen or not.
        place: Place of the table, which messages name, e.g. ``"case.toml, [material.upper]"``.

    Raises:
        InputError: For an unknown or missing key, a value of another type, or a value that the
            dataclass itself refuses.
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
            raise InputError(f"{place}: '{key}' is missing; give {described(hints[key], key)}.")
    with at(place):
        return schema(**values)


def choose(
    table: Table, key: str, choices: Mapping[str, T], place: str, default: str | None = None
) -> tuple[str, T, Table]:
    """Return the choice named by ``table[key]``, and the table without that key.

    Raises:
        InputError: If the key is missing without a default, or is not one of the choices.
    """
    if key not in table and default is None:
        listed = _either([shown(choice) for choice in choices])
        raise InputError(f"{place}: '{key}' is missing; give {key} = {listed}.")
    name = table.get(key, default)
    if not isinstance(name, str) or name not in choices:
        raise InputError(f"{place}: {key} = {shown(name)} is unknown; {nearest(name, choices)}")
    return name, choices[name], {other: table[other] for other in table if other != key}


def shown(value: object) -> str:
    """Return a shortened value as TOML writes it."""
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
        raise InputError(
            f"{place}: {key} = {shown(value)} cannot be used; give {described(hint, key)}."
        ) from error
    with at(place):
        for number in converted if isinstance(converted, list) else [converted]:
            if isinstance(number, float):
                check_magnitude(key, number)
    return converted


def described(hint: Any, key: str) -> str:
    """Return a type in words.

    Args:
        hint: The annotation of a field.
        key: Its name.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is Literal:
        return _either([shown(argument) for argument in arguments])
    if origin in (typing.Union, types.UnionType):
        known = [argument for argument in arguments if argument is not types.NoneType]
        return _either([described(argument, key) for argument in known])
    if origin in (list, Sequence):
        if typing.get_origin(arguments[0]) is dict or dataclasses.is_dataclass(arguments[0]):
            return f"tables, each under its own heading [[{key}]]"
        return f"a list whose items are each {described(arguments[0], key)}"
    if origin is dict and arguments[-1] is float:
        return f"a table of numbers, {key} = {{NAME = 1.0}}"
    if typing.get_origin(arguments[-1]) is dict:
        return f"tables with a name, headed [{key}.NAME]"
    return f"a table, headed [{key}]"


def _either(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
