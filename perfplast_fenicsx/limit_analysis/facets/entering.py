"""Check whether a mechanism penetrates another body between the nodes of contact.

The jump w of a quadratic velocity along a fixed normal is quadratic on a facet. Its Bernstein
coefficients are those at the vertices and 2 w_m − (w_a + w_b)/2 at a midside m between a and b. If
no coefficient is positive, w is nowhere positive. It is not enough that three nodes do not
penetrate: the values 0, 0 and −1 at one end, the middle and the other end give 1/8 in between.
"""

from dataclasses import replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.formulations.tangential_rows import tangential_rows
from perfplast_fenicsx.contact.rows.constraints import stacked
from perfplast_fenicsx.contact.rows.jump_basis import make_basis
from perfplast_fenicsx.limit_analysis.facets.contact_facets import ContactFacets, contact_facets
from perfplast_fenicsx.limit_analysis.facets.contact_strength import strength_of
from perfplast_fenicsx.limit_analysis.facets.face_jumps import (
    SAME,
    UNSEEN,
    at_nodes,
    face_jumps,
    flat_faces,
    has_pair,
    rows_of,
)
from perfplast_fenicsx.limit_analysis.facets.facet_contact import with_facet_contact
from perfplast_fenicsx.limit_analysis.facets.matched_facets import matched_facets
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

CURVED = "on curved contact surfaces normals are averaged, or are those of a curved obstacle"

ENTERS = "the mechanism enters contact between nodes"

IN_MEAN = "surfaces whose nodes do not match are kept apart in the mean alone"


def entering_between_nodes(problem: Problem, velocity: fem.Function) -> list[str]:
    """Return reasons why bodies may penetrate each other, in words; none if they do not.

    Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
    """
    if problem.constraints.in_mean or problem.given.ties:
        return [IN_MEAN]
    share = entered_share(problem, velocity)
    if share is None:
        return [CURVED]
    return [ENTERS] if share > UNSEEN else []


def entered_share(
    problem: Problem, velocity: fem.Function, *, rubbing: bool = False
) -> float | None:
    """Return the largest penetration relative to the velocities at and opposite a facet.

    Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
        rubbing: Whether surfaces with Coulomb's friction that separate too little for their slip
            count as penetrating.

    Returns:
        The ratio; None where surfaces are curved and normals averaged.
    """
    if not problem.num_pairs:
        return 0.0
    faces, comm = flat_faces(problem), problem.comm
    if faces is None or not _are_flat(problem, contact_facets(problem), faces):
        matched = None if problem.given.obstacles else matched_facets(problem, velocity)
        if matched is None or problem.friction.count:
            return None
        mine = max((facets.entered() for facets in matched), default=0.0)
    else:
        strengths = [strength_of(source) for source in problem.constraints.sources]
        shares = (
            face.entered(strengths[face.source].friction if rubbing else 0.0)
            for face in face_jumps(problem, velocity)
        )
        mine = max(shares, default=0.0)
    return float(comm.allreduce(mine, MPI.MAX))


def _are_flat(problem: Problem, facets: ContactFacets, faces: Floats) -> bool:
    """Return whether the pairs around each facet have its normal. Collective."""
    nodes = facets.nodes
    none, paired = np.zeros(len(problem.constraints.host)), has_pair(problem)
    seen = ~paired[nodes].any(axis=1)
    for face in faces:
        _, known = at_nodes(problem, none, rows_of(problem, face))
        kept = ~paired & (problem.fixed | (np.abs(face[1:]) <= SAME)).all(axis=1)
        seen |= known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
    return bool(problem.comm.allreduce(bool(seen.all()), MPI.LAND))


def without_entering(problem: Problem) -> Problem | None:
    """Return the problem with bounds on Bernstein's coefficients of jumps, not on midside values.

    Its mechanisms do not penetrate between the nodes of a straight mesh, and friction acts on the
    coefficients of slip. Collective.

    Args:
        problem: The bodies and their contact.

    Returns:
        A problem that shares all but contact with the given one. It is the given one if its
        elements are linear and contact is flat. None where nodes do not match, and on curved faces
        that :func:`facet_contact.with_facet_contact` does not support.
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
    node, component, _ = guided = problem.guides.held
    others = slice(len(rigid.host) - len(node))
    taken[rigid.host[others], np.argmax(np.abs(rigid.normal[others]), axis=1)] = True
    taken[node, component] = True
    sliding, friction = tangential_rows(problem.V, touching, *told, [], taken, guided)
    for thing in (combine, diagonal):
        thing.destroy()
    rows = stacked(problem.V, [touching, sliding, rigid])
    basis = make_basis(problem.V, rows, problem.fixed, len(rigid.host), len(sliding.host))
    return variant(
        problem,
        rows=(touching, sliding),
        basis=basis,
        friction=friction.at(basis.sliding),
    )


def _summed(problem: Problem, values: Floats) -> Floats:
    """Return sums over all ranks of values at local nodes, ghosts too. Collective."""
    sums = la.vector(problem.V.dofmap.index_map, 1)
    sums.array[:] = values
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    return np.array(sums.array, dtype=np.float64)
