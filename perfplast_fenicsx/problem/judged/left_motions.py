"""Find rigid motions that supports leave free, and supports on surfaces that stiff bodies load."""

from collections.abc import Collection
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx import fem
from scipy.linalg import block_diag
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.rigid_motions import motion_name, null_space, rigid_jumps
from perfplast_fenicsx.contact.surfaces.surface_facets import face_nodes
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING

STILL = 1e-6
"""A body is at rest if its part of a motion of all bodies is below this fraction."""


def left_motions(problem: Problem) -> tuple[list[list[str]], list[str]]:
    """Return in words the rigid motions that supports leave free; contact is ignored. Collective.

    Returns:
        The first list has an entry for each of ``problem.given.holding``. The entry names the
        motions that this support alone leaves free in the bodies that it touches, such as
        "translation in x and rotation". The entry names the bodies if their motions differ. The
        second list is for all supports together, with the names of the bodies that can still move.
        Bodies that are tied together move as one body.
    """
    count, modes = problem.bodies.count, problem.bodies.num_modes
    holding = problem.given.holding
    grams = np.zeros((len(holding), count, modes, modes))
    for number, support in enumerate(holding):
        body, rows = _rows(problem, support)
        np.add.at(grams[number], body, rows[:, :, None] * rows[:, None, :])
    grams = problem.comm.allreduce(grams)
    single = []
    for gram in grams:
        touched = np.flatnonzero(np.abs(gram).max(axis=(1, 2), initial=0.0) > 0).astype(np.int32)
        single.append(_in_words(problem, gram, touched, True))
    everybody = np.arange(count, dtype=np.int32)
    return single, _in_words(problem, _together(problem, grams.sum(axis=0)), everybody, False)


def _together(problem: Problem, grams: Floats) -> Floats:
    """Return Gram matrices whose null spaces are the motions that ties also leave free. Collective.

    Args:
        problem: The bodies with their ties.
        grams: Gram matrices of supports, shape (count, num_modes, num_modes).
    """
    count, modes = grams.shape[:2]
    jumps = rigid_jumps(problem.V, problem.bodies, problem.ties.B)
    if not problem.comm.allreduce(len(jumps)):
        return grams
    left = null_space(block_diag(*grams) + problem.comm.allreduce(jumps.T @ jumps))
    found = np.empty_like(grams)
    for body in range(count):
        moves = left[body * modes : (body + 1) * modes]
        found[body] = np.eye(modes)
        if moves.size:
            vectors, sizes, _ = np.linalg.svd(moves, full_matrices=False)
            basis = vectors[:, sizes > STILL]
            found[body] -= basis @ basis.T
    return found


def _rows(problem: Problem, support: Support | RigidSurface) -> tuple[Ints, Floats]:
    """Return the rows of a support, as functionals of the rigid motions of each node's body.

    Returns:
        The bodies, shape (n,), and the functionals, shape (n, num_modes), on this rank.
    """
    V, bodies, gdim = problem.V, problem.bodies, problem.bodies.gdim
    nodes = fem.locate_dofs_topological(V, gdim - 1, problem.tagged_mesh.facets(support.on))
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    if isinstance(support, Support) and support.guides:
        mine = problem.guides.number == problem.guides.surfaces.index(support.on)
        nodes, held = problem.guides.host[mine], problem.guides.along[mine][:, None]
    else:
        held = np.tile(np.eye(gdim)[support.axes(gdim)], (len(nodes), 1, 1))
    modes = bodies.rigid_modes(V.tabulate_dof_coordinates()[nodes])
    rows = np.einsum("nai,nim->nam", held, modes).reshape(-1, bodies.num_modes)
    return np.repeat(bodies.of_node[nodes], held.shape[1]), rows


def _in_words(problem: Problem, grams: Floats, some: Ints, alone: bool) -> list[str]:
    """Return in words the motions that rows leave free, grouped by bodies with equal motions.

    Args:
        problem: Problem of the bodies.
        grams: Gram matrices of the rows of each body, shape (count, num_modes, num_modes).
        some: Numbers of the bodies that are described.
        alone: Whether to omit the names of bodies if all have the same motions.
    """
    names, by_words = problem.free.names, dict[str, list[str]]()
    for body in some:
        left = null_space(grams[body])
        if not left.shape[1]:
            continue
        words = _motions(problem, left)
        if left.shape[1] == problem.bodies.num_modes:
            words = "all rigid motions"
        by_words.setdefault(words, []).append(names[body])
    most = 6  # largest number of bodies that are named
    told = []
    for words, moving in by_words.items():
        shown = moving if len(moving) <= most else [*moving[:most], f"{len(moving) - most} more"]
        of_all = alone and len(moving) == len(some)
        told.append(words if of_all else f"{words} of {', '.join(shown)}")
    return told


def _motions(problem: Problem, left: Floats) -> str:
    """Return in words the rigid motions in the columns of ``left``, along few axes if possible."""
    projector = left @ left.T
    told = []
    for _ in range(left.shape[1]):
        strongest = int(np.argmax(np.round(projector.diagonal(), 6)))
        v = projector[:, strongest] / np.sqrt(projector[strongest, strongest])
        told.append(motion_name(problem.bodies, v))
        projector = projector - np.outer(v, v)
    kinds = []
    for kind in ("translation in ", "rotation about "):
        letters = [one.removeprefix(kind) for one in sorted(told) if one.startswith(kind)]
        kinds += [kind + ", ".join(letters)] if letters else []
    kinds += sorted(
        one for one in told if not one.startswith(("translation in ", "rotation about "))
    )
    return " and ".join(kinds)


@dataclass(frozen=True)
class HeldAgainst:
    """A contact surface on which supports hold nodes along the normal, but not the opposite nodes.

    Attributes:
        surface: Name of the surface.
        other: Name of the opposite surface.
        held: Number of these held nodes.
        nodes: Number of all nodes on the surface.
        by: Names of the supports that hold these nodes.
    """

    surface: str
    other: str
    held: int
    nodes: int
    by: tuple[str, ...]


def held_against(problem: Problem, stiff: Collection[str]) -> list[HeldAgainst]:
    """Return contact surfaces that supports partly hold against a stiff opposite body. Collective.

    A stiff body cannot move into such a surface. An example is a wall driven into ground whose base
    is fixed also under the wall. The function ignores nodes where both sides are held along the
    normal, and surfaces that are held everywhere.

    Args:
        problem: The bodies.
        stiff: Names of volumes that remain undeformed at collapse.
    """
    near = ROUNDING * problem.bodies.size
    found = []
    for contact in problem.given.contacts:
        names = (contact.primary, contact.secondary)
        sides = [_held_nodes(problem, name) for name in names]
        for number, (held, by, nodes) in enumerate(sides):
            if not _lies_on(problem, names[1 - number], stiff):
                continue
            facing = sides[1 - number][0]
            alone = np.ones(len(held), dtype=np.bool_)
            if len(facing) and len(held):
                alone = cKDTree(facing).query(held)[0] > near
            if alone.any() and len(held) < nodes:
                supports = sorted({problem.support_names[one] for one in by[alone]})
                one = (names[number], names[1 - number], int(alone.sum()), nodes, tuple(supports))
                found.append(HeldAgainst(*one))
    return found


def _lies_on(problem: Problem, surface: str, volumes: Collection[str]) -> bool:
    """Return whether all cells at a surface belong to given volumes; the same on every rank."""
    tagged_mesh = problem.tagged_mesh
    topology = tagged_mesh.mesh.topology
    to_cell = topology.connectivity(topology.dim - 1, topology.dim)
    cells = to_cell.array[to_cell.offsets[tagged_mesh.facets(surface)]]
    own = [tagged_mesh.cells(name) for name in volumes]
    within = np.isin(cells, np.concatenate([np.zeros(0, dtype=np.int32), *own])).all()
    return bool(problem.comm.allreduce(bool(within), MPI.LAND))


def _held_nodes(problem: Problem, surface: str) -> tuple[Floats, Ints, int]:
    """Return the nodes of a surface, from all ranks, that supports hold along its normal.

    Returns:
        Coordinates of the held nodes, shape (n, 3); the index in ``support_names`` of the support
        that holds each node, shape (n,); and the number of all nodes on the surface.
    """
    faces = face_nodes(problem.V, problem.tagged_mesh, surface)
    taken = np.abs(faces.normal) * (problem.held_by[faces.node] >= 0)
    mostly = 0.7  # smallest component of a normal along held axes
    held = np.flatnonzero(np.linalg.norm(taken, axis=1) > mostly)
    nodes, first = np.unique(faces.node[held], return_index=True)
    by = problem.held_by[nodes, np.argmax(taken[held[first]], axis=1)]
    places = problem.V.tabulate_dof_coordinates()[nodes]
    parts = problem.comm.allgather((places, by, len(np.unique(faces.node))))
    found, supports, counts = zip(*parts, strict=True)
    return np.concatenate(found), np.concatenate(supports), sum(counts)
