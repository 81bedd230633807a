"""How the loading is controlled: the choices of ``[loading]`` in case files."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table
from perfplast_fenicsx.limit_analysis.discrete.limit_methods import TOLERANCE, LimitMethod
from perfplast_fenicsx.limit_analysis.statements.design_factor import check_design
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage


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
    limit_method: ClassVar[None] = None
    design: ClassVar[None] = None
    element: ClassVar[Table] = {}

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
        until: "limit" seeks the limit load, or with Coulomb's friction the load at which the path
            loses equilibrium.
        limit_tolerance: How near to each other its bounds must be, or to its limit ζ(α), relative,
            between 0 and 1; 1e-3 where it is not given. With ``until`` only.
        limit_method: "interior-point" finds the limit load alone, in 5 to 30 factorisations;
            "path" follows ζ(α), by steps of its own, until it has levelled off. The default is the
            former where it knows the laws and a factorisation fits, unless there is a [solve] to
            follow a path with or Coulomb's friction. With ``until`` only.
        design: Load factor of the load that the bodies are designed for, often 1.0: results tell
            how many times it is carried. With ``until`` only.

    Raises:
        InputError: Not exactly one of ``values`` and ``until``, or values out of their range.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.WORK
    element: ClassVar[Table] = {}

    values: list[float] | None = None
    until: Literal["limit"] | None = None
    limit_tolerance: float | None = None
    limit_method: Literal["interior-point", "path"] | None = None
    design: float | None = None

    def __post_init__(self) -> None:
        if (self.values is None) == (self.until is None):
            what = "neither values nor until" if self.values is None else "both values and until"
            raise InputError(f"there is {what}; give either values = [...] or until = 'limit'.")
        if self.values is not None:
            _check_values(self.values, "works")
            for key in ("limit_tolerance", "limit_method", "design"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key} goes with until = 'limit'; leave it out.")
        else:
            tolerance = TOLERANCE if self.limit_tolerance is None else self.limit_tolerance
            check_tolerance(tolerance)
            check_design(self.design)
            object.__setattr__(self, "limit_tolerance", tolerance)

    def check_proportional(self) -> None:
        """Refuse what makes sense beside constant loads or moving supports alone."""
        _check_rising(self.values or [], "works")


@dataclass(frozen=True)
class BoundsControl:
    """No loading: bounds of the limit load that hold for the body, and not just for its mesh.

    Args:
        limit_tolerance: How near each bound comes to the best of its kind on this mesh, relative,
            between 0 and 1.
        design: Load factor of the load that the bodies are designed for, often 1.0: results tell
            how many times it is carried.

    Raises:
        InputError: A tolerance or a load factor that is none.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.WORK  # L(v) = 1
    values: ClassVar[None] = None
    limit_method: ClassVar[LimitMethod] = LimitMethod.INTERIOR_POINT
    element: ClassVar[Table] = {"degree": 2}  # linear ones lock

    limit_tolerance: float = 1e-4
    design: float | None = None

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        check_design(self.design)


@dataclass(frozen=True)
class StrengthControl:
    """No loading: bounds of the factor by which strengths may fall until the bodies fall.

    Yield stresses, cohesions and slopes of friction are divided by it alike; the loads stay, and
    all of them are constant.

    Args:
        limit_tolerance: How near each factor comes to the root of its bound, relative, between 0
            and 1.

    Raises:
        InputError: A tolerance that is none.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.WORK
    values: ClassVar[None] = None
    limit_method: ClassVar[LimitMethod] = LimitMethod.INTERIOR_POINT
    design: ClassVar[None] = None
    element: ClassVar[Table] = {"degree": 2}

    limit_tolerance: float = 1e-3

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)


@dataclass(frozen=True)
class DisplacementControl:
    """Loading by given motions: ζ multiplies what supports and obstacles are moved by.

    Args:
        values: Load factors, all increasing or all decreasing.
        until: The last load factor, not 0: those before it are chosen, from first yield on.

    Raises:
        InputError: Not exactly one of ``values`` and ``until``, or values out of their range.
    """

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    limit_tolerance: ClassVar[None] = None
    limit_method: ClassVar[None] = None
    design: ClassVar[None] = None
    element: ClassVar[Table] = {}

    values: list[float] | None = None
    until: float | None = None

    def __post_init__(self) -> None:
        if (self.values is None) == (self.until is None):
            what = "neither values nor until" if self.values is None else "both values and until"
            raise InputError(f"there is {what}; give either values = [...] or until = 1.0.")
        if self.values is not None:
            _check_values(self.values, "load factors", "or all decrease")
        elif self.until == 0 or not math.isfinite(self.until or 0.0):
            raise InputError(
                f"until = {self.until} is no load factor to go to; give a finite number but 0."
            )


@dataclass(frozen=True)
class StageControl:
    """Loading by stages, in place of [loading]."""

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    values: ClassVar[None] = None
    limit_tolerance: ClassVar[None] = None
    limit_method: ClassVar[None] = None
    design: ClassVar[None] = None
    element: ClassVar[Table] = {}

    stages: list[Stage]


Control = (
    LoadControl | DisplacementControl | WorkControl | BoundsControl | StrengthControl | StageControl
)

OfBodies = BoundsControl | StrengthControl
"""Those that ask for what holds for the bodies, and not for their mesh alone."""


def _check_values(
    values: list[float], what: str, falling: str = "or, beside constant loads, all decrease"
) -> None:
    if not values:
        raise InputError(f"values is empty; give at least one of the {what}.")
    for value in values:
        if not math.isfinite(value):
            raise InputError(f"values has {value}, but {what} are finite numbers; correct it.")
    falls = len(values) > 1 and values[1] < values[0]
    for before, value in pairwise(values):
        if value == before or (value < before) != falls:
            raise InputError(
                f"values has {value} after {before}, but {what} must increase ({falling});"
                " sort them and give each once."
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


LOADINGS: dict[str, type[Control]] = {
    "load": LoadControl,
    "displacement": DisplacementControl,
    "work": WorkControl,
    "bounds": BoundsControl,
    "strength": StrengthControl,
}
