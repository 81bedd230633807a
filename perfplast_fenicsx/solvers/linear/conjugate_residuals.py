"""Generalised conjugate residuals: of directions that are known, the step that leaves least.

S. Eisenstat, H. Elman and M. Schultz, SIAM Journal on Numerical Analysis 20, 1983. How directions
are found is up to the caller, roughly or not at all: what is left never grows.
"""

from collections import deque
from collections.abc import Callable

import numpy as np

from perfplast_fenicsx.arrays import Floats


class ConjugateResiduals:
    """Motions whose effects are orthonormal, each one conjugate to the last of those before it.

    Attributes:
        count: Directions so far.
    """

    def __init__(self, total: Callable[[float], float]) -> None:
        """Start without any.

        Args:
            total: The sum over all ranks. Collective.
        """
        most = 50  # directions that are kept: where effects are symmetric, two would do
        self._total = total
        self._before: deque[tuple[Floats, Floats]] = deque(maxlen=most)
        self.count = 0

    def step(self, motion: Floats, effect: Floats, left: Floats) -> Floats | None:
        """Return the step along one more direction that leaves least. Collective.

        Args:
            motion: This rank's part of the direction, shape (num_owned,).
            effect: What a step of it takes off, shape (num_effects,); linear in the motion.
            left: What there is to be taken off, of the same shape.

        Returns:
            Shape (num_owned,); None where the direction is one of those before it, or has no
            effect.
        """
        motion, effect = motion.copy(), effect.copy()
        for motion_before, effect_before in self._before:
            share = self._total(float(effect_before @ effect))
            motion -= share * motion_before
            effect -= share * effect_before
        size = np.sqrt(self._total(float(effect @ effect)))
        if not size > 0:
            return None
        length = self._total(float(effect @ left)) / size
        self.count += 1
        self._before.append((motion / size, effect / size))
        step: Floats = length * self._before[-1][0]
        return step
