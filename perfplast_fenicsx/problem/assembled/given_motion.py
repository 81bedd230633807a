"""Compute given motions: u_D of supports, obstacles and overlaps, and their effect on contact.

All given motions are linear in the load factor ζ, which multiplies every part that is not constant.
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
        displacement: u_D at supports and 0 elsewhere (length): the constant part and the part times
            ζ, shape (2, num_nodes, gdim), at all local nodes including ghosts.
        gap: Gaps of the pairs hosted by this rank (length), reduced by what u_D closes: the
            constant part and the part times ζ, shape (2, num_pairs).
        slide: Tangential jumps caused by the given motion alone (length), from which slip is
            counted: the constant part and the part times ζ, shape (2, num_places, gdim − 1).
        sources: Given motion of the opposite side for ζ = 1 (length), for each source of contact,
            shape (num_sources, gdim).
        overlap: Given growth of the overlap of each pair for ζ = 1 (length), shape (num_pairs,).
        moves_supports: Whether u_D differs from 0 at any ζ.
        driven: Whether ζ moves anything.
        parts: The motion that each name in the stages controls, for the factor 1; empty without
            stages.
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
        """Return u_D (length), shape (num_nodes, gdim)."""
        return np.asarray(self.displacement[0] + zeta * self.displacement[1])

    def gap_at(self, zeta: float) -> Floats:
        """Return the gaps (length), shape (num_pairs,)."""
        return np.asarray(self.gap[0] + zeta * self.gap[1])

    def slide_at(self, zeta: float) -> Floats:
        """Return the tangential jumps without slip (length), shape (num_places, gdim − 1)."""
        return np.asarray(self.slide[0] + zeta * self.slide[1])

    def moves(
        self, contacts: Sequence[Contact], obstacles: Sequence[Obstacle]
    ) -> list[tuple[str, Floats]]:
        """Return the name of each contact surface and the motion opposite it for ζ = 1 (length)."""
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
    """Return the given motions of supports, obstacles and overlaps together. Collective.

    Args:
        V: Displacement space.
        displacement: See :class:`GivenMotion`.
        constraints: The rows of contact.
        sliding: The rows of tangential jumps along surfaces with friction.
        friction: The friction of the problem.
        sources: The sources of the rows, of which some may move or increase their overlap; by
            default the sources in ``constraints``.

    Raises:
        InputError: If no node overlaps at a source whose overlap is declared to grow.
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
                f"the {sources[i].name} has constant = false, but no node that is free to "
                "move overlaps; give a negative gap, or remove constant."
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
