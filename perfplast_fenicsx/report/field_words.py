"""Names of the fields of results on the page, and their units."""

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
    "gap_share": ("share in the gap between the bounds", ""),
}
"""Name and kind of number by field, in the order in which they are offered."""


@dataclass(frozen=True)
class FieldWords:
    """Attributes: the name of a field, and the unit after its numbers."""

    label: str
    unit: str


def words_of(name: str, units: Mapping[str, str]) -> FieldWords:
    """Return the name of a field; an unknown field keeps its own name.

    Args:
        name: In the result files.
        units: By quantity (:meth:`units.Units.table`).
    """
    label, kind = WORDS.get(name, (name.replace("_", " "), ""))
    return FieldWords(label, units.get(kind, ""))


def rank_of(name: str) -> int:
    """Return its place among the fields that are offered; those not known come last."""
    order = list(WORDS)
    return order.index(name) if name in order else len(order)
