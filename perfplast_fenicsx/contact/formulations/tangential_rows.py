"""Form the rows of friction: tangential jumps with the nodes and weights of the contact rows.

A contact row is the jump between two surfaces along the normal n. The jump along a direction t in
the surface has the same weights. Both jumps are components of one vector, whose tangential part
friction resists.
"""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.rows.constraints import (
    Constraints,
    entries_of,
    make_constraints,
    matrix_of_entries,
)
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.errors import InputError

NOTHING = 1e-9
"""Rows with an area below this fraction of the largest area have no friction. Vertices of quadratic
tetrahedra are an example: a constant shear stress exerts no force on them."""


def tangential_rows(
    V: fem.FunctionSpace,
    constraints: Constraints,
    contacts: Sequence[Contact],
    obstacles: Sequence[Obstacle],
    ties: Sequence[Tie],
    taken: npt.NDArray[np.bool_],
    guided: tuple[Ints, Ints, Floats],
) -> tuple[Constraints, Friction]:
    """Return the rows of friction, and the friction data. Collective.

    The data do not contain the indices of the unknowns yet.

    A node that hosts several contact rows, as at an edge between two faces, has no friction. Nodes
    that supports or ties hold along the surface have no friction either.

    Args:
        V: Displacement space.
        constraints: The contact rows, whose sources contain the friction parameters.
        contacts: The declared contacts. No surface may have both friction and a tie.
        obstacles: The declared obstacles.
        ties: The ties; a tied surface cannot have friction.
        taken: Components of local nodes that supports hold or ties eliminate, shape (num_nodes,
            gdim).
        guided: Directions along which supports with ``components = "normal"`` hold nodes: nodes of
            this rank, eliminated components, and unit vectors, one per row.

    Returns:
        The rows, and friction data whose ``index`` contains row numbers.

    Raises:
        InputError: If a surface has friction and is tied, or if supports hold hosts along the
            surface while their guests are free.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    _check_ties(contacts, obstacles, ties)
    place = _places(comm, constraints)
    parts = entries_of(constraints.weights)
    _check_guests(V, constraints, taken, place, _of(constraints, place, *parts))
    spaces = _free_spaces(constraints.host[place], taken, guided)
    directions, there = _directions(constraints.normal[place], spaces)
    some = there.any(axis=1)
    place, directions, there = place[some], directions[some], there[some]
    row, node, weight = _of(constraints, place, *parts)

    which, slot = np.nonzero(there)
    number = np.full(there.shape, -1, dtype=np.int32)
    number[which, slot] = np.arange(len(which))
    terms = []
    for axis in range(gdim - 1):
        to = number[row, axis]
        kept = to >= 0
        coefficient = weight[kept, None] * directions[row[kept], axis]
        terms.append((to[kept], node[kept], coefficient))
    pairs = place[which]
    rows = make_constraints(
        V,
        constraints.host[pairs],
        np.zeros(len(pairs)),
        directions[which, slot],
        constraints.surface[pairs],
        terms,
        area=constraints.area[pairs],
    )
    area = constraints.area[place]
    tresca, coulomb = constraints.friction_of(place)
    friction = Friction(
        pair=place.astype(np.int32),
        index=number,
        direction=directions,
        area=area,
        coulomb=coulomb,
        adhesion=tresca * area,
        bound=tresca * area,
        origin=np.zeros(number.shape),
        count=comm.allreduce(len(place)),
        follows_pressure=comm.allreduce(bool(coulomb.any()), MPI.LOR),
    )
    return rows, friction


def _check_ties(
    contacts: Sequence[Contact], obstacles: Sequence[Obstacle], ties: Sequence[Tie]
) -> None:
    """Refuse friction on tied surfaces."""
    rubs = {name for a in contacts if a.rubs for name in (a.primary, a.secondary)}
    rubs |= {obstacle.on for obstacle in obstacles if obstacle.rubs}
    both = sorted(rubs & {name for tie in ties for name in (tie.primary, tie.secondary)})
    if both:
        raise InputError(
            f"the surface '{both[0]}' has friction but is tied, so it can never slip; remove the "
            "friction or the tie."
        )


def _places(comm: MPI.Intracomm, constraints: Constraints) -> Longs:
    """Return the contact rows with friction whose hosts have only one row. Collective."""
    rows = rows_that_rub(comm, constraints)
    hosts, counts = np.unique(constraints.host, return_counts=True)
    return rows[counts[np.searchsorted(hosts, constraints.host[rows])] == 1]


def rows_that_rub(comm: MPI.Intracomm, constraints: Constraints) -> Longs:
    """Return the contact rows with friction and a non-negligible area. Collective."""
    rubs = np.array([one.rubs for one in constraints.sources], dtype=np.bool_)[constraints.surface]
    largest = comm.allreduce(float(constraints.area.max(initial=0)), MPI.MAX)
    return np.flatnonzero(rubs & (constraints.area > NOTHING * largest))


def _free_spaces(
    hosts: Ints, taken: npt.NDArray[np.bool_], guided: tuple[Ints, Ints, Floats]
) -> Floats:
    """Return projections onto the free directions of the hosts, shape (n, gdim, gdim)."""
    node, component, normal = guided
    gdim = taken.shape[1]
    spaces = np.einsum("ni,ij->nij", ~taken[hosts], np.eye(gdim))
    place = np.full(len(taken), -1)
    place[hosts] = np.arange(len(hosts))
    rows = np.flatnonzero(place[node] >= 0)
    rows = rows[np.argsort(node[rows], kind="stable")]
    at = place[node[rows]]
    spaces[at, component[rows], component[rows]] = 1.0
    first = np.flatnonzero(np.diff(at, prepend=-1))
    slot = np.arange(len(at)) - np.repeat(first, np.diff(first, append=len(at)))
    for number in range(gdim):
        these = np.flatnonzero(slot == number)
        left = np.einsum("nij,nj->ni", spaces[at[these]], normal[rows[these]])
        left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-300)
        spaces[at[these]] -= left[:, :, None] * left[:, None, :]
    return spaces


def _directions(normal: Floats, spaces: Floats) -> tuple[Floats, npt.NDArray]:
    """Return orthonormal directions in the surface that supports leave free.

    Args:
        normal: Normals, shape (n, gdim).
        spaces: Projections onto the free directions of the hosts, shape (n, gdim, gdim).

    Returns:
        Directions, shape (n, gdim − 1, gdim), zero where a direction does not exist; and whether
        each direction exists.
    """
    along = np.einsum("nij,nj->ni", spaces, normal)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    projection = spaces - along[:, :, None] * along[:, None, :]
    values, vectors = np.linalg.eigh(projection)
    most_normal = 0.5  # eigenvalues: 1 for free directions in the surface, 0 for others
    there = values[:, 1:] > most_normal
    return np.swapaxes(vectors[:, :, 1:], 1, 2) * there[:, :, None], there


def _of(
    constraints: Constraints, place: Longs, row: Longs, node: Longs, weight: Floats
) -> tuple[Longs, Longs, Floats]:
    """Return the entries (row, node, weight) of the rows ``place``, with new row numbers."""
    chosen = np.full(len(constraints.host), -1)
    chosen[place] = np.arange(len(place))
    kept = chosen[row] >= 0
    return chosen[row[kept]], node[kept], weight[kept]


def _check_guests(
    V: fem.FunctionSpace,
    constraints: Constraints,
    taken: npt.NDArray[np.bool_],
    place: Longs,
    terms: tuple[Longs, Longs, Floats],
) -> None:
    """Refuse guests that are free in directions in which supports hold their hosts. Collective."""
    comm, index_map, gdim = V.mesh.comm, V.dofmap.index_map, V.mesh.geometry.dim
    rows = (len(place), comm.allreduce(len(place)))
    nodes = (index_map.size_local, index_map.size_global)
    W = matrix_of_entries(comm, rows, nodes, [(terms[0], terms[1], np.abs(terms[2]))])
    moves, moved = W.createVecs()
    held: Ints = np.zeros(len(place), dtype=np.int32)
    for axis in range(gdim):
        moves.array[:] = ~taken[: index_map.size_local, axis]
        W.mult(moves, moved)
        held |= taken[constraints.host[place], axis] & (moved.array_r > NOTHING)
    for thing in (W, moves, moved):
        thing.destroy()
    where = constraints.surface[place[held > 0]]
    count = len(constraints.sources)
    first = comm.allreduce(int(where.min(initial=count)), MPI.MIN)
    if first < count:
        raise InputError(
            f"friction of {constraints.sources[first].name}: supports hold nodes of one surface in "
            "tangential directions in which the other surface is free; set hosts ('primary' or "
            "'secondary') to the free surface, or support both surfaces in the same way."
        )
