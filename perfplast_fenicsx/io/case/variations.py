"""Replace values of a case file, as a sweep does."""

import copy
import itertools
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.io.case.schema import Table


@dataclass(frozen=True)
class Variation:
    """A key of a case file and its values in turn.

    Attributes:
        key: Dotted key, such as ``material.block.yield_stress`` or ``load.live.pressure``: tables
            by their names, entries of an array of tables by name, surface or number.
        values: Values of the types in TOML.
    """

    key: str
    values: tuple[Any, ...]


def read_variation(text: str) -> Variation:
    """Return the variation from a text KEY=VALUES.

    Args:
        text: The text, in which VALUES are FROM:TO:NUMBER, equally spaced with both ends, or a list
            with commas.

    Raises:
        InputError: If the text does not have this form.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (key and equals and values):
        raise InputError(
            f"--vary {text} is not KEY=VALUES; write material.block.yield_stress=200:300:5, or"
            " load.live.pressure=1.0,1.5,2.0."
        )
    parts = values.split(":")
    if len(parts) == 1:
        return Variation(key, _all_different([_value(v, text) for v in values.split(",")], text))
    try:
        first, last, number = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        first, last, number = math.nan, math.nan, 0
    if len(parts) != 3 or not (math.isfinite(first) and math.isfinite(last) and number >= 2):
        raise InputError(
            f"--vary {text}: '{values}' is not FROM:TO:NUMBER with a NUMBER of 2 or more; write for"
            " instance 200:300:5."
        )
    step = (last - first) / (number - 1)
    inner = (first + i * step for i in range(1, number - 1))
    return Variation(key, _all_different([first, *inner, last], text))


def _all_different(values: list[Any], whole: str) -> tuple[Any, ...]:
    """Return the values, after checking that no value is repeated."""
    for number, value in enumerate(values):
        if value in values[:number]:
            raise InputError(
                f"--vary {whole}: the value {value} occurs twice, and would be solved "
                "twice; give different values."
            )
    return tuple(values)


def _value(text: str, whole: str) -> Any:
    """Return a value as in TOML; a word without quotes is a text."""
    if not text.strip():
        raise InputError(f"--vary {whole}: there is an empty value; remove the comma.")
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def grid(variations: Sequence[Variation]) -> list[dict[str, Any]]:
    """Return all cases of a sweep: a value for each key, the last key varying fastest.

    Raises:
        InputError: If a key is given twice, or if there are very many cases.
    """
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(f"--vary gives '{key}' twice; give all its values at once.")
    most_cases = 10_000  # largest number of cases of a sweep; more are probably a mistake
    if math.prod(len(variation.values) for variation in variations) > most_cases:
        raise InputError(f"the sweep has more than {most_cases} cases; give fewer values.")
    product = itertools.product(*(variation.values for variation in variations))
    return [dict(zip(keys, values, strict=True)) for values in product]


def varied(table: Table, values: Mapping[str, Any]) -> Table:
    """Return a case file's content with other values.

    Args:
        table: The table, as TOML has read it.
        values: Values by their keys, see :class:`Variation`.

    Raises:
        InputError: If a key names no table.
    """
    found = copy.deepcopy(table)
    for key, value in values.items():
        *tables, last = key.split(".")
        place: Any = found
        for part in tables:
            place = _inside(place, part, key)
        if isinstance(place, list):
            place[_index(place, last, key)] = value
        elif isinstance(place, dict):
            place[last] = value
        else:
            raise InputError(f"--vary {key}: '{tables[-1]}' is a value, not a table.")
    return found


def _inside(place: Any, part: str, key: str) -> Any:
    """Return the entry for one part of a key."""
    if isinstance(place, list):
        return place[_index(place, part, key)]
    if not isinstance(place, dict) or part not in place:
        known = list(place) if isinstance(place, dict) else []
        raise InputError(f"--vary {key}: there is no '{part}' in the case; {nearest(part, known)}")
    return place[part]


def _index(entries: Sequence[Any], part: str, key: str) -> int:
    """Return the number of an entry with this name or number."""
    # Keys that identify an entry of an array of tables.
    named_by = ("name", "on", "primary")
    names = [
        [entry[name] for name in named_by if name in entry] if isinstance(entry, dict) else []
        for entry in entries
    ]
    called = [number for number, known in enumerate(names) if part in known]
    if len(called) == 1:
        return called[0]
    if part.isdecimal() and int(part) < len(entries):
        return int(part)
    if called:
        raise InputError(
            f"--vary {key}: several entries are called '{part}'; use the number of the entry in"
            " place of its name (the first one is 0)."
        )
    known = [name for all_ in names for name in all_] or [str(i) for i in range(len(entries))]
    raise InputError(f"--vary {key}: there is no '{part}' in the case; {nearest(part, known)}")
