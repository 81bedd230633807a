"""Create a problem on the same bodies with other materials, loads, contact or elements."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.rows.constraints import Constraints
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.contact.rows.jump_basis import JumpBasis
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.refinement import check_refinable, refine
from perfplast_fenicsx.problem.assembled.declared_loads import declared_loads
from perfplast_fenicsx.problem.assembled.initial_strain import Shanks, initial_strain
from perfplast_fenicsx.problem.assembled.law_on_cells import lay_out
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.assembled.spread_forces import on_this_mesh
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.problem import Problem


def variant(
    problem: Problem,
    *,
    materials: Mapping[str, Material] | None = None,
    points: Spaces | None = None,
    rows: tuple[Constraints, Constraints] | None = None,
    basis: JumpBasis | None = None,
    friction: Friction | None = None,
    loads: Sequence[Load] | None = None,
    rubbing: tuple[Sequence[Contact], Sequence[Obstacle]] | None = None,
) -> Problem:
    """Return a problem on the same bodies with other data. Collective.

    The variant keeps the data of the given problem for which no argument is given.

    The variant shares mesh, displacements, supports and contact search with the given problem, but
    no data that levels change. Each variant has its own positions of supports and obstacles, and
    its own slip. The history of its laws starts from zero.

    Args:
        problem: The original problem.
        materials: Material of each volume, as for a new problem.
        points: Spaces with other quadrature points and the same displacements.
        rows: The contact inequalities, and the rows of tangential jumps on surfaces with friction.
        basis: The basis in which the inequalities are bounds; its rows that are not pairs are tied.
        friction: Friction data for the rows of the problem.
        loads: Loads, as for a new problem.
        rubbing: Contacts and obstacles that differ from the problem only in the friction of
            surfaces that already have friction.

    Raises:
        InputError: If materials or loads do not fit the mesh.
    """
    other = copy.copy(problem)
    spaces = points or Spaces(problem.degree, problem.V, problem.S, problem.Q, problem.dx)
    other.S, other.Q, other.dx = spaces.S, spaces.Q, spaces.dx
    if materials is not None:
        other.given = replace(problem.given, materials=materials)
    given, tagged_mesh = other.given, problem.tagged_mesh
    if materials is not None or points is not None or problem.history:
        other.laws = lay_out(tagged_mesh, spaces, given.materials)
        told = (tagged_mesh, spaces, given.materials, other.laws, given.initial)
        other.initial_strain = initial_strain(*told)
        other.shanks = Shanks(tagged_mesh, spaces, other.laws, given.initial)
    other.constraints, other.sliding = rows or (problem.constraints, problem.sliding)
    if basis is not None:
        other.basis = basis
        counts = problem.comm.allreduce(np.array([len(basis.index), len(basis.tied)]))
        other.num_pairs, other.num_tied = map(int, counts)
    resisting = friction or problem.friction
    bound, origin = resisting.bound.copy(), resisting.origin.copy()
    other.friction = replace(resisting, bound=bound, origin=origin)
    other.prescribed = problem.prescribed.copy()
    if loads is not None:
        _load(other, loads)
    if rubbing is not None:
        _rub(other, *rubbing)
    return other


def _load(problem: Problem, loads: Sequence[Load]) -> None:
    """Replace the loads of a problem. Collective."""
    tagged_mesh, rigid = problem.tagged_mesh, problem.given.rigid
    found = on_this_mesh(tagged_mesh, loads, rigid)
    problem.given = replace(problem.given, loads=found)
    moved = problem.interferes or problem.motion.moves_supports
    stays = problem.initial_strain is not None or moved
    told = (problem.bcs, rigid, problem.motion.driven, stays)
    problem.loads = problem.declared = declared_loads(problem.V, tagged_mesh, found, *told)
    problem.free.check([problem.loads.dead, problem.loads.live])


def _rub(problem: Problem, contacts: Sequence[Contact], obstacles: Sequence[Obstacle]) -> None:
    """Replace the friction of a problem. Not collective."""
    problem.given = replace(problem.given, contacts=contacts, obstacles=obstacles)
    sources = tuple(
        replace(source, tresca=it.tresca, coulomb=it.coulomb)
        for source, it in zip(problem.constraints.sources, [*contacts, *obstacles], strict=True)
    )
    problem.constraints = replace(problem.constraints, sources=sources)
    friction = problem.friction
    tresca, coulomb = problem.constraints.friction_of(friction.pair)
    adhesion = tresca * friction.area
    bound = adhesion.copy()
    problem.friction = replace(friction, coulomb=coulomb, adhesion=adhesion, bound=bound)


def halved(problem: Problem) -> Problem:
    """Return the problem on a mesh in which all edges are halved. Collective.

    Coincident vertices of bodies in contact remain coincident. The bodies do not change: polygons
    that approximate circles remain polygons.

    Raises:
        InputError: If cells are curved.
    """
    tagged_mesh = problem.tagged_mesh
    check_refinable(tagged_mesh)
    topology = tagged_mesh.mesh.topology
    every = np.ones(topology.index_map(topology.dim).size_local, dtype=np.bool_)
    opposite = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(refine(tagged_mesh, every, opposite).tagged_mesh)
