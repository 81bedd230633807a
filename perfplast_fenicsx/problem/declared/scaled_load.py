"""A load times a factor, as combinations of loads have it."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from perfplast_fenicsx.problem.declared.loads import Load


def scaled(load: Load, factor: float) -> Load:
    """Return the load with all that it is given by times a factor.

    Args:
        load: A dataclass, as all loads are; numbers are multiplied, and so are formulas.
        factor: Factor of any sign; the pressure of a pin in its bore is another one if it is
            negative.
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
