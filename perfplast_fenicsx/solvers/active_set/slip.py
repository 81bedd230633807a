"""Which places of friction stick and which slip: the linearisation of ‖μ‖ ≤ c, μ = c s/‖s‖.

Both conditions are μ = c z/max(c, ‖z‖) with z = μ + k s for any stiffness k > 0. Where ‖z‖ ≤ c, the
place sticks, s = 0. Elsewhere Newton's method for this equation (S. Hüeber, G. Stadler, B. I.
Wohlmuth, SIAM J. Sci. Comput. 30 (2008), 572) asks for

    μ = c ẑ + c k/(‖z‖ − c) (I − ẑẑᵀ) s,   ẑ = z/‖z‖,

a force and springs across it. No direction of the surface is preferred.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms, shrunk

DRAG = 1e-8
"""Springs along the slip, relative to the bodies' stiffness, that resist changes of it in a step:
they hold a body that slips everywhere, and vanish with the last step."""


@dataclass(frozen=True)
class Slip:
    """Where and whither surfaces slip; of the places of friction hosted by this rank.

    Attributes:
        sticks: Places whose jump is zero, shape (num_places,).
        along: ẑ at the others, zero where they stick, shape (num_places, gdim − 1).
        across: Stiffness of the springs across ẑ (force/length), shape (num_places,).
    """

    sticks: npt.NDArray[np.bool_]
    along: Floats
    across: Floats


def stuck(shape: tuple[int, ...]) -> Slip:
    """Nothing slips.

    Args:
        shape: Shape of the jumps.
    """
    return Slip(np.ones(shape[0], dtype=np.bool_), np.zeros(shape), np.zeros(shape[0]))


def slipping(jumps: Floats, bound: Floats, slips: npt.NDArray[np.bool_]) -> Slip:
    """Linearise at jumps.

    Args:
        jumps: s, shape (num_places, gdim − 1).
        bound: c, shape (num_places,).
        slips: Where they are not zero; what has no friction slips too.
    """
    sizes = norms(jumps)
    along = np.divide(jumps, sizes[:, None], out=np.zeros_like(jumps), where=slips[:, None])
    across = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
    return Slip(~slips & (bound > 0), along, across)


def judge(slip: Slip, bound: Floats, stiffness: Floats, forces: Floats, jumps: Floats) -> Slip:
    """Linearise at forces and jumps, which the last linearisation has led to.

    What slips the wrong way sticks first: were it to slip the other way at once, a body that slips
    everywhere would be thrown back and forth.

    Args:
        slip: The last linearisation.
        bound: c, shape (num_places,).
        stiffness: k > 0, shape (num_places,).
        forces: μ, shape (num_places, gdim − 1).
        jumps: s, same shape.
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
    """‖μ − c z/max(c, ‖z‖)‖, zero where the law of friction holds, shape (num_places,)."""
    return norms(forces - shrunk(forces + stiffness[:, None] * jumps, bound))


def springs(slip: Slip, stiffness: Floats, drag: float = DRAG) -> Floats:
    """Stiffness of each place, shape (num_places, gdim − 1, gdim − 1), zero where it sticks."""
    along = np.einsum("ni,nj->nij", slip.along, slip.along)
    every = np.eye(along.shape[1])
    dragged = np.where(slip.sticks, 0.0, drag * stiffness)
    return slip.across[:, None, None] * (every - along) + dragged[:, None, None] * every


def forces_of(slip: Slip, bound: Floats, jumps: Floats) -> Floats:
    """Forces μ where surfaces slip by these jumps, as linearised, shape of the jumps."""
    off = jumps - np.einsum("ni,ni->n", slip.along, jumps)[:, None] * slip.along
    slips = ~slip.sticks
    finite = np.where(slips, bound, 0.0)
    return finite[:, None] * slip.along + slip.across[:, None] * off
