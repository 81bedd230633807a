"""Prove the bounds of a file anew: ``python3 -m perfplast_fenicsx.proof DIR/bounds.h5``.

The file has a group ``lower`` with a stress, ``upper`` with a velocity, or both. Each has all that
its proof needs, the bodies with their loads included (:class:`body.Body`). On one process.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.body import Body, ProofError
from perfplast_fenicsx.proof.lower import measure_stress
from perfplast_fenicsx.proof.upper import check_nodes, measure_velocity

ROUNDING = 1e-9
"""What may be left of a condition."""

SUBDIVISIONS = 3
"""How often a cell's edges are halved to integrate the dissipation from above."""


@dataclass(frozen=True)
class Checked:
    """What a stress or a velocity proves.

    Attributes:
        kind: "lower" or "upper".
        claimed: The bound that the file names.
        proven: The bound that was found; None where a condition fails.
        measured: What is left of each condition.
        faults: Which fail, in words; nothing where what is claimed holds.
    """

    kind: str
    claimed: float
    proven: float | None
    measured: Mapping[str, float]
    faults: tuple[str, ...]

    def __str__(self) -> str:
        left = ", ".join(f"{name} {value:.1e}" for name, value in self.measured.items())
        if self.faults:
            return f"{self.kind}: {self.claimed:.8g} is not proven: {'; '.join(self.faults)}"
        return f"{self.kind}: {self.proven:.8g} is proven (claimed {self.claimed:.8g}; {left})"


def check(path: str | Path) -> dict[str, Checked]:
    """Check the bounds of a file.

    Args:
        path: The file.

    Returns:
        What is proven, by "lower" and "upper".

    Raises:
        ProofError: If the file cannot be read, or is no proof.
    """
    checks = {"lower": check_lower, "upper": check_upper}
    found = {}
    try:
        with h5py.File(path, "r", locking=False) as file:
            for kind, checked in checks.items():
                if kind in file:
                    group = file[kind]
                    arrays = {name: np.asarray(group[name]) for name in group}
                    arrays["bound"] = np.asarray(group.attrs["bound"])
                    found[kind] = checked(arrays)
    except (OSError, KeyError, AttributeError, TypeError, RuntimeError, ProofError) as fault:
        raise ProofError(f"'{path}' is no proof of bounds: {fault}") from fault
    if not found:
        raise ProofError(f"'{path}' has neither a lower nor an upper bound.")
    return found


def check_lower(arrays: Mapping[str, npt.NDArray]) -> Checked:
    """Check a stress: ``stress`` (num_cells, d + 1, d, d), ``bound``, and those of the bodies.

    Raises:
        ProofError: If the arrays do not fit together.
    """
    body, claimed = Body.of(arrays), float(arrays["bound"])
    stress = np.asarray(arrays["stress"], dtype=np.float64)
    if stress.shape != (len(body.cells), body.dim + 1, body.dim, body.dim):
        raise ProofError("the stress does not fit the cells.")
    measured, reason = measure_stress(body, stress, claimed)
    ratio = measured["yield_ratio"]
    faults = [] if reason is None else [reason]
    faults += _left(measured, {"yield_ratio"})
    if not ratio <= 1 + ROUNDING:
        faults.append(f"stresses are {ratio:.9g} times as large as they may be")
    proven = claimed / max(1.0, ratio)
    return Checked("lower", claimed, None if faults else proven, measured, tuple(faults))


def check_upper(arrays: Mapping[str, npt.NDArray]) -> Checked:
    """Check a velocity: ``velocity`` (num_nodes, d), ``nodes`` of the cells, ``bound``, the bodies.

    Raises:
        ProofError: If the arrays do not fit together.
    """
    body, claimed = Body.of(arrays), float(arrays["bound"])
    velocity = np.asarray(arrays["velocity"], dtype=np.float64)
    if velocity.ndim != 2 or velocity.shape[1] != body.dim or not np.isfinite(velocity).all():
        raise ProofError("the velocity is none of these bodies.")
    nodes = np.asarray(arrays["nodes"]).astype(np.int64)
    check_nodes(body, nodes, len(velocity))
    measured, dissipation, work, reason = measure_velocity(body, velocity[nodes], SUBDIVISIONS)
    faults = [] if reason is None else [reason]
    faults += _left(measured, set())
    if not work > 0:
        return Checked("upper", claimed, None, measured, (*faults, "the loads do no work"))
    proven = dissipation / work
    if not proven <= claimed + ROUNDING * abs(claimed):
        faults.append(f"only {proven:.9g} is proven")
    return Checked("upper", claimed, None if faults else proven, measured, tuple(faults))


def _left(measured: Mapping[str, float], but: set[str]) -> list[str]:
    """The conditions that fail."""
    return [
        f"{name.replace('_', ' ')} of {value:.1e} is left"
        for name, value in measured.items()
        if name not in but and not value <= ROUNDING
    ]
