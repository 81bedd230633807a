"""Declare initial strains: from temperatures, initial stress, and bolts that are tightened."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.problem.declared.loads import Formula
from perfplast_fenicsx.spatial_fields import SpatialField


@dataclass(frozen=True)
class Bolt:
    """A bolt that is tightened to a preload before loads act; its shortening then stays constant.

    The preload changes forces and stiffness below the limit load, but not the limit load.

    Args:
        on: Physical name of the volume, which is the bolt or only its shank.
        preload: Force in the shank when the bolt is tightened without any load (force; per unit of
            depth in plane strain, for the full turn in axisymmetry). The force refers to the part
            in the mesh: if a plane of symmetry cuts the bolt in half, give half the force.
        axis: Vector along the shank, of any length and either sign; in axisymmetry along the axis
            of revolution.
        shank: Two coordinates along the axis (length). Between them the shank is shortened, and its
            force is reported. The head, the nut and the thread must not lie between them. The
            default is the middle third of the volume.
        name: Name in results; by default ``on``.

    Raises:
        InputError: If the preload is not positive, or if axis or shank are not valid.
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
                f"{where} has preload = {self.preload}, but a preload is a tensile force "
                "above 0; remove the bolt if it is not tightened."
            )
        check_magnitude(f"the preload of '{self.called}'", self.preload)
        if not all(map(math.isfinite, self.axis)) or not any(self.axis):
            raise InputError(
                f"{where} has axis = {list(self.axis)}, which is not a direction; give a direction "
                "such as [0, 0, 1]."
            )
        if self.shank is None:
            return
        rises = len(self.shank) == 2 and self.shank[0] < self.shank[1]
        if not rises or not all(map(math.isfinite, self.shank)):
            raise InputError(
                f"{where} has shank = {list(self.shank)}, which is not a range along the axis; "
                "give the positions of its start and end, the smaller one first."
            )

    @property
    def called(self) -> str:
        """Return the name of the bolt in results and messages."""
        return self.name or self.on


@dataclass(frozen=True)
class Temperature:
    """Change of temperature in a volume; constant at any load factor unless stages name it.

    Args:
        on: Physical name of the volume, whose material must have an ``expansion``.
        change: The change (temperature): a number, a formula in x, y, z, or a field.
        name: Name in stages; by default ``on``.
    """

    on: str
    change: Formula | SpatialField
    name: str = ""


@dataclass(frozen=True)
class InitialStress:
    """Stress in a volume before any deformation, the same at any load factor.

    Args:
        on: Physical name of the volume.
        stress: Components xx, yy, zz, yz, xz, xy, or xx, yy, zz, xy in plane meshes (stress;
            tension is positive): numbers, or formulas in x, y, z.
    """

    on: str
    stress: Sequence[Formula]


Initial = Temperature | InitialStress | Bolt
