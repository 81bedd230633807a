"""Linearise the friction law ‖μ‖ ≤ c, μ = c s/‖s‖: which places stick and which slip.

Both conditions are equivalent to μ = c z/max(c, ‖z‖) with z = μ + k s for any stiffness k > 0.
Where ‖z‖ ≤ c, the place sticks, s = 0. Elsewhere Newton's method for this equation (S. Hüeber, G.
Stadler, B. I. Wohlmuth, SIAM J. Sci. Comput. 30 (2008), 572) requires

    μ = c ẑ + c k/(‖z‖ − c) (I − ẑẑᵀ) s,   ẑ = z/‖z‖,

a force and springs perpendicular to it. No tangential direction is preferred.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms, shrunk

DRAG = 1e-8
"""Stiffness of springs along the slip, relative to the bodies' stiffness, that resist changes of
the slip in a step. They hold a body that slips everywhere, and vanish with the last step."""


@dataclass(frozen=True)
class Slip:
    """Which places hosted by this rank slip, and in which direction.

    Attributes:
        sticks: Places whose jump is zero, shape (num_places,).
        along: ẑ at slipping places, zero at sticking ones, shape (num_places, gdim − 1).
        across: Stiffness of the springs perpendicular to ẑ (force/length), shape (num_places,).
    """

    sticks: npt.NDArray[np.bool_]
    along: Floats
    across: Floats


def stuck(shape: tuple[int, ...]) -> Slip:
    """Return the linearisation without slip.

    Args:
        shape: Shape of the jumps.
    """
    return Slip(np.ones(shape[0], dtype=np.bool_), np.zeros(shape), np.zeros(shape[0]))


def slipping(jumps: Floats, bound: Floats, slips: npt.NDArray[np.bool_]) -> Slip:
    """Return the linearisation at jumps.

    Args:
        jumps: Jumps s, shape (num_places, gdim − 1).
        bound: Bounds c, shape (num_places,).
        slips: Which places with nonzero jumps slip; places without friction slip too.
    """
    sizes = norms(jumps)
    along = np.divide(jumps, sizes[:, None], out=np.zeros_like(jumps), where=slips[:, None])
    across = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
    return Slip(~slips & (bound > 0), along, across)


def judge(slip: Slip, bound: Floats, stiffness: Floats, forces: Floats, jumps: Floats) -> Slip:
    """Return the linearisation at forces and jumps that the last linearisation gave.

    A place that slips in the wrong direction sticks first. Otherwise a body that slips everywhere
    would oscillate.

    Args:
        slip: The last linearisation.
        bound: Bounds c, shape (num_places,).
        stiffness: Stiffness k > 0, shape (num_places,).
        forces: Forces μ, shape (num_places, gdim − 1).
        jumps: Jumps s, same shape.
    """
    z = forces + stiffness[:, None] * jumps
    sizes = norms(z)
    turned = ~slip.sticks & (np.einsum("ni,ni->n", slip.along, jumps) <= 0)
    sticks = ((sizes <= bound) | turned) & (bound > 0)
    slips = ~sticks & (sizes > 0)
    along = np.zeros_like(z)
    np.divide(z, sizes[:, None], out=along, where=slips[:, None])
    across = np.zeros_like(bound)
    beyond = slips & (sizes > bound)
    np.divide(bound * stiffness, sizes - bound, out=across, where=beyond)
    return Slip(sticks, along, across)


def distance(bound: Floats, stiffness: Floats, forces: Floats, jumps: Floats) -> Floats:
    """Return ‖μ − c z/max(c, ‖z‖)‖, zero where the friction law holds, shape (num_places,)."""
    return norms(forces - shrunk(forces + stiffness[:, None] * jumps, bound))


def springs(slip: Slip, stiffness: Floats, drag: float = DRAG) -> Floats:
    """Return spring stiffnesses, shape (num_places, gdim − 1, gdim − 1), 0 at sticking places."""
    along = np.einsum("ni,nj->nij", slip.along, slip.along)
    every = np.eye(along.shape[1])
    dragged = np.where(slip.sticks, 0.0, drag * stiffness)
    return slip.across[:, None, None] * (every - along) + dragged[:, None, None] * every


def forces_of(slip: Slip, bound: Floats, jumps: Floats) -> Floats:
    """Return forces μ of slipping places at these jumps, as linearised, same shape."""
    off = jumps - np.einsum("ni,ni->n", slip.along, jumps)[:, None] * slip.along
    slips = ~slip.sticks
    finite = np.where(slips, bound, 0.0)
    return finite[:, None] * slip.along + slip.across[:, None] * off
