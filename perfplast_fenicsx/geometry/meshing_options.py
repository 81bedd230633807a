"""Declare how a geometry file is meshed."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.geometry.face_choice import NamedFace, check_planes


@dataclass(frozen=True)
class MeshingOptions:
    """Options for meshing a geometry file.

    Args:
        size: Largest edge length, in the file's unit of length (for STEP files mm, whatever the
            file's own unit is); the default gives some ten thousand elements of equal size.
        sizes: Largest edge length of single bodies, by their names.
        curvature: Least number of elements around a full circle; 0 for no limit. The default is
            ten, or as many as make the areas of faces accurate to 1 %.
        order: Degree of the geometry, 1 or 2; 2 gives curved elements with quadratic edges.
        meshed: Whether touching bodies are meshed together, with matching nodes, or apart, each
            separately, with contact and ties between surfaces that do not match.
        shared: "glued" ties bodies that share faces in the drawing, as layers of one ground do,
            unless a contact or tie between them is given. "apart" leaves them apart.
        symmetry: Planes of symmetry, such as {x = 0.0, y = 0.0}: the half with larger coordinates
            is kept, and the cut is the surface ``symmetry_x``.
        overlap: Bodies may overlap by this share of the smaller one's volume; the later body in the
            file gets the common volume. Larger overlaps are refused.
        close_gaps: Faces of bodies at a smaller distance become one, at the place of either, so
            that the bodies touch. The value must be much smaller than thicknesses and edges.
        patience: Longest time for meshing (s).
        without: Names of bodies that are left out.
        face: Faces with names of their own.
    """

    size: float | None = None
    sizes: dict[str, float] = field(default_factory=dict)
    curvature: float | None = None
    order: Literal[1, 2] = 1
    meshed: Literal["together", "apart"] = "together"
    shared: Literal["glued", "apart"] = "glued"
    symmetry: dict[str, float] = field(default_factory=dict)
    overlap: float = 1e-3
    close_gaps: float = 0.0
    patience: float = 600.0
    without: list[str] = field(default_factory=list)
    face: list[NamedFace] = field(default_factory=list)

    def __post_init__(self) -> None:
        given = {"size": self.size} | {f"sizes of '{body}'": at for body, at in self.sizes.items()}
        given["patience"] = self.patience
        for name, size in given.items():
            if size is not None and not (size > 0 and math.isfinite(size)):
                what = "time" if name == "patience" else "length"
                raise InputError(f"{name} must be a positive {what}, not {size:g}.")
            check_magnitude(name, size or 1.0)
        if self.curvature is not None and not 0 <= self.curvature <= 360:
            raise InputError(
                f"curvature counts elements around a circle, 0 to 360, not {self.curvature:g}."
            )
        if not 0 <= self.overlap < 1:
            raise InputError(f"overlap must be a share from 0 to below 1, not {self.overlap:g}.")
        if not 0 <= self.close_gaps < math.inf:
            raise InputError(f"close_gaps must be a length, not {self.close_gaps:g}.")
        check_magnitude("close_gaps", self.close_gaps or 1.0)
        check_planes("symmetry", self.symmetry)
        names = [one.name for one in self.face]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"two faces are called '{name}'; give each a name of its own.")


def symmetry_name(axis: str) -> str:
    """Return the name of the cut across a coordinate."""
    return f"symmetry_{axis}"
