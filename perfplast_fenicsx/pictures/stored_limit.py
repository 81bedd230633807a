"""Represent a limit load that is on file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FAR = 30.0
"""Ratio of the last α to the first one above which its axis is logarithmic."""


@dataclass(frozen=True)
class StoredLimit:
    """A limit load of a result folder (:class:`limit_load.LimitLoad`).

    Attributes:
        lower: Static side of the mesh's limit load, no bound of the body; −∞ if it is not known.
        estimate: Estimate of the mesh's limit load.
        upper: Kinematic side of the mesh's limit load, no bound of the body.
        body: Table of the body in ``summary.json``, if any.
        theorem: Whether limit theorems hold; if not, a path loses equilibrium between both sides.
        standing: Whether constant loads alone are carried, in a sentence, if that was sought.
        strength: A factor of safety, if sought (:meth:`safety_factor.FactorOfSafety.table`).
        envelope: Combinations of loads that are carried, if sought.
        shakedown: A shakedown load, if sought (:class:`shakedown_result.ShakedownLoad`).
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
