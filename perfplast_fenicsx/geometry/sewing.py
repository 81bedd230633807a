"""Faces of a file without solids, such as most IGES files have, sewn to solids."""

from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError


def sewn(path: Path, count: int) -> list[int]:
    """Sew the faces of gmsh's current model to solids, and heal them.

    Args:
        path: Of the file, for messages.
        count: Faces and curves that were read.

    Returns:
        Tags of the solids.

    Raises:
        InputError: If the faces enclose nothing, even where gaps are closed.
    """
    occ = gmsh.model.occ
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    # Gaps between faces that are closed, relative to the size of all faces; the smallest that do.
    gaps = (1e-6, 1e-5, 1e-4, 1e-3)
    if faces:
        around = np.array([gmsh.model.getBoundingBox(2, tag) for tag in faces])
        size = float(np.linalg.norm(around[:, 3:].max(axis=0) - around[:, :3].min(axis=0)))
        for gap in gaps:
            try:
                occ.healShapes([], gap * size, True, True, True, True, True)
                occ.synchronize()
            except Exception:  # gmsh raises nothing more specific; a larger gap may do
                continue
            solids = [tag for _, tag in gmsh.model.getEntities(3)]
            if solids and all(occ.getMass(3, tag) > 0 for tag in solids):
                return _alone(solids)
    raise InputError(
        f"'{path}' has {count} faces and curves, but no solid, and they enclose none, though gaps"
        f" up to {gaps[-1]:g} of their size were closed; sew them to solids in the CAD system."
    )


def _alone(solids: list[int]) -> list[int]:
    """The solids, without faces and curves that belong to none."""
    occ = gmsh.model.occ
    for dim in (2, 1, 0):
        loose = [
            (dim, tag)
            for _, tag in gmsh.model.getEntities(dim)
            if not len(gmsh.model.getAdjacencies(dim, tag)[0])
        ]
        occ.remove(loose)
        occ.synchronize()
    return solids
