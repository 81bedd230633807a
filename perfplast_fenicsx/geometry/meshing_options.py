"""How a geometry file is to be meshed."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perfplast_fenicsx.errors import InputError, check_magnitude


@dataclass(frozen=True)
class MeshingOptions:
    """How a geometry file is to be meshed.

    Args:
        size: Largest edge length, in the file's unit of length (of STEP files mm, whatever the
            file's own unit is); by default as for some ten thousand elements of equal size.
        sizes: Largest edge length of single bodies, by their names.
        curvature: Elements about a full circle, at least; 0 for none of them.
        order: Degree of the geometry, 1 or 2; 2 makes curved elements of quadratic edges.
        overlap: Bodies may overlap by this share of the smaller one's volume; the later one in the
            file has what both had. What overlaps more is refused.
    """

    size: float | None = None
    sizes: dict[str, float] = field(default_factory=dict)
    curvature: float = 10.0
    order: Literal[1, 2] = 1
    overlap: float = 1e-3

    def __post_init__(self) -> None:
        given = {"size": self.size} | {f"sizes of '{body}'": at for body, at in self.sizes.items()}
        for name, size in given.items():
            if size is not None and not (size > 0 and math.isfinite(size)):
                raise InputError(f"{name} must be a positive length, not {size:g}.")
            check_magnitude(name, size or 1.0)
        if not 0 <= self.curvature <= 360:
            raise InputError(
                f"curvature counts elements about a circle, 0 to 360, not {self.curvature:g}."
            )
        if not 0 <= self.overlap < 1:
            raise InputError(f"overlap must be a share from 0 to below 1, not {self.overlap:g}.")
