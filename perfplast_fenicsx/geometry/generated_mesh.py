"""Set element sizes, and mesh bodies with one of several algorithms of gmsh."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.first_case import ADAPTED, IN_CONTACT
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.measured import elements, mesh_measure, missed_areas, qualities
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.straight_facets import Sleeve, mesh_sleeves, sleeves_of

USUAL = 10.0
"""Default number of elements around a circle."""


def most_elements(dim: int, bodies: int) -> int:
    """Return the largest number of elements of an automatic mesh; adapted meshes have more."""
    return int(ADAPTED[dim] * (IN_CONTACT if bodies > 1 else 1.0))


LARGEST, SMALLEST, AROUND = "MeshSizeMax", "MeshSizeMin", "MeshSizeFromCurvature"
SCRIPTED = {
    LARGEST: 1e22,
    SMALLEST: 0.0,
    "MeshSizeFactor": 1.0,
    AROUND: 0.0,
    "MeshSizeExtendFromBoundary": 1.0,
    "ElementOrder": 1.0,
    "Algorithm": 6.0,
    "Algorithm3D": 1.0,
}
"""Gmsh's options (``Mesh.``) that a script may set, with gmsh's defaults."""


def with_scripted(options: MeshingOptions) -> tuple[MeshingOptions, float, list[str]]:
    """Return options with the sizes that a script has set, if the user gives no sizes.

    Args:
        options: The given options.

    Returns:
        The options, the smallest edge length in the script (0 without one), and a remark on values
        in the script that are not used.
    """
    numbers = {name: gmsh.option.getNumber(f"Mesh.{name}") for name in SCRIPTED}
    given = {name: number for name, number in numbers.items() if number != SCRIPTED[name]}
    unused = dict[str, str]()
    if options.size is not None:
        for name in (LARGEST, SMALLEST, "MeshSizeFactor"):
            unused[name] = f"size = {options.size:g} is given"
            gmsh.option.setNumber(f"Mesh.{name}", SCRIPTED[name])
    elif LARGEST in given:
        options = replace(options, size=given[LARGEST])
    if options.curvature is not None:
        unused[AROUND] = f"curvature = {options.curvature:g} is given"
    elif AROUND in given:
        options = replace(options, curvature=given[AROUND])
    unused["MeshSizeExtendFromBoundary"] = "sizes extend from the boundary"
    unused |= dict.fromkeys(("Algorithm", "Algorithm3D"), "the program tries several algorithms")
    if options.order != given.get("ElementOrder", options.order):
        unused["ElementOrder"] = f"order = {options.order}; give another order by --order"
    gmsh.option.setNumber("Mesh.ElementOrder", 1)  # the program curves the elements afterwards
    told = [f"Mesh.{it} = {given[it]:g} ({why})" for it, why in unused.items() if it in given]
    remarks = [f"the script sets values that are not used: {', '.join(told)}"] if told else []
    return options, 0.0 if SMALLEST in unused else numbers[SMALLEST], remarks


@dataclass(frozen=True)
class Sizes:
    """The bodies and points at which element sizes are set.

    Attributes:
        dim: Dimension of the bodies.
        parts: The bodies.
        points: Points without a size; a script may give sizes at points.
        scripted: Whether a script defines size fields, which remain unchanged.
        least: Smallest size that curvature may require, relative to the largest size.
        smallest: Smallest size that a script gives (Mesh.MeshSizeMin); 0 if it gives none.
        sleeves: Cylindrical joints whose facets lie along the axis.
    """

    dim: int
    parts: Sequence[Part]
    points: tuple[tuple[int, int], ...]
    scripted: bool
    least: float
    smallest: float = 0.0
    sleeves: Sequence[Sleeve] = ()

    @staticmethod
    def of(
        dim: int, parts: Sequence[Part], sliding: Sequence[int] = (), smallest: float = 0.0
    ) -> "Sizes":
        """Return the bodies and points of gmsh's current model, before it is meshed.

        Args:
            dim: Dimension of the bodies.
            parts: The bodies.
            sliding: Faces at which bodies may slide on each other.
            smallest: See :class:`Sizes`.
        """
        points = gmsh.model.getEntities(0)
        given = gmsh.model.mesh.getSizes(points)
        free = tuple(p for p, h in zip(points, given, strict=True) if h == 0)
        # Smallest size, relative to the largest, that curvature may require. If the user gives a
        # larger number of elements around a circle, the limit is smaller in proportion. Without
        # this limit, fillets, threads and engraved letters would need most of the elements and
        # of the time.
        curved = 0.2
        scripted = bool(len(gmsh.model.mesh.field.list()))
        least = curved if len(free) == len(points) else 0.0
        return Sizes(dim, parts, free, scripted, least, smallest, sleeves_of(sliding))

    @property
    def usual(self) -> float:
        """Return the default value of the largest edge length."""
        boxes = [box(self.dim, part.tags) for part in self.parts]
        lengths = [np.sort(around[1] - around[0])[-self.dim :] for around in boxes]
        room = sum(float(np.prod(np.maximum(length, 1e-12))) for length in lengths)
        # Approximate number of elements in the boxes around bodies, by dimension, if no size is
        # given. In space this is the first of several meshes: bounds on 10 000 elements take two
        # minutes, and adapted meshes with half as many elements give closer bounds.
        elements = {2: 15_000, 3: 4_000}
        share = elements[self.dim] / {2: 2, 3: 6}[self.dim]
        return float(room / share) ** (1 / self.dim)

    def set(
        self, options: MeshingOptions, finer: Mapping[tuple[int, int], float] | None = None
    ) -> float:
        """Set the element sizes in gmsh, and return the largest edge length.

        Args:
            options: The given options.
            finer: Edge lengths on curves and faces that need finer elements, by dimension and tag.

        Raises:
            InputError: If the options give a size for a body that does not exist.
        """
        names = [part.name for part in self.parts]
        for body in options.sizes:
            if body not in names:
                raise InputError(
                    f"sizes has an entry for '{body}', but there is no such body; "
                    f"{nearest(body, names)}"
                )
        size = options.size or self.usual
        curvature = USUAL if options.curvature is None else options.curvature
        for name, value in (("FromCurvature", curvature), ("ExtendFromBoundary", 1)):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
        chosen = [size, *options.sizes.values()]
        gmsh.option.setNumber("Mesh.MeshSizeMax", max(chosen))
        least = self.smallest or self.least * size * min(1.0, USUAL / max(curvature, 1.0))
        gmsh.option.setNumber(
            "Mesh.MeshSizeMin", min([least, *options.sizes.values(), *(finer or {}).values()])
        )
        if self.points:  # the default of gmsh is a tenth of the model's diagonal
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
    """Return the edge length in each entity of the bodies; {} if no body has its own size."""
    if not sizes:
        return {}
    return {(dim, tag): sizes.get(part.name, elsewhere) for part in parts for tag in part.tags}


def _sizes_in_places(sizes: Mapping[tuple[int, int], float]) -> None:
    """Set edge lengths in entities; where several entities meet, the smallest one applies."""
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


NO_VOLUME = 1e-10
"""Quality below which an element has no volume or a negative one; no run accepts such elements."""

FLAT = 1e-7
"""Quality below which an element is almost flat; the program then tries another algorithm."""

ALGORITHMS = ((6, 1), (6, 10), (1, 1))
"""Gmsh's algorithms for faces and for bodies, in the order in which the program tries them. The
first pair, frontal Delaunay and Delaunay, is gmsh's default. HXT in the second pair places nodes
differently. MeshAdapt in the third pair meshes the most difficult faces."""

POOR = 0.02
"""Quality of the worst element below which there is a remark."""


def generate(
    sizes: Sizes, options: MeshingOptions, finer: Mapping[tuple[int, int], float] | None = None
) -> float:
    """Mesh the bodies, and return the largest edge length.

    Args:
        sizes: Sizes of the bodies.
        options: The given options.
        finer: Edge lengths on curves and faces that need finer elements, by dimension and tag.

    Raises:
        InputError: If a body cannot be meshed; the message has its name and a remedy.
    """
    dim, parts = sizes.dim, sizes.parts
    size = sizes.set(options, finer)
    _generate(dim, parts, sizes.sleeves if options.order == 1 else ())
    if options.order == 2:
        gmsh.model.mesh.setOrder(2)
        if min(qualities(dim, part).min() for part in parts) < 10 * POOR:
            gmsh.model.mesh.optimize("HighOrderElastic")
        for part in parts:
            if qualities(dim, part).min() <= 0:
                raise InputError(
                    f"curved elements of '{part.name}' fold over; give this body a smaller size, "
                    "or give order = 1."
                )
    return size


def _generate(dim: int, parts: Sequence[Part], sleeves: Sequence[Sleeve] = ()) -> None:
    """Mesh with the first algorithm that gives good elements, or else with the best algorithm.

    The first algorithm keeps facets along the axes of ``sleeves``; if this gives flat elements or
    none, the function meshes without these facets.

    Raises:
        InputError: If no algorithm makes elements (with the message of the first), or if all make
            flat elements.
    """
    if sleeves:
        with suppress(InputError):
            if min(_worst_by(dim, parts, ALGORITHMS[0], sleeves).values()) >= FLAT:
                return
    worst: dict[tuple[int, int], dict[str, float]] = {}
    failures = list[InputError]()
    for algorithm in ALGORITHMS:
        try:
            worst[algorithm] = _worst_by(dim, parts, algorithm)
        except InputError as error:
            failures.append(error)
            continue
        if min(worst[algorithm].values()) >= FLAT:
            return
    if not worst:
        raise failures[0]
    best = max(worst, key=lambda one: min(worst[one].values()))
    flat = [name for name, quality in worst[best].items() if quality < NO_VOLUME]
    if flat:
        raise InputError(
            f"{' and '.join(map(repr, flat))} cannot be meshed: each of the {len(ALGORITHMS)} "
            "meshing algorithms makes flat elements; remove tiny edges and faces in the CAD "
            "system, or give another size."
        )
    if best != ALGORITHMS[-1]:
        _worst_by(dim, parts, best)


def _worst_by(
    dim: int, parts: Sequence[Part], algorithm: tuple[int, int], sleeves: Sequence[Sleeve] = ()
) -> dict[str, float]:
    """Mesh with an algorithm, and return the quality of the worst element of each body."""
    if any(
        elements(dim, part).size for part in parts
    ):  # surface meshes that a script has read must not be cleared
        gmsh.model.mesh.clear()
    for name, number in zip(("Algorithm", "Algorithm3D"), algorithm, strict=True):
        gmsh.option.setNumber(f"Mesh.{name}", number)
    # an exception would leave gmsh in a locked state
    gmsh.option.setNumber("General.AbortOnError", 1)
    if sleeves:
        mesh_sleeves(sleeves)
        gmsh.option.setNumber("Mesh.MeshOnlyEmpty", 1)
    gmsh.model.mesh.generate(dim)
    gmsh.option.setNumber("Mesh.MeshOnlyEmpty", 0)
    gmsh.option.setNumber("General.AbortOnError", 2)
    empty = [
        part
        for part in parts
        if any(not gmsh.model.mesh.getElementTypes(dim, tag).size for tag in part.tags)
    ]
    if empty:
        failed = bool(gmsh.model.mesh.getLastEntityError())
        reason = gmsh.logger.getLastError()
        if not reason or reason.startswith("No elements"):
            reason = (
                "gmsh cannot fill it with elements, usually because faces of a coarse mesh "
                "intersect"
            )
        fault = _fault(dim, parts if failed else empty[:1], reason)
        kinds = [gmsh.model.getType(*entity) for entity in gmsh.model.getEntities()]
        if not any(kind.startswith("Discrete") for kind in kinds):
            # without this call, the next algorithm would keep the meshes of the faces
            gmsh.model.mesh.clear()
        raise InputError(fault)
    return {part.name: float(qualities(dim, part).min()) for part in parts}


def _fault(dim: int, parts: Sequence[Part], error: str) -> str:
    """Return the message for a failed mesh, with the names of the bodies."""
    names = set()
    for part in parts:
        faces = {int(f) for tag in part.tags for f in gmsh.model.getAdjacencies(dim, tag)[1]}
        for entity_dim, tag in gmsh.model.mesh.getLastEntityError():
            if (entity_dim == dim and tag in part.tags) or (entity_dim == dim - 1 and tag in faces):
                names.add(part.name)
    whose = " and ".join(f"'{name}'" for name in sorted(names)) or "the bodies"
    return (
        f"{whose} cannot be meshed: {error.strip().rstrip('.')}; repair the geometry in the CAD "
        "system (tiny or intersecting faces), or give another size."
    )


EXACT = 0.01
"""Largest relative error of a face's area that causes no remark."""


def mesh_with_areas(
    dim: int,
    parts: Sequence[Part],
    options: MeshingOptions,
    sliding: Sequence[int] = (),
    smallest: float = 0.0,
) -> float:
    """Mesh the bodies with accurate areas of faces, and return the largest edge length.

    Facets of cylinders among the ``sliding`` faces, at which bodies may slide on each other, lie
    along the axis. A script may give the ``smallest`` edge length.

    If no size is given, the function uses an automatic size with few elements. It then refines arcs
    until the areas are accurate. If a mesh with finer arcs has flat elements, too many elements or
    no elements, the function restores the previous mesh.
    """
    most, sizes = most_elements(dim, len(parts)), Sizes.of(dim, parts, sliding, smallest)
    if options.size is None:
        longest = _usual_size(sizes, options, most)
        options = replace(options, size=longest)
    else:
        longest = generate(sizes, options)
    if options.curvature is not None or sizes.scripted:
        return longest
    before: dict[tuple[int, int], float] = {}
    times = 4  # largest number of times that arcs are refined
    for _ in range(times):
        finer = before | finer_arcs(dim, parts)
        if finer == before:
            break
        try:
            generate(sizes, options, finer)
            fine = _count(dim, parts) <= most
            fine = fine and min(qualities(dim, part).min() for part in parts) >= FLAT
        except InputError:
            fine = False
        if not fine:
            generate(sizes, options, before)
            break
        before = finer
    return longest


def finer_arcs(dim: int, parts: Sequence[Part]) -> dict[tuple[int, int], float]:
    """Return edge lengths for inaccurate arcs and curved faces that give accurate areas."""
    # target for the error, relative to the allowed error; the error is of second order in edge
    # lengths
    enough = 0.95
    found: dict[tuple[int, int], float] = {}
    factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")  # gmsh multiplies all lengths by it
    for face, missed in missed_areas(dim, parts).items():
        if missed <= EXACT:
            continue
        around = gmsh.model.getAdjacencies(dim - 1, face)[1] if dim == 3 else ()
        for entity in [(dim - 1, face), *((1, int(curve)) for curve in around)]:
            if gmsh.model.getType(*entity) in ("Plane", "Line"):
                continue
            finer = math.sqrt(enough * EXACT / missed) * _edge_length(*entity) / factor
            found[entity] = min(finer, found.get(entity, finer))
    return found


def _edge_length(dim: int, tag: int) -> float:
    """Return the mean edge length of the elements on a curve or face."""
    count = sum(len(tags) for tags in gmsh.model.mesh.getElements(dim, tag)[1])
    return regular_edge(dim, mesh_measure(dim, tag) / max(count, 1))


def regular_edge(dim: int, measure: float) -> float:
    """Return the edge length of a regular simplex with a given length, area or volume."""
    powers = {1: 1.0, 2: 4 / math.sqrt(3), 3: 6 * math.sqrt(2)}  # edge ** dim / measure
    return float((powers[dim] * measure) ** (1 / dim))


def _usual_size(sizes: Sizes, options: MeshingOptions, most: int) -> float:
    """Mesh with an automatic size that gives few elements, and return the size.

    Raises:
        InputError: If the bodies cannot be meshed with any automatic size.
    """
    first = sizes.usual
    # Factors on the default size, which are tried in turn if faces intersect on a coarse mesh.
    finer_sizes = (1.0, 0.7, 0.5)
    for share in finer_sizes:
        size = share * first
        try:
            generate(sizes, replace(options, size=size))
        except InputError:
            if share == finer_sizes[-1]:
                raise
            continue
        break
    # Factor between larger sizes, and their number, which are tried if small fillets and holes
    # cause too many elements.
    coarser, times = 1.3, 5
    for _ in range(times if share == 1 else 0):
        if _count(sizes.dim, sizes.parts) <= most:
            break
        try:
            generate(sizes, replace(options, size=coarser * size))
        except InputError:
            generate(sizes, replace(options, size=size))
            break
        size *= coarser
    return size


def _count(dim: int, parts: Sequence[Part]) -> int:
    """Return the number of elements of the mesh."""
    return sum(elements(dim, part).size for part in parts)
