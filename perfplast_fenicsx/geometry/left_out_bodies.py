"""Leave out bodies of a geometry file by their names."""

from collections.abc import Sequence

import gmsh

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.parts import Part


def without(dim: int, parts: Sequence[Part], names: Sequence[str]) -> list[Part]:
    """Remove bodies from gmsh's current model.

    Args:
        dim: Dimension of the bodies.
        parts: All bodies.
        names: Names of the bodies to leave out.

    Raises:
        InputError: If a body does not exist, or if none remains.
    """
    known = [part.name for part in parts]
    for name in names:
        if name not in known:
            raise InputError(
                f"without names '{name}', but there is no such body; {nearest(name, known)}"
            )
    kept = [part for part in parts if part.name not in names]
    if not kept:
        raise InputError("without leaves out all bodies; leave one of them in.")
    gone = [(dim, tag) for part in parts if part.name in names for tag in part.tags]
    kernels = (gmsh.model.occ, gmsh.model.geo)
    for kernel in kernels:
        made = set(gmsh.model.occ.getEntities(dim))
        here = [one for one in gone if (one in made) == (kernel is gmsh.model.occ)]
        if here:
            kernel.remove(here, recursive=True)
            kernel.synchronize()
    return kept
