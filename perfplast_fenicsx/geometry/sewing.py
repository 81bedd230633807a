"""Sew the faces of a file without solids, such as most IGES files, to solids."""

from collections.abc import Sequence
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.shells import closed_shells


def sewn(path: Path, count: int) -> tuple[list[int], list[str]]:
    """Sew the faces of gmsh's current model to solids, and heal them.

    Args:
        path: Path of the file, which messages name.
        count: Number of faces and curves in the file.

    Returns:
        Tags of the solids, and remarks for the user.

    Raises:
        InputError: If the faces enclose nothing, even with closed gaps.
    """
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    # Gaps between faces that are closed, relative to the size of all faces; the smallest sufficient
    # one is used.
    gaps = (1e-6, 1e-5, 1e-4, 1e-3)
    if faces:
        whole = _area(faces)
        around = np.array([gmsh.model.getBoundingBox(2, tag) for tag in faces])
        size = float(np.linalg.norm(around[:, 3:].max(axis=0) - around[:, :3].min(axis=0)))
        # Touching bodies share edges, so that all faces together do not form a solid.
        for gap in gaps:
            shells = closed_shells(faces, gap * size)
            if len(shells) > 1 and (solids := _filled(shells, gap * size)):
                # Where bodies meet, their corners are as far apart as their faces were.
                gmsh.option.setNumber("Geometry.ToleranceBoolean", gap * size)
                return _alone(solids), _left_out(whole)
        for gap in gaps:
            if solids := _healed(gap * size):
                return _alone(solids), _left_out(whole)
    raise InputError(
        f"'{path}' has {count} faces and curves, but no solid, and they enclose none, even "
        f"with gaps up to {gaps[-1]:g} of their size closed; sew them to solids in the CAD "
        "system."
    )


def _area(faces: Sequence[int]) -> float:
    return float(sum(gmsh.model.occ.getMass(2, face) for face in faces))


def _left_out(whole: float) -> list[str]:
    """Return a sentence on omitted faces, if their area matters.

    Args:
        whole: Area of all faces of the file.
    """
    matters = 1e-3  # relative to the area of all faces: sewing moves edges by less
    lost = 1 - _area([tag for _, tag in gmsh.model.getEntities(2)]) / whole
    if lost < matters:
        return []
    return [
        f"faces with {100 * lost:.2g} % of the total area enclose no solid and are left "
        "out; sew them in the CAD system if they belong to a body"
    ]


def _filled(shells: Sequence[Sequence[int]], gap: float) -> list[int]:
    """Return the solids that shells enclose, each sewn separately; an empty list if one fails.

    Args:
        shells: Faces of the shells.
        gap: Width of gaps between faces that are closed.
    """
    occ = gmsh.model.occ
    before = gmsh.option.getNumber("Geometry.Tolerance")
    gmsh.option.setNumber("Geometry.Tolerance", gap)
    try:
        made = [(3, occ.addVolume([occ.addSurfaceLoop(it, sewing=True)])) for it in shells]
        occ.healShapes(made, gap, True, True, True, True, True)
        # surfaces of revolution that are cut along each other must be converted for meshing
        occ.convertToNURBS(made)
    except Exception:  # gmsh raises no more specific exception; a larger gap may succeed
        occ.remove(occ.getEntities(3))
    finally:
        gmsh.option.setNumber("Geometry.Tolerance", before)
    occ.synchronize()
    return _solids(len(shells))


def _healed(gap: float) -> list[int]:
    """Return the solids of all faces, sewn together and healed; empty if they enclose nothing.

    Args:
        gap: Width of gaps between faces that are closed.
    """
    try:
        gmsh.model.occ.healShapes([], gap, True, True, True, True, True)
        gmsh.model.occ.synchronize()
    except Exception:  # gmsh raises no more specific exception; a larger gap may succeed
        return []
    return _solids(1)


def _solids(least: int) -> list[int]:
    """Return the solids of gmsh's model, if there are enough and each has a volume."""
    solids = [tag for _, tag in gmsh.model.getEntities(3)]
    whole = len(solids) >= least and all(gmsh.model.occ.getMass(3, tag) > 0 for tag in solids)
    return solids if whole else []


def _alone(solids: list[int]) -> list[int]:
    """Return the solids, after removing faces and curves outside them."""
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
