"""Name the fields of results on the page, with their units."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

WORDS: dict[str, tuple[str, Literal["stress", "length", ""]]] = {
    "stress": ("von Mises stress", "stress"),
    "yield_ratio": ("utilisation (1: yields)", ""),
    "plastic": ("plastic share of each cell", ""),
    "displacement": ("displacement", "length"),
    "contact_pressure": ("contact pressure", "stress"),
    "accumulated_plastic_strain": ("accumulated plastic strain", ""),
    "plastic_strain": ("plastic strain", ""),
    "back_stress": ("back stress (von Mises)", "stress"),
    "slip": ("slip", "length"),
    "friction_stress": ("friction", "stress"),
    "mechanism": ("velocity of the collapse", ""),
    "dissipation": ("plastic work of the collapse", ""),
    "lower_bound_stress": ("von Mises stress of the lower bound", "stress"),
    "gap_share": ("contribution to the gap between the bounds", ""),
}
"""Name and kind of number by field, in the order of the menu."""


@dataclass(frozen=True)
class FieldWords:
    """The name of a field and the unit of its numbers."""

    label: str
    unit: str


def words_of(name: str, units: Mapping[str, str]) -> FieldWords:
    """Return the words for a field; an unknown field keeps its own name.

    Args:
        name: Name in the result files.
        units: Units by quantity (:meth:`units.Units.table`).
    """
    label, kind = WORDS.get(name, (name.replace("_", " "), ""))
    return FieldWords(label, units.get(kind, ""))


def rank_of(name: str) -> int:
    """Return the position of a field in the menu; unknown fields come last."""
    order = list(WORDS)
    return order.index(name) if name in order else len(order)
