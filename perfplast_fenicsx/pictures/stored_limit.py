"""A limit load that is on file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FAR = 30.0
"""Where α ends so many times above its first value, its axis is logarithmic."""


@dataclass(frozen=True)
class StoredLimit:
    """A limit load of a result folder (:class:`limit_load.LimitLoad`).

    Attributes:
        lower: The static side of that of the mesh, no bound of the body; −∞ where none is known.
        estimate: That of the mesh.
        upper: The kinematic side of it, no bound of the body.
        body: What ``summary.json`` says of the body, if anything.
        theorem: Whether limit theorems hold for these; if not, a path loses equilibrium between
            them.
        standing: Whether constant loads alone are carried, in a sentence, where that was sought.
        strength: A factor of safety, where that was (:meth:`safety_factor.FactorOfSafety.table`).
        envelope: Which pairs of loads are carried, where that was.
        shakedown: A shakedown load, where that was (:class:`shakedown_result.ShakedownLoad`).
    """

    lower: float
    estimate: float | None
    upper: float | None
    body: Mapping[str, Any]
    theorem: bool = True
    standing: str = ""
    strength: Mapping[str, Any] | None = None
    envelope: Mapping[str, Any] | None = None
    shakedown: Mapping[str, Any] | None = None


def stored_limit(table: Mapping[str, Any]) -> StoredLimit:
    """Return the limit load of ``limit`` in ``summary.json``.

    Raises:
        KeyError: If a key is missing.
        TypeError: If a value has the wrong type.
        ValueError: If a text is not a number.
    """
    return StoredLimit(
        lower=float(table["lower"]) if table["lower"] is not None else -math.inf,
        estimate=table["estimate"],
        upper=table["upper"],
        body=table.get("body") or {},
        theorem=table.get("theorem", True),
        standing=table.get("standing") or "",
        strength=table.get("strength"),
        envelope=table.get("envelope"),
        shakedown=table.get("shakedown"),
    )
