"""Replace values in the content of a case file, for a sweep."""

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
    """A key of a case file, and the values that it takes one after another.

    Attributes:
        key: Dotted key, such as ``material.block.yield_stress`` or ``load.live.pressure``. Its
            parts are names of tables; names, surfaces or numbers of entries in arrays of tables;
            and, at the end, the name of a key.
        values: The values, with the types of TOML.
    """

    key: str
    values: tuple[Any, ...]


def read_variation(text: str) -> Variation:
    """Return the variation that a text KEY=VALUES defines.

    Args:
        text: The text. VALUES are a list with commas, or FROM:TO:NUMBER for equally spaced values
            that include both ends.

    Raises:
        InputError: If the text does not have this form.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (key and equals and values):
        raise InputError(
            f"--vary {text} does not have the form KEY=VALUES; write, for example, "
            "material.block.yield_stress=200:300:5 or load.live.pressure=1.0,1.5,2.0."
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
            f"--vary {text}: '{values}' does not have the form FROM:TO:NUMBER with NUMBER >= 2; "
            "write, for example, 200:300:5."
        )
    step = (last - first) / (number - 1)
    inner = (first + i * step for i in range(1, number - 1))
    return Variation(key, _all_different([first, *inner, last], text))


def _all_different(values: list[Any], whole: str) -> tuple[Any, ...]:
    """Return the values as a tuple, after checking that no value is repeated."""
    for number, value in enumerate(values):
        if value in values[:number]:
            raise InputError(
                f"--vary {whole}: the value {value} occurs twice; give each value once."
            )
    return tuple(values)


def _value(text: str, whole: str) -> Any:
    """Return the value that a text has in TOML; a word without quotes is a string."""
    if not text.strip():
        raise InputError(f"--vary {whole}: a value between commas is empty; remove a comma.")
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def grid(variations: Sequence[Variation]) -> list[dict[str, Any]]:
    """Return the values of all cases in a sweep by key; the last key varies fastest.

    Raises:
        InputError: If a key is given twice, or if there are more than 10 000 cases.
    """
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(
                f"--vary gives the key '{key}' twice; give all its values in one --vary."
            )
    most_cases = 10_000  # more cases are probably a mistake
    if math.prod(len(variation.values) for variation in variations) > most_cases:
        raise InputError(f"the sweep has more than {most_cases} cases; give fewer values.")
    product = itertools.product(*(variation.values for variation in variations))
    return [dict(zip(keys, values, strict=True)) for values in product]


def varied(table: Table, values: Mapping[str, Any]) -> Table:
    """Return the content of a case file with other values.

    Args:
        table: The table, as TOML has read it.
        values: New values by key; see :class:`Variation`.

    Raises:
        InputError: If a part of a key does not exist in the case.
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
            raise InputError(
                f"--vary {key}: '{tables[-1]}' is a value, not a table; remove the "
                "last part of the key."
            )
    return found


def _inside(place: Any, part: str, key: str) -> Any:
    """Return the entry of a table or array that one part of a key names."""
    if isinstance(place, list):
        return place[_index(place, part, key)]
    if not isinstance(place, dict) or part not in place:
        known = list(place) if isinstance(place, dict) else []
        raise InputError(f"--vary {key}: there is no '{part}' in the case; {nearest(part, known)}")
    return place[part]


def _index(entries: Sequence[Any], part: str, key: str) -> int:
    """Return the index of the entry whose name or number is ``part``."""
    # keys that identify an entry in an array of tables
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
            f"--vary {key}: several entries are called '{part}'; give the number of the entry "
            "instead (the first entry is 0)."
        )
    known = [name for all_ in names for name in all_] or [str(i) for i in range(len(entries))]
    raise InputError(f"--vary {key}: there is no '{part}' in the case; {nearest(part, known)}")
