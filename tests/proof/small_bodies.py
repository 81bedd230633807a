"""Halves of proofs of squares, small enough to write the truth by hand."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from tests.proof.forging import Arrays, Halves
from tests.proof.test_balance import row_of_cubes

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
BOTTOM, RIGHT, TOP, LEFT = range(4)
"""Index of each facet of a square."""


def squares(*corners: Sequence[float]) -> Arrays:
    """Return unit squares of two cells with shear strength 1/√2, unloaded, one for each corner.

    Each facet has the surface 1 + its index.
    """
    count = len(corners)
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    facets = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    deviator = np.array([[0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    return {
        "vertices": np.concatenate([SQUARE + np.array(corner) for corner in corners]),
        "cells": np.concatenate([cells + 4 * k for k in range(count)]),
        "cone": np.zeros(2 * count, dtype=int),
        "cone_bound": np.ones(1),
        "cone_slope": np.zeros((1, 3)),
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((2 * count, 2)),
        "facets": np.concatenate([facets + 4 * k for k in range(count)]),
        "surface": 1 + np.arange(4 * count),
        "held": np.zeros((4 * count, 2), dtype=np.uint8),
        "traction": np.zeros((4 * count, 2, 2)),
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 2)),
        "bound": np.array(1.0),
    }


def with_stress(them: Arrays, *stresses: Sequence[Sequence[float]]) -> Arrays:
    """Return a lower half with one constant stress in each square."""
    stress = np.repeat(np.array(stresses, dtype=float), 2, axis=0)[:, None]
    return them | {"stress": np.tile(stress, (1, 3, 1, 1))}


def with_velocity(them: Arrays, of: Callable[..., Sequence[float]], bound: float) -> Arrays:
    """Return an upper half with a velocity that is linear in each cell."""
    vertices, edges = them["vertices"], dict[tuple[int, ...], int]()
    nodes = []
    for cell in them["cells"].tolist():
        ends = [tuple(sorted(edge)) for edge in combinations(cell, 2)]
        nodes.append([*cell, *(len(vertices) + edges.setdefault(e, len(edges)) for e in ends)])
    places = np.concatenate([vertices, vertices[np.array(list(edges))].mean(axis=1)])
    velocity = np.array([of(*place) for place in places], dtype=float)
    return them | {"nodes": np.array(nodes), "velocity": velocity, "bound": np.array(bound)}


def plate_with_free_load(x: float, force: Sequence[float]) -> Arrays:
    """Return an upper half of a square at x under a plate, whose load a free load can cancel."""
    them = squares((x, 0.0))
    them["held"][BOTTOM] = 1
    them["cone_matrix"] = np.eye(3)[None]
    them |= {
        "rigid": np.array([1 + TOP]),
        "rigid_held": np.array([[1, 0]], dtype=np.uint8),
        "rigid_force": np.array([[0.0, 1.0]]),
        "rigid_moment": np.array([[x + 0.5]]),
        "any_rigid_force": np.array([force]),
        "any_rigid_moment": np.array([[x + 0.5]]),
    }
    return with_velocity(them, lambda _, y: (0.0, y), 1.00001)


def pulled_square(guide: Sequence[float]) -> Arrays:
    """Return a pulled square, and a loaded elastic square with two guides and held components x."""
    them = squares((0.0, 0.0), (3.0, 0.0))
    them["cone"][2:] = -1
    them["held"][BOTTOM, 1] = them["held"][LEFT, 0] = 1
    sides = [4 + RIGHT, 4 + LEFT]
    them["held"][sides, 0] = 1
    them["traction"][[TOP, 4 + TOP], :, 1] = 1.0
    them["guided"] = np.zeros((8, 2))
    them["guided"][sides] = np.array(guide) / np.linalg.norm(guide)
    return them


def adhering_square() -> Arrays:
    """Return a lower half of a square that is pulled, and adheres to one that floats along x."""
    them = squares((0.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
    them["cone"] = np.array([-1, -1, 0, 0, -1, -1])
    them["cone_bound"] = np.array([10.0])
    them["held"][BOTTOM, 1] = them["held"][8 + TOP, 1] = 1
    them["held"][4 + LEFT] = 1
    them["traction"][RIGHT, :, 0] = 1.0
    them |= {
        "contacts": np.array([[1 + TOP, 9 + BOTTOM], [1 + LEFT, 5 + RIGHT]]),
        "contact_adhesion": np.array([1.0, 0.0]),
        "contact_friction": np.zeros(2),
        "bound": np.array(0.9),
    }
    return with_stress(
        them, [[-0.1, -1.0], [-1.0, 0.0]], [[-0.1, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]
    )


def cut_square() -> Arrays:
    """Return a lower half of a square with a tensile strength of 0.25, and cell_strength 4."""
    them = squares((0.0, 0.0))
    them["held"][BOTTOM, 1] = them["held"][LEFT, 0] = 1
    them["traction"][TOP, :, 1] = 1.0
    them |= {
        "cone_matrix": np.zeros((1, 3, 3)),
        "cone_sine": np.zeros(1),
        "cone_tension": np.array([0.25]),
        "cell_strength": np.full((2, 3), 4.0),
        "bound": np.array(0.99),
    }
    return with_stress(them, [[0.0, 0.0], [0.0, 0.99]])


def obstacle_without_normal() -> Arrays:
    """Return a lower half of a square that an obstacle with normal 0 seems to hold."""
    them = squares((0.0, 0.0)) | {"obstacles": np.array([1 + RIGHT])}
    them["held"][BOTTOM] = 1
    them["traction"][TOP, :, 1] = 1.0
    them["obstacle_normals"] = np.zeros((1, 2))
    return with_stress(them, [[0.0, 0.0], [0.0, 1.0]])


def unloaded_square(**others: np.ndarray) -> Arrays:
    """Return a lower half of a loaded square with zero stress, and with other arrays."""
    them = squares((0.0, 0.0))
    them["held"][BOTTOM] = 1
    them["traction"][TOP, :, 1] = 1.0
    zero = with_stress(them, [[0.0, 0.0], [0.0, 0.0]])
    return zero | {"bound": np.array(0.0)} | others


def nearly_free_square() -> Arrays:
    """Return a lower half whose strength a tension of 1e14 multiplies: q·ν is not quite zero."""
    return unloaded_square(cone_slope=np.array([[-3.4e-14, -3.4e-14, 0.5]]))


def steep_square() -> Arrays:
    """Return a lower half whose cone is so steep that rounding changes its dissipation."""
    matrix, slope = np.diag([1.0, 1.0, 1e-5]), [0.0, 0.0, 1e-5 * (1 - 5e-8)]
    return unloaded_square(cone_matrix=matrix[None], cone_slope=np.array([slope]))


def strong_corners() -> Arrays:
    """Return a lower half whose strengths at two vertices are lost in the rounding of the third."""
    return unloaded_square(cell_strength=np.array([[1e18, 1.0, 1.0]] * 2))


def kept_twice() -> Arrays:
    """Return a lower half with a flag that is 2."""
    return unloaded_square(strength_factor=np.array(2.0), cell_kept=np.full(2, 2))


def half_revolved() -> Arrays:
    """Return a lower half with half a flag for an axis of revolution."""
    stress = np.zeros((2, 6, 2, 2))
    return unloaded_square(revolved=np.array(0.5), stress=stress) | {
        "vertices": squares((1.0, 0.0))["vertices"],
        **{"cone_slope": np.zeros((1, 4)), "cone_matrix": np.eye(4)[None]},
    }


ROUNDED = (nearly_free_square, steep_square, strong_corners, kept_twice, half_revolved)
"""Lower halves in which numbers are nearly, but not exactly, what the checkers support."""


def guided_plate() -> Arrays:
    """Return a lower half of a square under a plate that a guide holds against its load."""
    them = squares((0.0, 0.0))
    them["held"][BOTTOM] = 1
    them["guided"] = np.zeros((4, 2))
    them["guided"][TOP, 1] = 1.0
    them |= {
        "rigid": np.array([1 + TOP]),
        "rigid_held": np.zeros((1, 2), dtype=np.uint8),
        "rigid_force": np.array([[0.0, 1.0]]),
        "rigid_moment": np.array([[0.5]]),
        "bound": np.array(0.05),
    }
    return with_stress(them, [[0.0, 0.0], [0.0, 0.0]])


def columns_under_a_plate(held: Sequence[int]) -> Arrays:
    """Return a lower half of two columns on rollers under a plate, with rounding in the stress."""
    them = squares((0.0, 0.0), (2.0, 0.0))
    them["held"][[BOTTOM, 4 + BOTTOM], 1] = 1
    them["surface"][4 + TOP] = 1 + TOP
    them |= {
        "rigid": np.array([1 + TOP]),
        "rigid_held": np.array([held], dtype=np.uint8),
        "rigid_force": np.array([[0.0, -2.0]]),
        "rigid_moment": np.array([[-3.0]]),
        "bound": np.array((1 - 1e-9) / 3),
        "factor": np.array(1 / 3),
    }
    stress = [[0.0, 0.0], [0.0, -1 / 3]]
    them = with_stress(them, stress, stress)
    noise = 1e-16 * np.random.default_rng(1).standard_normal(them["stress"].shape)
    return them | {"stress": them["stress"] + noise + np.swapaxes(noise, 2, 3)}


def held_square(x: float = 0.0) -> Arrays:
    """Return a square at x that is held at its bottom, with a traction on its top."""
    them = squares((x, 0.0))
    them["held"][BOTTOM] = 1
    them["traction"][TOP, :, 1] = -1.0
    return them


def _free_force(them: Arrays, by: float) -> None:
    them["any_body_force"] = np.array([[0.0, 1.0 + by], [0.0, 1.0]])


def _small_component(them: Arrays, by: float) -> None:
    them["body_force"] = np.array([[1.0 + 1e9 * by, 4e9], [1.0, 4e9]])


def _beside_a_large_load(them: Arrays, by: float) -> None:
    them["surface"][BOTTOM] = 1 + TOP
    them["traction"][BOTTOM] = 1e15
    them["traction"][TOP, :, 1] -= 1e9 * by


def _guide(them: Arrays, by: float) -> None:
    them["guided"] = np.zeros((4, 2))
    them["guided"][RIGHT] = np.array([1.0, by]) / np.hypot(1.0, by)


def _distant_moment(them: Arrays, by: float) -> None:
    them["vertices"] = them["vertices"] + [1e9, 0.0]
    them["traction"][:] = 0.0
    them["rigid"] = np.array([1 + TOP])
    them["rigid_held"] = np.zeros((1, 2), dtype=np.uint8)
    them["rigid_force"] = np.array([[0.0, -1.0]])
    them["rigid_moment"] = np.array([[-1e9 - 0.5 - 5e8 * by]])


UNLIKE: dict[str, Callable[[Arrays, float], None]] = {
    "free force": _free_force,
    "small component": _small_component,
    "beside a large load": _beside_a_large_load,
    "guide": _guide,
    "distant moment": _distant_moment,
}
"""Functions that change a square, by an amount that an attack took for rounding."""


def unlike_halves(kind: str, by: float) -> dict[str, Arrays]:
    """Return two halves of a square at rest, which differ by ``by`` as in :data:`UNLIKE`."""
    both = [held_square(), held_square()]
    for them, amount in zip(both, (0.0, by), strict=True):
        UNLIKE[kind](them, amount)
    still = [[0.0, 0.0], [0.0, 0.0]]
    velocity = with_velocity(both[1], lambda x, y: (0.0, 0.0), 1.0)
    return {"lower": with_stress(both[0], still), "upper": velocity}


def beside_a_fast_body(speed: float) -> Arrays:
    """Return an upper half whose free load equals the load, beside an unloaded body that moves."""
    them = squares((0.0, 0.0), (5.0, 0.0))
    them["cone"][2:] = -1
    them["held"][BOTTOM, 1] = 1
    them["traction"][TOP, :, 1] = -1.0
    them["any_traction"] = them["traction"].copy()
    them["any_traction"][4 + RIGHT, :, 0], them["any_traction"][4 + LEFT, :, 0] = 1.0, -1.0
    return with_velocity(them, lambda x, y: (x, -y) if x < 2 else (speed, 0.0), 10.0)


def beside_a_large_stress(size: float) -> Arrays:
    """Return a lower half of a square at twice its strength, beside an elastic square's stress.

    The numbers are so different in size that a checker may round the stress of the square to twice
    its value, which balances the load.
    """
    load, scale = 2.0**-11, 2.0**40
    them = squares((0.0, 0.0), (5.0, 0.0))
    them["vertices"] = np.append(scale * them["vertices"], [[1e30, 0.0]], axis=0)
    them["cone"][2:] = -1
    them["cone_bound"], them["cone_matrix"] = np.array([0.51 * load]), np.eye(3)[None]
    them["held"][BOTTOM, 1] = them["held"][LEFT, 0] = 1
    them["held"][4:] = 1
    them["traction"][RIGHT, :, 0] = load
    return with_stress(them, [[load / 2, 0.0], [0.0, 0.0]], [[-size, 0.0], [0.0, -size]])


def pushed_square(last: str) -> Arrays:
    """Return an upper half of a square that a plate pushes against another square.

    Args:
        last: What else the pushed side touches: "obstacle", "square" or "nothing".
    """
    them = squares((0.0, 0.0), (1.0, 0.0), (3.0, 0.0))
    them["cone"][4:] = -1
    for square in (0, 4, 8):
        them["held"][[square + BOTTOM, square + TOP], 1] = 1
    them["held"][8 + RIGHT] = 1
    them |= {
        "rigid": np.array([1 + LEFT]),
        "rigid_held": np.array([[0, 1]], dtype=np.uint8),
        "rigid_force": np.array([[1.0, 0.0]]),
        "rigid_moment": np.array([[-0.5]]),
    }
    them["contacts"] = np.array([[1 + RIGHT, 5 + LEFT], [1 + RIGHT, 9 + LEFT]])
    if last != "square":
        them["contacts"] = them["contacts"][:1]
    if last == "obstacle":
        them |= {"obstacles": np.array([1 + RIGHT]), "obstacle_normals": np.array([[1.0, 0.0]])}
    return with_velocity(them, lambda x, _: (max(1 - x, 0.0), 0.0), 1000.0)


def stacked_walls(width: float) -> Arrays:
    """Return an upper half of a wall that falls into a wall below it, divided in another way."""
    one = row_of_cubes(1)
    size, count = np.array([1.0, width, 1.0]), len(one["vertices"])
    below = one["vertices"] * [-1.0, 1.0, 1.0] + [1.0, 0.0, -1.0]
    facets = np.concatenate([one["facets"], one["facets"] + count])
    z = np.concatenate([one["vertices"], below])[facets][..., 2]
    is_below = np.arange(len(facets)) >= len(one["facets"])
    deviator = np.eye(6)
    deviator[:3, :3] -= 1 / 3
    them = {
        "vertices": np.concatenate([one["vertices"], below]) * size,
        "cells": np.concatenate([one["cells"], one["cells"] + count]),
        "cone": np.repeat([0, -1], 6),
        "cone_bound": np.ones(1),
        "cone_slope": np.zeros((1, 6)),
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.repeat([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]], 6, axis=0),
        "facets": facets,
        "surface": np.where((z == 0).all(axis=1), 1 + is_below, 0),
        "held": np.tile((z == -1).all(axis=1)[:, None], 3).astype(np.uint8),
        "traction": np.zeros((len(facets), 3, 3)),
        "contacts": np.array([[1, 2]]),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 3)),
    }
    falling = with_velocity(them, lambda *_: (0.0, 0.0, -1.0), 0.0)
    falling["velocity"][np.unique(falling["nodes"][6:])] = 0.0
    return falling


def hanging_square(width: float) -> Halves:
    """Return halves of two elastic squares above one another, connected at a corner of the lower.

    The upper square is held at its top, and the lower one is pulled. A third square, without loads,
    only dissipates power.

    Args:
        width: Length of the facet that both squares share in the lower half.
    """
    above = squares((0.0, 0.0), (0.0, -1.0), (5.0, 0.0))
    above["cone"][:4] = -1
    above["cone_matrix"] = np.eye(3)[None]
    above["surface"][:] = 0
    above["held"][TOP] = 1
    above["traction"][4 + BOTTOM, :, 1] = -1.0
    below = dict(above)
    place = [[0, 0], [1, 0], [1, 1], [0, 1], [0, -1], [1, -1], [1 - width, 0], [0, 0]]
    below["vertices"] = np.concatenate([np.array(place, dtype=float), above["vertices"][8:]])
    below["cells"] = np.concatenate(
        [[[3, 0, 6], [3, 6, 2], [6, 1, 2], [4, 7, 6], [4, 6, 5], [6, 1, 5]], above["cells"][4:]]
    )
    below["facets"] = np.concatenate(
        [[[0, 6], [1, 2], [2, 3], [3, 0], [4, 5], [5, 1], [6, 7], [7, 4]], above["facets"][8:]]
    )
    below["cone"] = np.array([-1] * 6 + [0] * 2)
    below["body_force"] = np.zeros((8, 2))
    above = with_velocity(above, lambda x, _: (max(1.2 * (x - 5), 0.0), 0.0), 1.21)
    above["velocity"][np.unique(above["nodes"][2:4])] = [0.0, -1.0]
    return {"lower": below | {"stress": np.zeros((8, 3, 2, 2))}, "upper": above}


def thin_triangles(low: float, high: float, away: float) -> Halves:
    """Return halves of a pulled triangle of length 1000, with different heights.

    Args:
        low: Height in the upper half.
        high: Height in the lower half.
        away: Distance from the origin.
    """

    def triangle(height: float) -> Arrays:
        them = squares((0.0, 0.0))
        them["vertices"] = away + np.array([[0.0, 0.0], [1000.0, 0.0], [500.0, height]])
        them["facets"] = np.array([[0, 1], [1, 2], [2, 0]])
        for name in ("surface", "traction"):
            them[name] = them[name][:3]
        for name in ("cells", "cone", "body_force"):
            them[name] = them[name][:1]
        them["cone_matrix"] = np.diag([1.0, 1e5, 1e5])[None]
        them["held"] = np.array([[0, 1], [0, 0], [1, 0]], dtype=np.uint8)
        them["traction"][1, :, 0] = 1.0
        return them

    stress = np.zeros((1, 3, 2, 2))
    stress[..., 0, 0] = 0.5
    share = 0.5 * high / np.hypot(500.0, high)
    lower = {"stress": stress, "factor": np.array(share), "bound": np.array(share * (1 - 1e-9))}

    def of(x: float, y: float) -> Sequence[float]:
        return (x - away - 500.0 / low * (y - away), 0.0)

    return {
        "lower": triangle(high) | lower,
        "upper": with_velocity(triangle(low), of, 1.01 * low / 500.0),
    }


def _confined(them: Arrays) -> Arrays:
    """Hold both sides of all squares, and the bottom of the first one."""
    for square in range(0, len(them["facets"]), 4):
        them["held"][[square + RIGHT, square + LEFT], 0] = 1
    them["held"][BOTTOM] = 1
    return them


def loaded_contact() -> Arrays:
    """Return an upper half of a confined square, which a traction in its contact compresses.

    The flow that undoes the compression moves the traction back.
    """
    them = _confined(squares((0.0, 0.0), (0.0, 1.0)))
    them["contacts"] = np.array([[1 + TOP, 5 + BOTTOM]])
    them["traction"][TOP, :, 1] = -1.0
    them = with_velocity(them, lambda x, y: (0.0, -y), 1000.0)
    them["velocity"][them["nodes"][2:].ravel()] = 0.0
    return them


def above_ground_at_rest() -> Arrays:
    """Return an upper half of a confined square under a plate, which is compressed above ground.

    The ground below dilates, so that the volume change may flow into it only if it dilates enough.
    """
    them = _confined(squares((0.0, 0.0), (0.0, 1.0)))
    them["cells"][2:] = np.array([3, 2, 6, 7])[them["cells"][2:] - 4]
    them["facets"][4:] = np.array([3, 2, 6, 7])[them["facets"][4:] - 4]
    outer = np.delete(np.arange(8), [TOP, 4 + BOTTOM])
    them |= {name: them[name][outer] for name in ("facets", "surface", "held", "traction")}
    them["cone"] = np.array([1, 1, 0, 0])
    slope = np.sin(np.radians(30)) / np.sqrt(2) * np.array([1.0, 1.0, 0.0])
    them |= {
        "cone_bound": np.ones(2),
        "cone_slope": np.array([np.zeros(3), slope]),
        "cone_matrix": np.tile(them["cone_matrix"], (2, 1, 1)),
        "cone_sine": np.full(2, np.nan),
        "rigid": np.array([5 + TOP]),
        "rigid_held": np.array([[1, 0]], dtype=np.uint8),
        "rigid_force": np.array([[0.0, -1.0]]),
        "rigid_moment": np.zeros((1, 1)),
    }
    return with_velocity(them, lambda x, y: (0.0, min(1.0 - y, 0.0)), 1000.0)


def pushed_up() -> Arrays:
    """Return an upper half of a confined square that a plate pushes up against a free pressure.

    Only the flow that undoes the compression moves the free pressure.
    """
    them = _confined(squares((0.0, 0.0)))
    them["held"][BOTTOM] = 0
    them |= {
        "any_traction": np.zeros((4, 2, 2)),
        "rigid": np.array([1 + BOTTOM]),
        "rigid_held": np.array([[1, 0]], dtype=np.uint8),
        "rigid_force": np.array([[0.0, 1.0]]),
        "rigid_moment": np.zeros((1, 1)),
    }
    them["any_traction"][TOP, :, 1] = -1.0
    return with_velocity(them, lambda x, y: (0.0, 1.0 - y), 1000.0)


def grown_by_pores() -> Arrays:
    """Return an upper half of a square that a pore pressure stretches, as a free traction does.

    A tiny traction does no work, so that it does not tell how fast the loads move.
    """
    them = squares((0.0, 0.0))
    them["held"][BOTTOM, 1] = them["held"][LEFT, 0] = 1
    them["cone_matrix"] = np.eye(3)[None]
    them["pore_pressure"] = np.ones((2, 3))
    them["traction"][RIGHT, :, 0] = 1e-6
    them["any_traction"] = np.zeros((4, 2, 2))
    them["any_traction"][TOP, :, 1] = 1.0
    return with_velocity(them, lambda x, y: (0.0, y), 10.0)


UNDONE: dict[str, tuple[Callable[[], Arrays], tuple[str, str]]] = {
    "loaded contact": (loaded_contact, ("work of the loads", "no work larger than rounding")),
    "above ground": (above_ground_at_rest, ("dilate too little", "dilate too little")),
    "free pressure": (pushed_up, ("work of others", "any factor do work")),
    "pores": (grown_by_pores, ("work of others", "any factor do work")),
}
"""Upper halves in which the flow that undoes volume changes, or pores, do work, with the words of
both checkers."""
