"""Mesh sectors of 3D bodies between planes of symmetry, with few well-placed tetrahedra.

Layers are thin at hinges and slip lines. All diagonals end at the edge or corner from which hinges
and slip lines start (:mod:`meshes.kuhn`). Surfaces ``x0``, ``y0``, ``z0`` and ``oblique`` (x = y)
are planes of symmetry; ``z0`` is a plane of antisymmetry if it is the middle of a bent body.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from meshes.kuhn import Kuhn, layers
from meshes.pointed import Body, fan, star
from meshes.tetrahedra import (
    ON_DIAGONAL,
    Place,
    both,
    either,
    in_sector,
    joined,
    on,
    write_tetrahedra,
)
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh import gmsh_session


def write_cantilever_quarter(path: str | Path, order: int = 1) -> None:
    """Write (0, 5)×(0, ½)×(0, ½): volume ``beam``; ``wall`` (x = 0), ``end``, ``y0``, ``z0``."""
    x, cross = [0, 0.25, 0.5, 1, 1.75, 2.75, 3.75, 5], [0, 0.25, 0.5]
    beam = Kuhn((layers(x), layers(cross, "-"), layers(cross)))
    surfaces = {"wall": on(0, 0), "end": on(0, 5), "y0": on(1, 0), "z0": on(2, 0)}
    _write_one(path, "beam", beam.cells(), surfaces, order)


def write_plate_sector(path: str | Path, order: int = 1) -> None:
    """Write 0 < y < x < 5, 0 < z < ½: ``plate``; ``y0``, ``oblique``, ``z0``, ``top``, ``edge``."""
    across = layers([0, 1, 2, 3, 4, 4.5, 4.8, 5])
    plate = Kuhn((across, across, layers([0, 0.5])), in_sector)
    surfaces = {"y0": on(1, 0), "oblique": ON_DIAGONAL, "z0": on(2, 0), "top": on(2, 0.5)}
    _write_one(path, "plate", plate.cells(), surfaces | {"edge": on(0, 5)}, order)


def write_cube_sector(path: str | Path, order: int = 1, parts: int = 4) -> None:
    """Write −½ < y < x < 0, 0 < z < ½: ``cube``; ``x0``, ``oblique``, ``z0``, ``top``."""
    across = layers([i / parts / 2 - 0.5 for i in range(parts + 1)], "-")
    cube = Kuhn((across, across, layers([i / parts / 2 for i in range(parts + 1)])), in_sector)
    surfaces = {"x0": on(0, 0), "oblique": ON_DIAGONAL, "z0": on(2, 0), "top": on(2, 0.5)}
    _write_one(path, "cube", cube.cells(), surfaces, order)


def write_patch_sector(path: str | Path, order: int = 1) -> None:
    """Write 0 < y < x < 3, −2 < z < 0: ``ground``; ``y0``, ``oblique``, ``held``, ``top`` (x < 1).

    Long cells in many directions meet at the corner of ``top``, because the lower bound needs them.
    """
    _write_patch_corner(path, (fan, star, fan, star, star), order)


def write_patch_finest_sector(path: str | Path, order: int = 1) -> None:
    """Write the body of :func:`write_patch_sector` with more directions of long cells.

    The mesh has four times as many cells.
    """
    _write_patch_corner(path, (fan, star, fan, star, star, star), order)


def _write_patch_corner(
    path: str | Path, cuts: Sequence[Callable[[Body, np.ndarray], Body]], order: int
) -> None:
    across = layers([0, 1, 2, 3], "+--")
    body = Kuhn((across, across, layers([-2, -1, 0])), in_sector).cells()
    for more in cuts:
        corner = np.isclose(body[0], [1, 1, 0]).all(axis=1)
        body = more(body, _edge_of_patch(body[0]) if more is fan else np.asarray(corner))
    _write_patch(path, body, order)


def write_patch_edge_sector(path: str | Path, order: int = 1) -> None:
    """Write the body of :func:`write_patch_sector` with short cells along the edge of ``top``.

    Mechanisms are thin along this edge.
    """
    across = layers([0, 0.5, 0.8, 0.9, 1, 1.1, 1.2, 1.5, 3], "++++----")
    body = Kuhn((across, across, layers([-2, -0.4, -0.15, 0])), in_sector).cells()
    _write_patch(path, fan(body, _edge_of_patch(body[0])), order)


def _edge_of_patch(points: Floats) -> np.ndarray:
    x, y, z = points.T
    return np.isclose(x, 1) & (y <= 1) & (z == 0)


def _write_patch(path: str | Path, body: Body, order: int) -> None:
    surfaces = {"y0": on(1, 0), "oblique": ON_DIAGONAL, "held": either(on(0, 3), on(2, -2))}
    surfaces["top"] = both(on(2, 0), lambda facets: facets[:, :, 0].max(axis=1) < 1 + 1e-9)
    _write_one(path, "ground", body, surfaces, order)


def write_bracket_half(path: str | Path, order: int = 1) -> None:
    """Write an L of a post (0, 1)×(0, 4) and an arm (0, 4)×(3, 4) in (x, z), 0 < y < 1.

    Volume ``bracket``; surfaces ``foot`` (z = 0), ``end`` (x = 4) and ``y0``.
    """
    places = layers([0, 0.5, 1, 1.5, 2.5, 4], "++-++"), layers([0, 1])
    upright = layers([0, 1, 2, 2.5, 3, 3.5, 4], "++++-+")
    bracket = Kuhn((*places, upright), lambda middles: (middles[:, 0] < 1) | (middles[:, 2] > 3))
    surfaces = {"foot": on(2, 0), "end": on(0, 4), "y0": on(1, 0)}
    _write_one(path, "bracket", bracket.cells(), surfaces, order)


def write_blocks_half(path: str | Path, order: int = 1) -> None:
    """Write half of :func:`~perfplast_fenicsx.mesh.sample_meshes.two_blocks`, 0 < y < ½.

    The surface ``y0`` belongs to both bodies.
    """
    x, y = layers([0, 0.25, 0.5, 1, 1.5, 2, 3], "-"), layers([0, 0.5])
    heights = {"lower": [0, 0.5, 1], "upper": [1, 1.5, 2]}
    bodies = {name: Kuhn((x, y, layers(z, "-+"))).cells() for name, z in heights.items()}
    loaded = both(on(2, 2), lambda facets: facets[:, :, 0].min(axis=1) > 1.5 - 1e-9)
    surfaces = {
        "left": (tuple(bodies), on(0, 0)),
        "y0": (tuple(bodies), on(1, 0)),
        "top": (("upper",), loaded),
        "upper_bottom": (("upper",), on(2, 1)),
        "lower_top": (("lower",), on(2, 1)),
    }
    with gmsh_session():
        write_tetrahedra(path, *joined(bodies), surfaces, order)


def write_prop_half(path: str | Path, order: int = 1) -> None:
    """Write half of the tutorial's drawing ``docs/prop.step``, 0 < y < 25, with its names.

    Volumes ``beam`` and ``block``; surfaces ``beam_x_low``, ``beam_z_high``, ``block_z_low``,
    ``y0`` of both, and the contact surfaces ``beam_joint`` and ``block_joint``.
    """
    left, right, y = [0, 12, 25, 50, 100, 150, 200, 250], [300, 325, 400], layers([0, 25])
    beam = Kuhn((layers([*left, *right], "-"), y, layers([100, 125, 150])))
    block = Kuhn((layers(right, "-"), y, layers([0, 75, 100], "-")))
    bodies = {"beam": beam.cells(), "block": block.cells()}
    joint = both(on(2, 100), lambda facets: facets[:, :, 0].min(axis=1) > 300 - 1e-6)
    surfaces = {
        "beam_x_low": (("beam",), on(0, 0)),
        "beam_z_high": (("beam",), on(2, 150)),
        "block_z_low": (("block",), on(2, 0)),
        "y0": (tuple(bodies), on(1, 0)),
        "beam_joint": (("beam",), joint),
        "block_joint": (("block",), on(2, 100)),
    }
    with gmsh_session():
        write_tetrahedra(path, *joined(bodies), surfaces, order)


def write_punch_sector(path: str | Path, order: int = 1) -> None:
    """Write an eighth of the bodies of :mod:`meshes.square_punch`, 0 < y < x < 3, −2 < z < ½.

    Volumes ``ground`` and ``punch``; surfaces ``y0``, ``oblique`` (of both), ``held``, ``top``,
    ``ground_seam`` and ``punch_seam``.
    """
    across, under = layers([0, 0.75, 1, 1.3, 3], "++--"), layers([0, 0.75, 1])
    ground = Kuhn((across, across, layers([-2, -1, -0.4, 0])), in_sector)
    punch = Kuhn((under, under, layers([0, 0.5])), in_sector)
    bodies = {"ground": ground.cells(), "punch": punch.cells()}
    seam = both(on(2, 0), lambda facets: facets[:, :, 0].max(axis=1) < 1 + 1e-9)
    surfaces = {
        "y0": (tuple(bodies), on(1, 0)),
        "oblique": (tuple(bodies), ON_DIAGONAL),
        "held": (("ground",), either(on(0, 3), on(2, -2))),
        "top": (("punch",), on(2, 0.5)),
        "ground_seam": (("ground",), seam),
        "punch_seam": (("punch",), on(2, 0)),
    }
    with gmsh_session():
        write_tetrahedra(path, *joined(bodies), surfaces, order)


def _write_one(
    path: str | Path, name: str, body: Body, surfaces: dict[str, Place], order: int
) -> None:
    with gmsh_session():
        x, cells = body
        write_tetrahedra(path, x, {name: cells}, surfaces, order)
