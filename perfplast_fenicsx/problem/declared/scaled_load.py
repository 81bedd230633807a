"""Multiply a load by a factor, as combinations of loads do."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from perfplast_fenicsx.problem.declared.loads import Load


def scaled(load: Load, factor: float) -> Load:
    """Return the load with all its values multiplied by a factor.

    Args:
        load: A dataclass, as all loads are; numbers are multiplied, and so are formulas.
        factor: Factor of any sign. A negative factor changes where the pressure of a pin in its
            bore acts.
    """
    given: Any = load
    names = [field.name for field in fields(given) if field.name in load.quantities]
    found: Load = replace(given, **{name: _times(getattr(load, name), factor) for name in names})
    return found


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, str):
        return f"{factor!r}*({value})"
    if isinstance(value, Sequence):
        return [_times(one, factor) for one in value]
    return factor * value
