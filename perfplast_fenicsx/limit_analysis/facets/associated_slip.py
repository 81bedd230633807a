"""Give Coulomb's friction slip that follows the normal of its cone, as bounds of the jumps.

Surfaces that slip then separate by w_n ≥ μ‖w_t‖, and only adhesion dissipates. In the plane these
are two bounds, with the jump s = −w_n along the normal,

    a = s + μ w_t ≤ 0,   b = s − μ w_t ≤ 0,

where a and b replace s and w_t as unknowns. In space the cone is no wedge. There the mechanisms of
the search neither slip nor separate. This reduces their number, but the least load of any mechanism
remains an upper bound.
"""

from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.contact.rows.constraints import (
    Entries,
    entries_of,
    matrix_of_entries,
    unknowns,
)
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.limit_analysis.facets.entering import without_entering
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def with_strict_contact(problem: Problem) -> Problem:
    """Return the problem in which mechanisms of upper bounds are sought. Collective.

    They do not penetrate between nodes, where this can be required, and slip as Coulomb's friction
    requires.

    Args:
        problem: The bodies and their contact.
    """
    return with_associated_slip(without_entering(problem) or problem)


def with_associated_slip(problem: Problem) -> Problem:
    """Return a problem whose slip is associated where friction is Coulomb's. Collective.

    Only :func:`discrete_limit.interior_point` accepts this problem, because its unknowns are
    different.

    Args:
        problem: The bodies and their contact; the problem of
            :func:`~perfplast_fenicsx.limit_analysis.facets.entering.without_entering` if friction
            is to apply to the coefficients of slip.

    Returns:
        A problem without Coulomb's friction that shares all but contact with the given one; the
        given problem itself if it has no such friction.
    """
    constraints = problem.constraints
    _, coulomb = constraints.friction_of(np.arange(len(constraints.surface)))
    follows: PairFlags = coulomb > 0
    if not problem.comm.allreduce(bool(follows.any())):
        return problem
    if problem.bodies.gdim == 3:
        return _glued(problem, follows)
    _, of, counts = np.unique(constraints.host, return_inverse=True, return_counts=True)
    rubs = np.bincount(of[follows], minlength=len(counts)) > 0
    return _wedged(_glued(problem, (rubs & (counts > 1))[of]))


def _glued(problem: Problem, rows: PairFlags) -> Problem:
    """Return the problem in which chosen pairs neither separate nor slip. Collective."""
    basis, friction = problem.basis, problem.friction
    places = ~rows[friction.pair]
    held = np.concatenate([basis.index[rows], friction.unknowns(~places)])
    glued = replace(
        basis.holding(np.concatenate([basis.tied, held]), ~rows),
        sliding=np.setdiff1d(basis.sliding, held),
    )
    left = _some(friction, places, np.cumsum(~rows) - 1, problem)
    return variant(problem, basis=glued, friction=left)


def _some(friction: Friction, places: PairFlags, numbers: Ints, problem: Problem) -> Friction:
    """Return chosen places of friction, with new numbers of pairs. Collective."""
    coulomb = friction.coulomb[places]
    return Friction(
        pair=numbers[friction.pair[places]].astype(np.int32),
        index=friction.index[places],
        direction=friction.direction[places],
        area=friction.area[places],
        coulomb=coulomb,
        adhesion=friction.adhesion[places],
        bound=friction.bound[places],
        origin=friction.origin[places],
        count=problem.comm.allreduce(int(places.sum())),
        follows_pressure=bool(problem.comm.allreduce(float(coulomb.sum())) > 0),
    )


def _wedged(problem: Problem) -> Problem:
    """Return the plane problem with the unknowns a and b where friction is Coulomb's.

    Collective.
    """
    basis, friction, comm = problem.basis, problem.friction, problem.comm
    places = np.flatnonzero((friction.coulomb > 0) & (friction.index[:, 0] >= 0))
    normal, along = basis.index[friction.pair[places]], friction.index[places, 0]
    mu = friction.coulomb[places]
    sizes = unknowns(problem.V)
    first = problem.V.dofmap.index_map.local_range[0] * problem.V.dofmap.index_map_bs
    others = np.setdiff1d(np.arange(sizes[0]), np.concatenate([normal, along]))
    same: Entries = (others, others + first, np.ones(len(others)))
    half, one = np.full(len(mu), 0.5), np.ones(len(mu))

    def block(*rows: tuple[Floats, Floats]) -> list[Entries]:
        """Return entries of 2×2 matrices with the given rows for s and w_t."""
        return [
            (row, column + first, value)
            for row, values in zip((normal, along), rows, strict=True)
            for column, value in zip((normal, along), values, strict=True)
        ]

    to_jumps = matrix_of_entries(
        comm, sizes, sizes, [same, *block((half, half), (half / mu, -half / mu))], 2
    )
    from_jumps = matrix_of_entries(comm, sizes, sizes, [same, *block((one, mu), (one, -mu))], 2)
    changed = []
    for product in (basis.T.matMult(to_jumps), from_jumps.matMult(basis.M)):
        changed.append(matrix_of_entries(comm, sizes, sizes, [entries_of(product)], 2))
        product.destroy()
    for matrix in (to_jumps, from_jumps):
        matrix.destroy()
    wedged = replace(
        basis,
        T=changed[0],
        M=changed[1],
        index=np.concatenate([basis.index, along]),
        gap=np.append(basis.gap, np.zeros(len(along))),
        sliding=np.setdiff1d(basis.sliding, along),
    )
    index = np.column_stack([friction.index, np.full(len(friction.index), -1, dtype=np.int32)])
    shares = np.tile([[[1.0, 0.0]]], (len(index), 1, 1))
    index[places] = np.column_stack([normal, along])
    shares[places, 0] = np.column_stack([half / mu, -half / mu])
    slips = replace(
        friction,
        index=index,
        shares=shares,
        coulomb=np.zeros_like(friction.coulomb),
        bound=friction.adhesion,
        follows_pressure=False,
    )
    return variant(problem, basis=wedged, friction=slips)
