"""Set element sizes: the largest, the smallest, those of bodies, and the automatic size."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.first_loading import ADAPTED, IN_CONTACT
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part

USUAL = 10.0
"""Default number of elements around a circle."""


def most_elements(dim: int, bodies: int) -> int:
    """Return the largest number of elements of an automatic mesh; adapted ones are larger."""
    return int(ADAPTED[dim] * (IN_CONTACT if bodies > 1 else 1.0))


@dataclass(frozen=True)
class Sizes:
    """The bodies and points whose sizes are set.

    Attributes:
        dim: Dimension of the bodies.
        parts: The bodies.
        points: Points without their own size, as scripts may give.
        scripted: Whether a script defines size fields, which are left unchanged.
        least: Smallest size that curvature may require, relative to the largest.
    """

    dim: int
    parts: Sequence[Part]
    points: tuple[tuple[int, int], ...]
    scripted: bool
    least: float

    @staticmethod
    def of(dim: int, parts: Sequence[Part]) -> "Sizes":
        """Return the sizes of gmsh's current model, before it is meshed."""
        points = gmsh.model.getEntities(0)
        given = gmsh.model.mesh.getSizes(points)
        free = tuple(p for p, h in zip(points, given, strict=True) if h == 0)
        # Smallest relative size that so many curved entities may require; with more of them it is
        # smaller in proportion. Without it fillets, threads and letters would take most elements
        # and most of the time.
        smallest = 0.2
        scripted = bool(len(gmsh.model.mesh.field.list()))
        least = smallest if len(free) == len(points) else 0.0
        return Sizes(dim, parts, free, scripted, least)

    @property
    def usual(self) -> float:
        """Return the default largest edge length."""
        boxes = [box(self.dim, part.tags) for part in self.parts]
        lengths = [np.sort(around[1] - around[0])[-self.dim :] for around in boxes]
        room = sum(float(np.prod(np.maximum(length, 1e-12))) for length in lengths)
        # Approximate number of elements in the boxes around bodies, by dimension, without a given
        # size: the first of several meshes in space, where bounds on 10 000 elements take two
        # minutes, and adapted meshes with half as many give closer bounds.
        elements = {2: 15_000, 3: 4_000}
        share = elements[self.dim] / {2: 2, 3: 6}[self.dim]
        return float(room / share) ** (1 / self.dim)

    def set(
        self, options: MeshingOptions, finer: Mapping[tuple[int, int], float] | None = None
    ) -> float:
        """Set the sizes of elements in gmsh, and return the largest edge length.

        Args:
            options: The given options.
            finer: Edge lengths of curves and faces that need finer elements.

        Raises:
            InputError: If a body with its own size does not exist.
        """
        names = [part.name for part in self.parts]
        for body in options.sizes:
            if body not in names:
                raise InputError(
                    f"sizes names '{body}', but there is no such body; {nearest(body, names)}"
                )
        size = options.size or self.usual
        curvature = USUAL if options.curvature is None else options.curvature
        for name, value in (("FromCurvature", curvature), ("ExtendFromBoundary", 1)):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
        chosen = [size, *options.sizes.values()]
        gmsh.option.setNumber("Mesh.MeshSizeMax", max(chosen))
        least = self.least * size * min(1.0, USUAL / max(curvature, 1.0))
        gmsh.option.setNumber(
            "Mesh.MeshSizeMin", min([least, *options.sizes.values(), *(finer or {}).values()])
        )
        if self.points:  # gmsh would take a tenth of the model's diagonal
            gmsh.model.mesh.setSize(self.points, max(chosen))
        places = _of_bodies(self.dim, self.parts, options.sizes, size) | dict(finer or {})
        if not self.scripted:
            for field in gmsh.model.mesh.field.list():
                gmsh.model.mesh.field.remove(field)
        if places:
            _sizes_in_places(places)
        return size


def _of_bodies(
    dim: int, parts: Sequence[Part], sizes: dict[str, float], elsewhere: float
) -> dict[tuple[int, int], float]:
    """Return edge lengths in bodies, if some have their own."""
    if not sizes:
        return {}
    return {(dim, tag): sizes.get(part.name, elsewhere) for part in parts for tag in part.tags}


def _sizes_in_places(sizes: Mapping[tuple[int, int], float]) -> None:
    """Set edge lengths of entities, the smaller one where several meet."""
    fields = []
    for (dim, tag), size in sizes.items():
        one = gmsh.model.mesh.field.add("Constant")
        gmsh.model.mesh.field.setNumber(one, "VIn", size)
        gmsh.model.mesh.field.setNumber(one, "VOut", 1e22)
        where = {3: "VolumesList", 2: "SurfacesList", 1: "CurvesList"}[dim]
        gmsh.model.mesh.field.setNumbers(one, where, [tag])
        fields.append(one)
    least = gmsh.model.mesh.field.add("Min")
    gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
    gmsh.model.mesh.field.setAsBackgroundMesh(least)
