"""Given motions: u_D of supports, obstacles and overlaps, and their effect on contact.

All is linear in the load factor ζ, which multiplies all that is not constant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, move_of
from perfplast_fenicsx.contact.rows.constraints import Constraints, Source
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class GivenMotion:
    """Displacements and gaps at any ζ.

    Attributes:
        displacement: u_D at supports and 0 elsewhere (length), constant and times ζ, shape
            (2, num_nodes, gdim), of local nodes, ghosts too.
        gap: Gaps of the pairs hosted by this rank (length), less what u_D closes of them, constant
            and times ζ, shape (2, num_pairs).
        slide: Tangential jumps caused by the given motion alone (length), from which slip is
            counted, constant and times ζ, shape (2, num_places, gdim − 1).
        sources: How far what is opposite moves by itself for ζ = 1 (length), for each source of
            contact, shape (num_sources, gdim).
        overlap: How much more the bodies of each pair overlap by themselves for ζ = 1 (length),
            shape (num_pairs,).
        moves_supports: Whether u_D is ever anything but 0.
        driven: Whether ζ moves anything.
        parts: What stages move by a name, for its factor 1; none without stages.
    """

    displacement: Floats
    gap: Floats
    slide: Floats
    sources: Floats
    overlap: Floats
    moves_supports: bool
    driven: bool
    parts: Mapping[str, "GivenMotion"] = field(default_factory=dict)

    def displacement_at(self, zeta: float) -> Floats:
        """u_D (length), shape (num_nodes, gdim)."""
        return np.asarray(self.displacement[0] + zeta * self.displacement[1])

    def gap_at(self, zeta: float) -> Floats:
        """Gaps (length), shape (num_pairs,)."""
        return np.asarray(self.gap[0] + zeta * self.gap[1])

    def slide_at(self, zeta: float) -> Floats:
        """Jumps without slip (length), shape (num_places, gdim − 1)."""
        return np.asarray(self.slide[0] + zeta * self.slide[1])

    def moves(
        self, contacts: Sequence[Contact], obstacles: Sequence[Obstacle]
    ) -> list[tuple[str, Floats]]:
        """Surfaces in contact, and how far what is opposite moves by itself for ζ = 1 (length)."""
        rest = np.zeros(self.displacement.shape[2])
        of_contacts = [(name, rest) for a in contacts for name in (a.primary, a.secondary)]
        of_obstacles = [(one.on, move_of(one, len(rest))) for one in obstacles]
        return of_contacts + of_obstacles


def given_motion(
    V: fem.FunctionSpace,
    displacement: Floats,
    constraints: Constraints,
    sliding: Constraints,
    friction: Friction,
    sources: Sequence[Source] = (),
) -> GivenMotion:
    """Put together what moves. Collective.

    Args:
        V: Displacement space.
        displacement: See :class:`GivenMotion`.
        constraints: The rows of contact.
        sliding: The rows of jumps along surfaces that rub.
        friction: Its places.
        sources: Theirs, of which some may move or overlap more and more; those of the rows by
            default.

    Raises:
        InputError: If nothing overlaps that is to grow.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    sources = sources or constraints.sources
    moves = np.zeros((len(sources), gdim))
    for number, source in enumerate(sources):
        if len(source.move):
            moves[number] = source.move
    of_surface = moves[constraints.surface]
    opened = np.sum(constraints.normal * of_surface, axis=1)
    growing = np.flatnonzero([source.grows for source in sources])
    grow = np.isin(constraints.surface, growing)
    overlap = np.where(grow, np.maximum(-constraints.gap, 0.0), 0.0)
    for i in growing:
        most = float(overlap[constraints.surface == i].max(initial=0))
        if not comm.allreduce(most, MPI.MAX) > 0:
            raise InputError(
                f"the {sources[i].name} has constant = false, but no node that is free to give"
                " way overlaps; give a negative gap, or leave constant out."
            )
    gap = np.stack([constraints.gap + overlap, opened - overlap])
    dragged = np.einsum("nij,nj->ni", friction.direction, of_surface[friction.pair])
    slide = np.stack([np.zeros_like(dragged), dragged])
    moved = [comm.allreduce(bool(part.any()), MPI.LOR) for part in displacement]
    if any(moved):
        u = fem.Function(V)
        for i, part in enumerate(displacement):
            u.x.array[:] = part.ravel()
            gap[i] -= constraints.jumps(u.x.petsc_vec)
            slide[i][friction.index >= 0] -= sliding.jumps(u.x.petsc_vec)
    grows = comm.allreduce(bool(overlap.any()), MPI.LOR)
    driven = moved[1] or grows or bool(moves.any())
    return GivenMotion(displacement, gap, slide, moves, overlap, any(moved), driven)
