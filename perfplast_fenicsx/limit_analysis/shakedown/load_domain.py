"""Define the domain of the factors of varying loads, and its corners."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class LoadDomain:
    """The convex hull of corners, each with a factor for every name.

    Attributes:
        names: Names of loads and temperatures that vary.
        corners: Factors of the corners, shape (num_corners, num_names).
    """

    names: tuple[str, ...]
    corners: Floats

    @staticmethod
    def of_ranges(ranges: Mapping[str, Sequence[float]]) -> "LoadDomain":
        """Return the domain in which each factor varies independently between two limits.

        Args:
            ranges: Least and largest factor of each name.

        Raises:
            InputError: If there is no range, or too many, or one is not valid.
        """
        if not ranges:
            raise InputError("ranges is empty; give one at least, such as { pressure = [0, 1] }.")
        most = 6  # 64 corners, each with its own cone at every point
        if len(ranges) > most:
            raise InputError(
                f"there are {len(ranges)} ranges, and so {2 ** len(ranges)} corners; give"
                f" {most} at most, or the corners that occur as corners = [...]."
            )
        for name, given in ranges.items():
            if len(given) != 2 or not all(map(math.isfinite, given)) or not given[0] < given[1]:
                shown = ", ".join(f"{value:g}" for value in given)
                raise InputError(
                    f"[{shown}] is not a valid range for '{name}'; give two different factors, the"
                    " smaller one first. For what does not vary set constant = true."
                )
        corners = np.array(list(itertools.product(*ranges.values())), dtype=np.float64)
        return LoadDomain(tuple(ranges), corners)

    @staticmethod
    def of_corners(corners: Sequence[Mapping[str, float]]) -> "LoadDomain":
        """Return the convex hull of given corners.

        Names that a corner leaves out have the factor 0.

        Raises:
            InputError: If fewer than two corners differ, or a factor is not finite.
        """
        names = tuple(dict.fromkeys(name for corner in corners for name in corner))
        rows = [[float(corner.get(name, 0.0)) for name in names] for corner in corners]
        if not np.isfinite(np.array(rows)).all():
            raise InputError("corners has a factor that is not finite; give numbers.")
        different = sorted(set(map(tuple, rows)))
        if len(different) < 2:
            raise InputError(
                f"corners has {len(different)} corner{'s' * (not different)} that"
                f" differ{'s' if different else ''}, so that nothing varies; give two at least, or"
                " control = 'bounds' for loads that grow once."
            )
        return LoadDomain(names, np.array(different))
