"""Stages of a loading history, and whether they name what there is."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, check_magnitude, nearest
from perfplast_fenicsx.problem.initial_strain import Initial, Temperature
from perfplast_fenicsx.problem.loads import Load


@dataclass(frozen=True)
class Stage:
    """A part of a loading history, in which factors change linearly with time.

    Args:
        factors: What multiplies loads and changes of temperature at the end of the stage, by their
            names; where they have none by their ``on``. All start at zero, and what a stage does
            not name keeps its factor. Constant loads, and temperatures that no stage names, act in
            full all the time.
        steps: Levels of the stage, at least 1. Where directions of stress turn, more of them make
            the result more accurate.
        name: What results call it.

    Raises:
        InputError: If a number is out of its range.
    """

    factors: dict[str, float]
    steps: int = 1
    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.steps, int) or isinstance(self.steps, bool) or self.steps < 1:
            raise InputError(f"steps = {self.steps!r} is no number of levels; give 1 or more.")
        for name, factor in self.factors.items():
            if not math.isfinite(factor):
                raise InputError(
                    f"the factor of '{name}' is {factor}, which is not finite; give a number."
                )
            check_magnitude(f"the factor of '{name}'", factor)


def called(given: Load | Temperature) -> str:
    """The name by which stages know something."""
    return given.name or given.on


def check_stages(
    stages: Sequence[Stage], loads: Sequence[Load], initial: Iterable[Initial]
) -> None:
    """Make sure that factors and what they multiply belong together.

    Raises:
        InputError: If a stage names something else than loads that are not constant and
            temperatures, or such a load is in no stage.
    """
    growing = {called(load) for load in loads if not load.constant}
    constant = {called(load) for load in loads if load.constant}
    names = growing | {called(one) for one in initial if isinstance(one, Temperature)}
    named = [(number, name) for number, stage in enumerate(stages, 1) for name in stage.factors]
    for number, name in named:
        if name in constant:
            raise InputError(
                f"stage {number} has a factor for the load '{name}', which is constant; leave the"
                " factor out, or constant = true."
            )
        if name not in names:
            raise InputError(
                f"stage {number} has a factor for '{name}', but there is no load and no change of"
                f" temperature of this name; {nearest(name, names)}"
            )
    for name in sorted(growing - {name for _, name in named}):
        raise InputError(
            f"the load '{name}' is in no stage, so that it would never act; give it a factor, or"
            " constant = true."
        )
