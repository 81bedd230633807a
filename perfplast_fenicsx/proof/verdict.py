"""Verdicts on a stress or a velocity, and the limits of residuals."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

ROUNDING = 1e-9
"""Limit of a residual that has no limit of its own in :data:`LIMITS`."""

ROUNDED = 1e-8
"""Share by which a file may claim more than it proves. The checker prints what is proven."""

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
"""Limits of residuals. Symmetry is exact, as a program can write it. Rows of a stress have the
rounding of mean stresses that may be 1e5 yield radii. All forces together are a millionth of the
least distance at which bounds are sought, 1e-4, and a ten-millionth of what the weakest cell could
bear. Most are of cones without a bound and of blocks alone, as elsewhere residuals make a
lower bound smaller. Those of a velocity make an upper bound larger."""

RATIOS = {"yield_ratio": "stresses", "shear_ratio": "shear tractions of contact"}
"""Conditions that a stress keeps to when it is divided by what is measured."""


@dataclass(frozen=True)
class Checked:
    """The verdict on a stress or a velocity.

    Attributes:
        kind: "lower" or "upper".
        claimed: The bound that the file names.
        proven: The bound that was found; None where a condition fails.
        measured: What is left of each condition.
        faults: Which fail, in words; nothing where what is claimed holds.
        words: What it is a proof about, and what is left in all, a sentence each.
        reached: The bound that the numbers prove, whatever is claimed; None where they prove
            nothing.
    """

    kind: str
    claimed: float
    proven: float | None
    measured: Mapping[str, float]
    faults: tuple[str, ...]
    words: tuple[str, ...] = ()
    reached: float | None = None

    def __str__(self) -> str:
        if self.faults:
            return f"{self.kind}: {self.claimed:.8g} is not proven: {'; '.join(self.faults)}"
        told = [f"claimed {self.claimed:.8g}"]
        told += [", ".join(f"{name} {value:.1e}" for name, value in self.measured.items())]
        return f"{self.kind}: {self.proven:.8g} is proven ({'; '.join(filter(None, told))})"


def rounding_of(bound: float, power: float) -> float:
    """Return by how much an upper bound may be below the one that is proven, to be the same.

    Args:
        bound: What is left of what is dissipated when loads that stay have done their work.
        power: All that is dissipated, over the work of the loads whose factor is bounded: its sums
            are rounded, however little is left.
    """
    sums = 1e-12  # rounding of sums over all cells
    return ROUNDED * abs(bound) + sums * power


def share_of(part: float, whole: float) -> float:
    """Return a part of a whole, ∞ if it is no number, or something of nothing."""
    if part == 0:
        return 0.0
    return part / whole if math.isfinite(part) and whole > 0 else math.inf


def faults_of(measured: Mapping[str, float]) -> list[str]:
    """Return the conditions that fail."""
    faults = [
        f"{name.replace('_', ' ')} of {value:.1e} is left"
        for name, value in measured.items()
        if name not in RATIOS and not value <= LIMITS.get(name, ROUNDING)
    ]
    for name, what in RATIOS.items():
        ratio = measured.get(name, 0.0)
        if not ratio <= LIMITS[name]:
            faults.append(f"{what} are {ratio:.9g} times as large as they may be")
    return faults
