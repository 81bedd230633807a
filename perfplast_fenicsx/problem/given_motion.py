"""What is moved by a given way: u_D of supports, and what that and moving obstacles leave of gaps.

Both are linear in the load factor ζ, which multiplies all that is not constant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.constraints import Constraints
from perfplast_fenicsx.contact.obstacles import Obstacle, move_of


@dataclass(frozen=True)
class GivenMotion:
    """Displacements and gaps at any ζ.

    Attributes:
        displacement: u_D at supports and 0 elsewhere (length), constant and times ζ, shape
            (2, num_nodes, gdim), of local nodes, ghosts too.
        gap: Gaps of the pairs hosted by this rank (length), less what u_D closes of them, constant
            and times ζ, shape (2, num_pairs).
        obstacles: How far each obstacle moves for ζ = 1 (length), shape (num_obstacles, gdim).
        moves_supports: Whether u_D is ever anything but 0.
        driven: Whether ζ moves anything.
        parts: What stages move by a name, for its factor 1; none without stages.
    """

    displacement: Floats
    gap: Floats
    obstacles: Floats
    moves_supports: bool
    driven: bool
    parts: Mapping[str, "GivenMotion"] = field(default_factory=dict)

    def displacement_at(self, zeta: float) -> Floats:
        """u_D (length), shape (num_nodes, gdim)."""
        return np.asarray(self.displacement[0] + zeta * self.displacement[1])

    def gap_at(self, zeta: float) -> Floats:
        """Gaps (length), shape (num_pairs,)."""
        return np.asarray(self.gap[0] + zeta * self.gap[1])


def given_motion(
    V: fem.FunctionSpace,
    displacement: Floats,
    constraints: Constraints,
    num_contacts: int,
    obstacles: Sequence[Obstacle],
) -> GivenMotion:
    """Put together what moves. Collective.

    Args:
        V: Displacement space.
        displacement: See :class:`GivenMotion`.
        constraints: The rows of contacts and, behind them, of obstacles.
        num_contacts: How many contacts there are.
        obstacles: What surfaces cannot penetrate.

    Raises:
        InputError: If a move does not fit the mesh.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    moves = np.array([move_of(obstacle, gdim) for obstacle in obstacles]).reshape(-1, gdim)
    opened = np.zeros(len(constraints.gap))
    if moves.any():
        of_surface = np.concatenate([np.zeros((num_contacts, gdim)), moves])
        opened += np.sum(constraints.normal * of_surface[constraints.surface], axis=1)
    gap = np.stack([constraints.gap, opened])
    moved = [comm.allreduce(bool(part.any()), MPI.LOR) for part in displacement]
    if any(moved):
        u = fem.Function(V)
        for i, part in enumerate(displacement):
            u.x.array[:] = part.ravel()
            gap[i] -= constraints.jumps(u.x.petsc_vec)
    return GivenMotion(displacement, gap, moves, any(moved), moved[1] or bool(moves.any()))
