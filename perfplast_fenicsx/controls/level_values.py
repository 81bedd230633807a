"""Check the values of levels that a user gives, and solve for them."""

import math
from collections.abc import Sequence
from itertools import pairwise

from perfplast_fenicsx.controls.control import Run
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.solvers.load_stepping import load_path, rests_first


def check_values(
    values: Sequence[float], what: str, falling: str = "or, with constant loads, all decrease"
) -> None:
    """Refuse values that are not finite, or that neither increase nor decrease.

    Args:
        values: Values of the levels.
        what: What messages call the values.
        falling: Condition under which they may decrease, in words.

    Raises:
        InputError: Naming the first wrong value.
    """
    if not values:
        raise InputError(f"values is empty; give at least one of the {what}.")
    for value in values:
        if not math.isfinite(value):
            raise InputError(f"values has {value}, but {what} must be finite numbers; correct it.")
    falls = len(values) > 1 and values[1] < values[0]
    for before, value in pairwise(values):
        if value == before or (value < before) != falls:
            raise InputError(
                f"values has {value} after {before}, but {what} must increase ({falling});"
                " sort them and give each once."
            )


def check_rising(values: Sequence[float], what: str) -> None:
    """Refuse values that need constant loads or moving supports.

    Args:
        values: As :func:`check_values` takes them.
        what: What messages call the values.

    Raises:
        InputError: If a value is negative, or if the values decrease.
    """
    for value in values:
        if value < 0:
            raise InputError(
                f"values has {value}, but without constant loads {what} must be >= 0; correct it."
            )
    if len(values) > 1 and values[1] < values[0]:
        raise InputError(
            f"values has {values[1]} after {values[0]}, but without constant loads {what} must"
            " increase; sort them and give each once."
        )


def follow(run: Run, values: Sequence[float]) -> None:
    """Solve for each value that is not on file yet. Collective.

    Args:
        run: The run.
        values: Values of all levels.
    """
    rests = rests_first(run.solver, values)
    run.record.plan(len(values) + rests)
    left = values if run.start is None else values[run.done - rests :]
    for level in load_path(run.solver, left, run.record.iteration, run.start, run.before):
        run.record.level(level)
