"""Does a mechanism enter another body between the nodes of contact?

The jump w of a quadratic velocity along a fixed normal is quadratic on a facet. Its Bernstein
coefficients are those at the vertices and 2 w_m − (w_a + w_b)/2 at a midside m between a and b: w
is nowhere positive if they are not. Three nodes that do not enter are not enough (0, 0 and −1 at
the middle enter by 1/8 between).
"""

from dataclasses import replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.formulations.tangential_rows import tangential_rows
from perfplast_fenicsx.contact.rows.constraints import stacked
from perfplast_fenicsx.contact.rows.jump_basis import make_basis
from perfplast_fenicsx.limit_analysis.facets.contact_facets import ContactFacets, contact_facets
from perfplast_fenicsx.limit_analysis.facets.facet_contact import with_facet_contact
from perfplast_fenicsx.limit_analysis.facets.matched_facets import matched_facets
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant
from perfplast_fenicsx.rounding import ROUNDING

SAME = 1e-9
"""Normals whose components differ by less are the same."""


CURVED = "on curved contact surfaces normals are averaged, or are those of a curved obstacle"

ENTERS = "the mechanism enters contact between nodes"

IN_MEAN = "surfaces whose nodes do not match are kept apart in the mean alone"


def entering_between_nodes(problem: Problem, velocity: fem.Function) -> list[str]:
    """Why bodies may enter each other, in words; nothing where they do not. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Its ghosts up to date.
    """
    if problem.constraints.in_mean or problem.given.ties:
        return [IN_MEAN]
    if not problem.num_pairs:
        return []
    faces = flat_faces(problem)
    facets = contact_facets(problem)
    if faces is None or not _are_flat(problem, facets, faces):
        return _entering_facets(problem, velocity)
    jumps = problem.constraints.jumps(velocity.x.petsc_vec)
    nodes = facets.nodes
    _, paired = at_nodes(problem, jumps, np.ones(len(jumps), dtype=bool))
    entered = 0.0
    for face in faces:
        jump, known = at_nodes(problem, jumps, rows_of(problem, face))
        kept = ~paired & (problem.fixed | (np.abs(face[1:]) <= SAME)).all(axis=1)
        here = known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
        entered = max(entered, float(jump[nodes[here]].max(initial=0)))
        if problem.degree == 2:
            w = jump[facets.edges(here)]
            entered = max(entered, float((2 * w[:, 0] - w[:, 1:].mean(axis=1)).max(initial=0)))
    return _if_entered(problem, velocity, entered)


def _if_entered(problem: Problem, velocity: fem.Function, entered: float) -> list[str]:
    """Words for what a velocity enters by, if that is more than rounding. Collective."""
    comm = problem.comm
    largest = comm.allreduce(float(np.abs(velocity.x.array).max(initial=0)), MPI.MAX)
    return [ENTERS] if comm.allreduce(entered, MPI.MAX) > ROUNDING * largest else []


def _entering_facets(problem: Problem, velocity: fem.Function) -> list[str]:
    """The same where normals are averaged: of each facet and that opposite it. Collective."""
    matched = None if problem.given.obstacles else matched_facets(problem, velocity)
    if matched is None or problem.friction.count:
        return [CURVED]
    entered = [float(facets.coefficients().max(initial=0)) for facets in matched]
    return _if_entered(problem, velocity, max(entered, default=0.0))


def _are_flat(problem: Problem, facets: ContactFacets, faces: Floats) -> bool:
    """Whether the pairs around each facet have its normal. Collective."""
    nodes = facets.nodes
    none = np.zeros(len(problem.constraints.host))
    _, paired = at_nodes(problem, none, np.ones(len(none), dtype=bool))
    seen = ~paired[nodes].any(axis=1)
    for face in faces:
        _, known = at_nodes(problem, none, rows_of(problem, face))
        kept = ~paired & (problem.fixed | (np.abs(face[1:]) <= SAME)).all(axis=1)
        seen |= known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
    return bool(problem.comm.allreduce(bool(seen.all()), MPI.LAND))


def without_entering(problem: Problem) -> Problem | None:
    """The same problem with Bernstein's coefficients of jumps bounded, not those at midsides.

    Its mechanisms enter nothing between the nodes of a straight mesh, and what resists slip
    resists the coefficients of slip. Collective.

    Args:
        problem: The bodies and their contact.

    Returns:
        A problem that shares all but contact with the given one; that one itself if its elements
        are linear and contact is flat; None where nodes do not match, and on curved faces that
        :func:`facet_contact.with_facet_contact` cannot do.
    """
    if problem.constraints.in_mean or problem.given.ties:
        return None
    if not problem.num_pairs:
        return problem
    faces, facets = flat_faces(problem), contact_facets(problem)
    if faces is None or not _are_flat(problem, facets, faces):
        return with_facet_contact(problem)
    if problem.degree == 1:
        return problem
    constraints = problem.constraints
    first = constraints.B.getOwnershipRange()[0]
    count = len(constraints.host)
    numbers = np.arange(first, first + count, dtype=np.float64)
    nodes, areas = facets.nodes, facets.areas
    num_nodes = len(problem.fixed)
    area = np.zeros(count)
    combine = PETSc.Mat().createAIJ(((count, None), (count, None)), nnz=4, comm=problem.comm)
    combine.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    diagonal = combine.createVecRight()
    diagonal.set(1.0)
    diagonal.assemble()
    for face in faces:
        chosen = rows_of(problem, face)
        row, known = at_nodes(problem, numbers, chosen)
        here = known[nodes].any(axis=1)
        share = np.repeat(areas[here] / nodes.shape[1], nodes.shape[1])
        on_nodes = np.zeros(num_nodes)
        np.add.at(on_nodes, nodes[here].ravel(), share)
        area[chosen] = _summed(problem, on_nodes)[constraints.host[chosen]]
        edges = facets.edges()
        edges = edges[known[edges[:, 0]]]
        middle = np.rint(row[edges[:, 0]]).astype(PETSc.IntType)
        diagonal.setValues(middle, np.full(len(middle), 2.0))
        for end in edges[:, 1:].T:
            has = known[end]
            ends = np.rint(row[end[has]]).astype(PETSc.IntType)
            one_each = np.arange(len(ends) + 1, dtype=PETSc.IntType)
            halves = np.full(len(ends), -0.5)
            combine.setValuesIJV(one_each, ends, halves, rowmap=middle[has])
    diagonal.assemble()
    combine.assemble()
    combine.setDiagonal(diagonal)
    touching = replace(
        constraints,
        B=combine.matMult(constraints.B),
        weights=combine.matMult(constraints.weights),
        area=area,
    )
    told, rigid = (problem.given.contacts, problem.given.obstacles), problem.ties
    taken = problem.fixed.copy()
    taken[rigid.host, np.argmax(np.abs(rigid.normal), axis=1)] = True
    sliding, friction = tangential_rows(problem.V, touching, *told, [], taken)
    for thing in (combine, diagonal):
        thing.destroy()
    rows = stacked(problem.V, [touching, sliding, rigid])
    basis = make_basis(problem.V, rows, problem.fixed, len(rigid.host), len(sliding.host))
    return variant(
        problem,
        constraints=touching,
        sliding=sliding,
        basis=basis,
        friction=friction.at(basis.sliding),
    )


@once_a_problem
def flat_faces(problem: Problem) -> Floats | None:
    """Rows (number of the contact, normal) that pairs have; None if they are too many to be flat.

    Collective.
    """
    constraints = problem.constraints
    mine = _distinct(np.column_stack([constraints.surface, constraints.normal]))
    most_faces = 64  # directions of contact beyond which surfaces count as curved
    faces = _distinct(np.concatenate(problem.comm.allgather(mine[: most_faces + 1])))
    return faces if len(faces) <= most_faces else None


def rows_of(problem: Problem, face: Floats) -> PairFlags:
    """Pairs of a flat face."""
    rows = np.column_stack([problem.constraints.surface, problem.constraints.normal])
    return np.asarray((np.abs(rows - face) <= SAME).all(axis=1))


def _distinct(rows: Floats) -> Floats:
    """One of each kind of rows that are the same but for rounding."""
    _, first = np.unique(np.round(rows / SAME / 100), axis=0, return_index=True)
    return rows[first]


def at_nodes(problem: Problem, jumps: Floats, chosen: PairFlags) -> tuple[Floats, PairFlags]:
    """Jumps of the chosen pairs at all their nodes, and which nodes those are. Collective.

    Returns:
        For each local node, ghosts too; 0 and False at others.
    """
    shares = problem.constraints.shares
    on_nodes, on_rows = shares.createVecs()

    def summed(values: Floats) -> Floats:
        on_rows.array[:] = values
        shares.multTranspose(on_rows, on_nodes)
        sums = la.vector(problem.V.dofmap.index_map, 1)
        sums.array[: on_nodes.getLocalSize()] = on_nodes.array_r
        sums.scatter_forward()
        return np.array(sums.array, dtype=np.float64)

    jump, weight = summed(np.where(chosen, jumps, 0.0)), summed(chosen.astype(np.float64))
    for thing in (on_nodes, on_rows):
        thing.destroy()
    known: PairFlags = weight > 0
    jump[known] /= weight[known]
    return jump, known


def _summed(problem: Problem, values: Floats) -> Floats:
    """Sums over all ranks of values at local nodes, ghosts too. Collective."""
    sums = la.vector(problem.V.dofmap.index_map, 1)
    sums.array[:] = values
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    return np.array(sums.array, dtype=np.float64)
