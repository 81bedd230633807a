"""Minimise residuals along given directions, by generalised conjugate residuals.

S. Eisenstat, H. Elman and M. Schultz, SIAM Journal on Numerical Analysis 20, 1983. The caller
computes the directions, exactly or approximately; the residual never grows.
"""

from collections import deque
from collections.abc import Callable

import numpy as np

from perfplast_fenicsx.arrays import Floats


class ConjugateResiduals:
    """Directions with orthonormal effects; each is conjugate to the stored directions before it.

    Attributes:
        count: Number of directions so far.
    """

    def __init__(self, total: Callable[[float], float]) -> None:
        """Start without directions.

        Args:
            total: Collective function that sums a number over all ranks.
        """
        most = 50  # number of stored directions; two would suffice for a symmetric operator
        self._total = total
        self._before: deque[tuple[Floats, Floats]] = deque(maxlen=most)
        self.count = 0

    def step(self, motion: Floats, effect: Floats, left: Floats) -> Floats | None:
        """Return the step along a new direction that minimises the residual. Collective.

        Args:
            motion: Part of the direction on this rank, shape (num_owned,).
            effect: Effect of the direction on the residual, shape (num_effects,); it must be linear
                in ``motion``.
            left: Current residual, same shape.

        Returns:
            The step, shape (num_owned,); None if the direction is linearly dependent or has no
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
