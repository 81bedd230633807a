"""Decide which pairs are closed and which places slip, in the plane: a dense program.

    minimise ½ zᵀSz − gᵀz  over z ≥ 0

If all pairs are closed and all places stick, z are the openings of pairs and the slips of places in
both directions. S is their stiffness, and g is the energy gained per unit of each, minus the bound
c for a slip. Its solution is exact, where successive linearisations may cycle, as for a pin that
rolls in its hole.
"""

from dataclasses import replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.solvers.active_set.condensed_qp import TOLERANCE, openings
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    Held,
    QuadraticModel,
)
from perfplast_fenicsx.solvers.active_set.slip import Slip


def condensable(program: EqualityProgram, friction: Friction) -> bool:
    """Return whether slip has two directions, and pairs and places are few. Collective."""
    most_unknowns = 300  # largest number of condensed pairs and places
    few = program.comm.allreduce(len(program.index) + len(friction.index)) <= most_unknowns
    return few and friction.index.shape[1] == 1


def condense_friction(
    program: EqualityProgram, model: QuadraticModel, friction: Friction, jumps: Floats
) -> tuple[Slip, PairFlags, int]:
    """Solve the contact QP with friction for all pairs and places at once. Collective.

    This takes one linear solve for each of them, with one set-up.

    Args:
        program: Equality-constrained QPs of the operator without springs.
        model: The function to be minimised, with ``jumps`` the room of each pair.
        friction: The places of friction.
        jumps: Tangential jumps at δ = 0, shape (num_places, 1).

    Returns:
        The linearisation and the closed pairs of the solution; and the number of solved systems.

    Raises:
        LinearFailure: If a linear system cannot be solved.
    """
    there, closed = friction.index[:, 0] >= 0, np.ones(len(program.index), dtype=np.bool_)
    places, given = friction.index[there, 0], -jumps[there, 0]
    unknowns = np.concatenate([program.index, places])
    last = program.comm.scan(len(unknowns))
    count, mine = program.comm.allreduce(len(unknowns)), slice(last - len(unknowns), last)
    delta, gradient, nothing = (model.r.duplicate() for _ in range(3))
    columns = np.zeros((count, count + 1))
    model = replace(model, rtol=TOLERANCE, given=Held(places, given))
    try:
        for number in range(count + 1):
            column = model
            if number < count:
                unit = np.zeros(len(unknowns))
                if mine.start <= number < mine.stop:
                    unit[number - mine.start] = 1.0
                pairs, values = np.split(unit, [len(program.index)])
                work = None if model.work is None else 0.0
                held = Held(places, values)
                column = QuadraticModel(nothing, pairs, work, TOLERANCE, held)
            solution = program.minimise(column, closed, delta)
            program.gradient(solution, gradient)
            columns[mine, number] = gradient.array_r[unknowns]
    finally:
        for vector in (delta, gradient, nothing):
            vector.destroy()
    bound, kind = np.zeros((2, count))
    bound[mine] = np.concatenate([np.zeros(len(program.index)), friction.bound[there]])
    kind[mine] = np.repeat([0.0, 1.0], [len(program.index), len(places)])
    columns, bound, kind = (program.comm.allreduce(array) for array in (columns, bound, kind))
    move = moves_of(columns[:, :count], columns[:, count], bound, kind > 0)[mine]
    opens, slips = np.split(move, [len(program.index)])
    sign = np.zeros(len(there))
    sign[there] = np.sign(slips)
    sticks = (sign == 0) & (friction.bound > 0)
    slip = Slip(sticks, sign[:, None], np.zeros(len(there)))
    return slip, opens == 0, count + 1


def moves_of(S: Floats, G: Floats, bound: Floats, is_place: np.ndarray) -> Floats:
    """Return how far pairs open (negative) and places slip, shape (n,).

    Args:
        S: Force on each for a unit jump of each, shape (n, n).
        G: Gradient with everything closed and sticking.
        bound: Bounds c of places.
        is_place: Which entries are places.
    """
    pairs, places = np.flatnonzero(~is_place), np.flatnonzero(is_place & np.isfinite(bound))
    which = np.concatenate([pairs, places, places])
    sign = np.repeat([-1.0, 1.0, -1.0], [len(pairs), len(places), len(places)])
    forces = -sign * G[which] - bound[which]
    z = openings(sign[:, None] * S[np.ix_(which, which)] * sign, forces)
    moves = np.zeros(len(G))
    np.add.at(moves, which, sign * z)
    return moves
