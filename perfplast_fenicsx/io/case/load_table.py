"""Read ``[[load]]``: its keys are the kinds of loads and their further fields."""

import dataclasses
import math
import typing
from typing import Any

from perfplast_fenicsx.docstrings import arguments
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import check
from perfplast_fenicsx.io.case.schema import Table, convert, shown
from perfplast_fenicsx.problem.declared.loads import LOADS, Load

SHARED: dict[str, tuple[Any, Any, str]] = {
    "constant": (
        bool | None,
        None,
        "Whether the load acts in full at any load factor, as a weight does. The default "
        "is true for a ``pore_pressure``, and false for others.",
    ),
    "name": (str, "", "Name of the load in messages and stages."),
}
"""Type, default and meaning of the keys that all loads have, listed after their own keys."""

HEAD = """A load on a surface or in a volume: give exactly one of its kinds.

Numbers may be formulas in x, y, z, such as ``"10*maximum(8 - y, 0)"``, which are taken at the
nodes of quadratic cells.

Args:
    on: Physical surface, or volume for a {volumes}.
"""


def load_table() -> type[Any]:
    """Return the table's dataclass, from :data:`perfplast_fenicsx.problem.declared.loads.LOADS`."""
    volumes = [f"``{kind}``" for kind, cls in LOADS.items() if cls.in_volume]
    text = HEAD.format(volumes=" or ".join(volumes))
    fields: list[Any] = [("on", str)]
    for kind, cls in LOADS.items():
        hints, meaning = typing.get_type_hints(cls), arguments(cls)
        for field in dataclasses.fields(cls):
            key = _key(kind, field.name)
            if key != "on" and key not in SHARED and key not in [name for name, *_ in fields]:
                fields.append((key, hints[field.name] | None, None))
                text += f"    {key}: {meaning[field.name]}\n"
    for key, (hint, default, meaning_of_all) in SHARED.items():
        fields.append((key, hint, default))
        text += f"    {key}: {meaning_of_all}\n"
    return dataclasses.make_dataclass("LoadTable", fields, frozen=True, namespace={"__doc__": text})


def read_load(table: Table, place: str) -> Load:
    """Return the load that a table describes.

    Args:
        table: The table, as TOML has read it.
        place: Place in the input, which messages name.

    Raises:
        InputError: If the table has none or several of the kinds, keys of another kind, or numbers
            that are not finite.
    """
    row = convert(table, load_table(), place)
    given = {key: value for key, value in vars(row).items() if value is not None}
    loads = {_key(kind, field): kind for kind, cls in LOADS.items() for field in cls.quantities}
    kinds = {loads[key] for key in given if key in loads}
    if len(kinds) != 1:
        what = " and ".join(key for key in given if key in loads) or "no load"
        *others, last = LOADS
        raise InputError(
            f"{place}: '{row.on}' has {what}; give exactly one of {', '.join(others)} and {last}"
            " (several loads are several [[load]] tables)."
        )
    (kind,) = kinds
    cls = LOADS[kind]
    fields = {_key(kind, field.name): field.name for field in dataclasses.fields(cls)}
    for key in given:
        if key not in fields:
            raise InputError(
                f"{place}: the {kind} on '{row.on}' has a {key}, which applies only to "
                f"{_with(key)}; remove it."
            )
        if key in loads:
            _check_numbers(given[key], key, place)
    return typing.cast(Load, cls(**{fields[key]: value for key, value in given.items()}))


def _key(kind: str, field: str) -> str:
    """Return the key of a field of a load: the kind for its value, else the field's name."""
    return kind if field == "value" else field


def _with(key: str) -> str:
    """Return the kinds of loads that have a field."""
    kinds = [kind for kind, cls in LOADS.items() if key in typing.get_type_hints(cls)]
    return " or ".join(kinds)


def _check_numbers(value: Any, key: str, place: str) -> None:
    """Refuse numbers that are not finite, and invalid formulas."""
    numbers = value if isinstance(value, list) else [value]
    if not all(isinstance(one, str) or math.isfinite(one) for one in numbers):
        raise InputError(f"{place}: {key} = {shown(value)} is not finite; give finite numbers.")
    for formula in numbers:
        if isinstance(formula, str):
            check(formula, f"{place}: {key}")
