"""Read ``[[load]]`` tables, and describe loads in words with units."""

import dataclasses
import math
import typing
from typing import TYPE_CHECKING, Any

from perfplast_fenicsx.docstrings import arguments
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import WordedFormula, check
from perfplast_fenicsx.io.case.schema import Table, convert, shown
from perfplast_fenicsx.problem.declared.loads import (
    LOADS,
    FieldPores,
    Force,
    ForceBelow,
    Load,
    Traction,
    kind_of,
)
from perfplast_fenicsx.units import Units

if TYPE_CHECKING:
    from perfplast_fenicsx.io.case.case import Case


SHARED: dict[str, tuple[Any, Any, str]] = {
    "constant": (
        bool | None,
        None,
        "Whether the load has its full value at any load factor, like a weight. The default is "
        "true for ``pore_pressure``, and false for other loads.",
    ),
    "name": (str, "", "Name of the load for messages and stages."),
}
"""Type, default and meaning of the keys that all kinds of loads share."""

HEAD = """A load on a surface or in a volume: give exactly one of its kinds.

Numbers may be formulas in x, y, z, such as ``"10*maximum(8 - y, 0)"``. The program
evaluates them at the nodes of quadratic cells.

Args:
    on: Physical surface, or volume for a {volumes}.
"""


def load_table() -> type[Any]:
    """Return the dataclass of a load table, made from :data:`.loads.LOADS`."""
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
    """Return the load that a table defines.

    Args:
        table: The parsed TOML table.
        place: Place in the input, for messages.

    Raises:
        InputError: If the table has no kind of load or several, a key of another kind, or a number
            that is not finite.
    """
    row = convert(table, load_table(), place)
    given = {key: value for key, value in vars(row).items() if value is not None}
    loads = {_key(kind, field): kind for kind, cls in LOADS.items() for field in cls.quantities}
    kinds = {loads[key] for key in given if key in loads}
    if len(kinds) != 1:
        what = " and ".join(key for key in given if key in loads) or "no load"
        *others, last = LOADS
        raise InputError(
            f"{place}: '{row.on}' has {what}; give exactly one of {', '.join(others)} and {last} "
            "(write one [[load]] table for each load)."
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
    """Return the key for a load's field: the kind for ``value``, otherwise the field's name."""
    return kind if field == "value" else field


def _with(key: str) -> str:
    """Return the kinds of loads that have a field, in words."""
    kinds = [kind for kind, cls in LOADS.items() if key in typing.get_type_hints(cls)]
    return " or ".join(kinds)


def _check_numbers(value: Any, key: str, place: str) -> None:
    """Raise an error for a number that is not finite or for an invalid formula."""
    numbers = value if isinstance(value, list) else [value]
    if not all(isinstance(one, str) or math.isfinite(one) for one in numbers):
        raise InputError(f"{place}: {key} = {shown(value)} is not finite; give finite numbers.")
    for formula in numbers:
        if isinstance(formula, str):
            check(formula, f"{place}: {key}")


def load_in_words(load: Load, units: Units, whole: bool = True) -> str:
    """Return a load in words, such as ``pressure 1 MPa on 'top'``.

    Args:
        load: The load.
        units: Units of the numbers.
        whole: See :meth:`units.Units.table`.
    """
    table = units.table(whole)
    words = []
    for field, quantity in load.quantities.items():
        value = getattr(load, field)
        if not hasattr(value, "__len__") or len(value):
            what = kind_of(load) if field == "value" else field
            if isinstance(load, ForceBelow):
                what = "body force"
            if isinstance(load, Traction) and load.total:
                what, quantity = "evenly spread force", "force"
            if isinstance(load, FieldPores):
                words.append(f"pore pressure of {load.value}")
                continue
            unit = "" if isinstance(value, WordedFormula) else table[quantity]
            words.append(f"{what.replace('_', ' ')} {_value(value)} {unit}".rstrip())
    below = f" where {_value(load.depth)}" if isinstance(load, ForceBelow) else ""
    point = load.point if isinstance(load, Force) else ()
    at = f" at the point {_value(point)} {table['length']}".rstrip() if len(point) else ""
    return f"{' and '.join(words)} on '{load.on}'{at}{below}"


def meaning(case: "Case", whole: bool = True) -> list[str]:
    """Return sentences that explain the load factor and the units of a case.

    Args:
        case: The case.
        whole: See :meth:`units.Units.table`.
    """
    units = case.units
    live = [load_in_words(load, units, whole) for load in case.loads if not load.constant]
    dead = [load_in_words(load, units, whole) for load in case.loads if load.constant]
    told = []
    own = case.stages or not case.loading.together
    factor = "A factor of 1" if own else "zeta = 1"
    if live:
        told.append(f"{factor} is {', '.join(live)}.")
    elif case.scene.driven:
        told.append(
            "At zeta = 1, motions of supports and obstacles, and overlaps, have the values in the "
            "case."
        )
    elsewhere = dict.fromkeys(name for stage in case.stages for name in stage.factors)
    others = [
        repr(name)
        for name in elsewhere
        if name not in {load.name or load.on for load in case.loads}
    ]
    if others:
        told.append(f"A factor of 1 for {', '.join(others)} is the value in the case.")
    if dead:
        told.append(f"Constant loads: {', '.join(dead)}.")
    if case.scene.axisymmetric:
        told.append(
            "Forces and works in results refer to the full turn; pressures and tractions are "
            "per area, and body forces per volume."
        )
    if units.in_words():
        told.append(f"Units: {units.in_words(whole)}.")
    return told


def _value(value: Any) -> str:
    """Return a number or a formula as text, or a list of them in brackets."""
    if isinstance(value, WordedFormula):
        return value.words
    if isinstance(value, str):
        return repr(value)
    if hasattr(value, "__len__"):
        return f"({', '.join(_value(one) for one in value)})"
    return f"{value:.6g}"
