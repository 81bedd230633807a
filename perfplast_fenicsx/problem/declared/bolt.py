"""A bolt that is tightened before any load acts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, check_magnitude


@dataclass(frozen=True)
class Bolt:
    """A bolt that is tightened to a preload before loads act, and keeps its length from then on.

    The preload changes forces and stiffness below the limit load, and no limit load.

    Args:
        on: Physical volume: the bolt, or its shank.
        preload: Force in the shank when it is tightened, without any load (force; in plane strain
            for each unit of depth, in axisymmetry of the full turn). It is that of what is in the
            mesh: of a bolt that a plane of symmetry halves, half its force.
        axis: Direction of the shank, of any length and either sign; in axisymmetry that of the
            axis of revolution.
        shank: Where the part begins and ends that is shortened, and whose force is reported:
            coordinates along the axis (length), with neither head, nut nor thread in between.
            Without it the middle third of the volume.
        name: Name in results; by default ``on``.

    Raises:
        InputError: If the preload is not positive, or axis or shank are not valid.
    """

    on: str
    preload: float
    axis: Sequence[float]
    shank: Sequence[float] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        where = f"the bolt '{self.called}'"
        if not (math.isfinite(self.preload) and self.preload > 0):
            raise InputError(
                f"{where} has preload = {self.preload}, but it is a force above 0, which pulls the"
                " shank; leave the bolt out if it is not tightened."
            )
        check_magnitude(f"the preload of '{self.called}'", self.preload)
        if not all(map(math.isfinite, self.axis)) or not any(self.axis):
            raise InputError(
                f"{where} has axis = {list(self.axis)}, which is not a direction; give one such as"
                " [0, 0, 1]."
            )
        if self.shank is None:
            return
        rises = len(self.shank) == 2 and self.shank[0] < self.shank[1]
        if not rises or not all(map(math.isfinite, self.shank)):
            raise InputError(
                f"{where} has shank = {list(self.shank)}, but that is where the shank begins and"
                " ends along the axis; give two numbers, the smaller one first."
            )

    @property
    def called(self) -> str:
        """How results and messages call it."""
        return self.name or self.on
