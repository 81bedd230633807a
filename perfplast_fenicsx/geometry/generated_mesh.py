"""Mesh bodies with gmsh by one of several algorithms, or report why meshing fails."""

from collections.abc import Mapping, Sequence

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.measured import elements, qualities
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.sizes import Sizes

NO_VOLUME = 1e-10
"""Elements of less quality have no or negative volume; no run accepts them."""

FLAT = 1e-7
"""Elements of less quality are almost flat, and another algorithm is tried."""

ALGORITHMS = ((6, 1), (6, 10), (1, 1))
"""Gmsh's algorithms for faces and for bodies: frontal Delaunay and Delaunay, its defaults; HXT,
which places nodes differently; MeshAdapt, which meshes the most difficult faces."""

POOR = 0.02
"""Elements of less quality cause a remark."""


def generate(
    sizes: Sizes, options: MeshingOptions, finer: Mapping[tuple[int, int], float] | None = None
) -> float:
    """Mesh the bodies, and return the largest edge length.

    Args:
        sizes: Sizes of the bodies.
        options: The given options.
        finer: Edge lengths of curves and faces that need finer elements.

    Raises:
        InputError: Naming the body that cannot be meshed, with a remedy.
    """
    dim, parts = sizes.dim, sizes.parts
    size = sizes.set(options, finer)
    _generate(dim, parts)
    if options.order == 2:
        gmsh.model.mesh.setOrder(2)
        if min(qualities(dim, part).min() for part in parts) < 10 * POOR:
            gmsh.model.mesh.optimize("HighOrderElastic")
        for part in parts:
            if qualities(dim, part).min() <= 0:
                raise InputError(
                    f"curved elements of '{part.name}' fold over; give it a smaller size, or order"
                    " = 1."
                )
    return size


def _generate(dim: int, parts: Sequence[Part]) -> None:
    """Mesh by the first algorithm with good elements, or otherwise by the best of all.

    Raises:
        InputError: From the first algorithm, if none makes elements; or if all make flat ones.
    """
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
            f"{' and '.join(map(repr, flat))} cannot be meshed without flat elements, by "
            f"any of {len(ALGORITHMS)} algorithms; remove tiny edges and faces in the CAD "
            "system, or give another size."
        )
    if best != ALGORITHMS[-1]:
        _worst_by(dim, parts, best)


def _worst_by(dim: int, parts: Sequence[Part], algorithm: tuple[int, int]) -> dict[str, float]:
    """Mesh by an algorithm, and return the quality of the worst element of each body."""
    if any(
        elements(dim, part).size for part in parts
    ):  # only meshes of this program may be cleared
        gmsh.model.mesh.clear()
    for name, number in zip(("Algorithm", "Algorithm3D"), algorithm, strict=True):
        gmsh.option.setNumber(f"Mesh.{name}", number)
    gmsh.option.setNumber("General.AbortOnError", 1)  # an exception would leave gmsh locked
    gmsh.model.mesh.generate(dim)
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
            reason = "gmsh cannot fill it, usually because faces of a coarse mesh intersect"
        fault = _fault(dim, parts if failed else empty[:1], reason)
        kinds = [gmsh.model.getType(*entity) for entity in gmsh.model.getEntities()]
        if not any(kind.startswith("Discrete") for kind in kinds):
            gmsh.model.mesh.clear()  # otherwise the next algorithm would keep the faces' meshes
        raise InputError(fault)
    return {part.name: float(qualities(dim, part).min()) for part in parts}


def _fault(dim: int, parts: Sequence[Part], error: str) -> str:
    """Return the message of a failed mesh, with the bodies' names."""
    names = set()
    for part in parts:
        faces = {int(f) for tag in part.tags for f in gmsh.model.getAdjacencies(dim, tag)[1]}
        for entity_dim, tag in gmsh.model.mesh.getLastEntityError():
            if (entity_dim == dim and tag in part.tags) or (entity_dim == dim - 1 and tag in faces):
                names.add(part.name)
    whose = " and ".join(f"'{name}'" for name in sorted(names)) or "the bodies"
    return (
        f"{whose} cannot be meshed: {error.strip().rstrip('.')}; heal the geometry in the "
        "CAD system (tiny faces, intersecting faces), or give another size."
    )
