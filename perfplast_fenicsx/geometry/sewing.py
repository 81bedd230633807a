"""Faces of a file without solids, such as most IGES files have, sewn to solids."""

from collections.abc import Sequence
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.shells import closed_shells


def sewn(path: Path, count: int) -> tuple[list[int], list[str]]:
    """Sew the faces of gmsh's current model to solids, and heal them.

    Args:
        path: Path of the file, for messages.
        count: Faces and curves that were read.

    Returns:
        Tags of the solids, and what a user should know of the rest.

    Raises:
        InputError: If the faces enclose nothing, even where gaps are closed.
    """
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    # Gaps between faces that are closed, relative to the size of all faces; the smallest that do.
    gaps = (1e-6, 1e-5, 1e-4, 1e-3)
    if faces:
        whole = _area(faces)
        around = np.array([gmsh.model.getBoundingBox(2, tag) for tag in faces])
        size = float(np.linalg.norm(around[:, 3:].max(axis=0) - around[:, :3].min(axis=0)))
        # Bodies that touch share edges, of which all faces together make no solid.
        for gap in gaps:
            shells = closed_shells(faces, gap * size)
            if len(shells) > 1 and (solids := _filled(shells, gap * size)):
                # Where they meet, their corners are as far apart as their faces were.
                gmsh.option.setNumber("Geometry.ToleranceBoolean", gap * size)
                return _alone(solids), _left_out(whole)
        for gap in gaps:
            if solids := _healed(gap * size):
                return _alone(solids), _left_out(whole)
    raise InputError(
        f"'{path}' has {count} faces and curves, but no solid, and they enclose none, though gaps"
        f" up to {gaps[-1]:g} of their size were closed; sew them to solids in the CAD system."
    )


def _area(faces: Sequence[int]) -> float:
    return float(sum(gmsh.model.occ.getMass(2, face) for face in faces))


def _left_out(whole: float) -> list[str]:
    """That faces were left out, in a sentence, if some were that matter.

    Args:
        whole: Area of all faces of the file.
    """
    matters = 1e-3  # of the area of all faces: sewing moves edges by less
    lost = 1 - _area([tag for _, tag in gmsh.model.getEntities(2)]) / whole
    if lost < matters:
        return []
    return [
        f"faces with {100 * lost:.2g} % of the area of all enclose no solid and are left out; sew"
        " them in the CAD system if they are a body's"
    ]


def _filled(shells: Sequence[Sequence[int]], gap: float) -> list[int]:
    """Return the solids that shells enclose, each sewn by itself; none where one encloses nothing.

    Args:
        shells: Their faces.
        gap: Between faces that is closed.
    """
    occ = gmsh.model.occ
    before = gmsh.option.getNumber("Geometry.Tolerance")
    gmsh.option.setNumber("Geometry.Tolerance", gap)
    try:
        made = [(3, occ.addVolume([occ.addSurfaceLoop(it, sewing=True)])) for it in shells]
        occ.healShapes(made, gap, True, True, True, True, True)
        # surfaces of revolution that are cut along each other cannot be meshed as such
        occ.convertToNURBS(made)
    except Exception:  # gmsh raises nothing more specific; a larger gap may do
        occ.remove(occ.getEntities(3))
    finally:
        gmsh.option.setNumber("Geometry.Tolerance", before)
    occ.synchronize()
    return _solids(len(shells))


def _healed(gap: float) -> list[int]:
    """Return the solids of all faces, sewn together and healed; none where they enclose nothing.

    Args:
        gap: Between faces that is closed.
    """
    try:
        gmsh.model.occ.healShapes([], gap, True, True, True, True, True)
        gmsh.model.occ.synchronize()
    except Exception:  # gmsh raises nothing more specific; a larger gap may do
        return []
    return _solids(1)


def _solids(least: int) -> list[int]:
    """Return those of gmsh's model, where there are so many and each has a volume."""
    solids = [tag for _, tag in gmsh.model.getEntities(3)]
    whole = len(solids) >= least and all(gmsh.model.occ.getMass(3, tag) > 0 for tag in solids)
    return solids if whole else []


def _alone(solids: list[int]) -> list[int]:
    """Return the solids, without faces and curves that belong to none."""
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
