"""List the algorithms that a case file may name."""

from dataclasses import dataclass
from typing import Any

from perfplast_fenicsx.solvers.augmented_lagrangian import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
)
from perfplast_fenicsx.solvers.newton import BorderedNewton, Newton, WorkNewton
from perfplast_fenicsx.solvers.newton_options import NewtonOptions


@dataclass(frozen=True)
class SolveMethod:
    """An algorithm of ``[solve]``: the dataclass of its options, and the class of its solver."""

    options: type[Any]
    solver: type[Any]


METHODS = {
    "newton": SolveMethod(NewtonOptions, Newton),
    "augmented-lagrangian": SolveMethod(AugmentedLagrangianOptions, AugmentedLagrangian),
    "work-newton": SolveMethod(NewtonOptions, WorkNewton),
    "bordered-newton": SolveMethod(NewtonOptions, BorderedNewton),
}
"""Algorithms by the value of ``method`` in case files."""
