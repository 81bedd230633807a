"""How the loading is controlled: the choices of ``[loading]`` in case files."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.prescribed import Prescribed


@dataclass(frozen=True)
class LoadControl:
    """Loading by the load factor ζ.

    Args:
        values: Load factors, increasing, not negative. Beside constant loads they may be negative
            or fall; ζ = 0 is then solved first.

    Raises:
        InputError: No value at all, or values that are not finite, or neither rise nor fall.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    limit_tolerance: ClassVar[None] = None

    values: list[float]

    def __post_init__(self) -> None:
        _check_values(self.values, "load factors")

    def check_proportional(self) -> None:
        """Refuse what makes sense beside constant loads or moving supports alone."""
        _check_rising(self.values, "load factors")


@dataclass(frozen=True)
class WorkControl:
    """Loading by the work of the loads α = L(u), with given values or until the limit load.

    Args:
        values: Works, increasing, not negative. Beside constant loads and supports that move, where
            α = α₀ at ζ = 0, they may be negative or fall.
        until: "limit" chooses the steps itself, until ζ(α) has levelled off.
        limit_tolerance: How near to its limit ζ must have come, relative, between 0 and 1; with
            ``until`` only.

    Raises:
        InputError: Not exactly one of ``values`` and ``until``, ``until`` without a tolerance, or
            values out of their range.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.WORK

    values: list[float] | None = None
    until: Literal["limit"] | None = None
    limit_tolerance: float | None = None

    def __post_init__(self) -> None:
        if (self.values is None) == (self.until is None):
            what = "neither values nor until" if self.values is None else "both values and until"
            raise InputError(
                f"there is {what}; give either values = [...] or until = 'limit' with a"
                " limit_tolerance such as 1e-4."
            )
        if self.values is not None:
            _check_values(self.values, "works")
            if self.limit_tolerance is not None:
                raise InputError("limit_tolerance goes with until = 'limit'; leave it out.")
        elif self.limit_tolerance is None:
            raise InputError("until = 'limit' needs a limit_tolerance; 1e-4 is a good value.")
        elif not 0 < self.limit_tolerance < 1:
            raise InputError(
                f"limit_tolerance = {self.limit_tolerance} is not between 0 and 1; try 1e-4."
            )

    def check_proportional(self) -> None:
        """Refuse what makes sense beside constant loads or moving supports alone."""
        _check_rising(self.values or [], "works")


def _check_values(values: list[float], what: str) -> None:
    if not values:
        raise InputError(f"values is empty; give at least one of the {what}.")
    for value in values:
        if not math.isfinite(value):
            raise InputError(f"values has {value}, but {what} are finite numbers; correct it.")
    falls = len(values) > 1 and values[1] < values[0]
    for before, value in pairwise(values):
        if value == before or (value < before) != falls:
            raise InputError(
                f"values has {value} after {before}, but {what} must increase (or, beside constant"
                " loads, all decrease); sort them and give each once."
            )


def _check_rising(values: list[float], what: str) -> None:
    for value in values:
        if value < 0:
            raise InputError(
                f"values has {value}, but without constant loads {what} are finite numbers >= 0;"
                " correct it."
            )
    if len(values) > 1 and values[1] < values[0]:
        raise InputError(
            f"values has {values[1]} after {values[0]}, but without constant loads {what} must"
            " increase; sort them and give each once."
        )


LOADINGS: dict[str, type[LoadControl | WorkControl]] = {"load": LoadControl, "work": WorkControl}
