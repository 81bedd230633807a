"""Convert the input for ``summary.json``: materials, supports, loads, contacts and the rest."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.problem.declared.initial import Bolt, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.loads import LOADS
from perfplast_fenicsx.spatial_fields import SpatialField

KINDS: tuple[Mapping[str, type[Any]], ...] = (
    MATERIALS,
    LOADS,
    OBSTACLES,
    {"temperature": Temperature, "initial_stress": InitialStress, "bolt": Bolt},
)
"""Classes of objects of several kinds, by their names in case files."""


def given_table(given: Given) -> dict[str, Any]:
    """Return the input as JSON data.

    Returns:
        The keys are the fields of :class:`control.Given`. A dataclass becomes a table of its fields
        with its ``kind``: its name in case files, or the name of its class.
    """
    return {field.name: _told(getattr(given, field.name)) for field in dataclasses.fields(given)}


def _told(value: Any) -> Any:
    if isinstance(value, SpatialField):
        return f"{value}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        fields = {name: _told(getattr(value, name)) for name in names}
        known = (name for kinds in KINDS for name, kind in kinds.items() if kind is type(value))
        return {"kind": next(known, type(value).__name__)} | fields
    if isinstance(value, Mapping):
        return {str(key): _told(entry) for key, entry in value.items()}
    if isinstance(value, str | bool | int | float) or value is None:
        return value
    if isinstance(value, Sequence):
        return [_told(entry) for entry in value]
    return _told(value.tolist()) if hasattr(value, "tolist") else repr(value)
