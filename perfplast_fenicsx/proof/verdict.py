"""Define verdicts on a stress or a velocity, and the residuals that verdicts name."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

ROUNDING = 1e-9
"""Limit of residuals that :data:`LIMITS` does not list."""

ROUNDED = 1e-8
"""Relative amount by which the claimed bound may be better than the proven bound. The checker
prints the proven bound."""

LIMITS: Mapping[str, float] = {
    "asymmetry": 0.0,
    "axis": 0.0,
    "equilibrium": 1e-10,
    "inner_tractions": 1e-10,
    "outer_tractions": 1e-10,
    "tension": 1e-10,
    "unequal_pressures": 1e-10,
    "shear": 1e-10,
    "unequal_shears": 1e-10,
    "rigid_forces": 1e-10,
    "left_of_load": 1e-10,
    "left_of_piece": 1e-10,
    "left_of_strength": 1e-7,
    "work_of_others": 1e-6,
    "yield_ratio": 1 + 1e-9,
    "shear_ratio": 1 + 1e-9,
}
"""Residuals above which a condition is named as the reason why a bound is not proven. Residuals
below these limits still reduce a lower bound or increase an upper bound. Symmetry and zeros on the
axis must be exact, because a program can write symmetric tensors and zeros. ``work_of_others``
limits the range of the free loads' factors for which a bound holds; the checker prints this range.
"""

RATIOS = {"yield_ratio": "stresses", "shear_ratio": "shear tractions of contact"}
"""Conditions that hold after the stress is divided by the measured ratio."""


@dataclass(frozen=True)
class Checked:
    """The verdict on a stress or a velocity.

    Attributes:
        kind: "lower" or "upper".
        claimed: The bound that the file claims.
        proven: The proven bound; None if a condition fails.
        measured: The residual of each condition.
        faults: Violated conditions in words; empty if the claim holds.
        words: Sentences on the data of the proof and on the residuals.
        reached: The bound that the numbers prove, independent of the claim; None if they prove no
            bound.
        over: Factor by which stresses may exceed the strength, for stresses that cannot be scaled.
            A stress below the strength divided by this factor is a proof; ∞ if no factor is known.
    """

    kind: str
    claimed: float
    proven: float | None
    measured: Mapping[str, float]
    faults: tuple[str, ...]
    words: tuple[str, ...] = ()
    reached: float | None = None
    over: float = 1.0

    def __str__(self) -> str:
        if self.faults:
            return f"{self.kind}: {self.claimed:.8g} is not proven: {'; '.join(self.faults)}"
        told = [f"claimed {self.claimed:.8g}"]
        told += [", ".join(f"{name} {value:.1e}" for name, value in self.measured.items())]
        return f"{self.kind}: {self.proven:.8g} is proven ({'; '.join(filter(None, told))})"


def rounding_of(bound: float, power: float) -> float:
    """Return the difference from the proven upper bound that counts as rounding.

    Args:
        bound: Dissipation minus the work of constant loads, relative to the work of the sought
            loads.
        power: Total dissipation over the work of the sought loads; rounding errors of the sums
            scale with this ratio.
    """
    sums = 1e-12  # rounding of sums over all cells
    return ROUNDED * abs(bound) + sums * power


def share_of(part: float, whole: float) -> float:
    """Return ``part``/``whole``, or 0 if both are 0; ∞ if the ratio is not a finite number."""
    if part == 0:
        return 0.0
    return part / whole if math.isfinite(part) and whole > 0 else math.inf


def faults_of(measured: Mapping[str, float]) -> list[str]:
    """Return the violated conditions in words."""
    faults = [
        f"the residual {name.replace('_', ' ')} is {value:.1e}"
        for name, value in measured.items()
        if name not in RATIOS and not value <= LIMITS.get(name, ROUNDING)
    ]
    for name, what in RATIOS.items():
        ratio = measured.get(name, 0.0)
        if not ratio <= LIMITS[name]:
            faults.append(f"{what} are {ratio:.9g} times as large as they may be")
    return faults
