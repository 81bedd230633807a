"""Which rigid motions supports leave to bodies: each by itself, and all of them together."""

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.rigid_motion_names import motion_name
from perfplast_fenicsx.contact.rows.rigid_motions import null_space
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.problem import Problem


def left_motions(problem: Problem) -> tuple[list[list[str]], list[str]]:
    """Return what supports leave, without what contacts and ties hold. Collective.

    Returns:
        For each of ``problem.given.holding`` the motions that it leaves by itself to the bodies
        that it touches, such as "translation in x and rotation", with their names where they
        differ; and the same of all together, with the names of the bodies that move yet.
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
    return single, _in_words(problem, grams.sum(axis=0), np.arange(count, dtype=np.int32), False)


def _rows(problem: Problem, support: Support | RigidSurface) -> tuple[Ints, Floats]:
    """Return what a support holds as functionals of rigid motions of the body of each node.

    Returns:
        The bodies, shape (n,), and the functionals, shape (n, num_modes), of this rank.
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
    """Return the motions that rows leave to some bodies, those with the same motions together.

    Args:
        problem: Whose bodies they are.
        grams: Rᵀ R of the rows of each body, shape (count, num_modes, num_modes).
        some: Numbers of bodies.
        alone: Leave their names out where they all have the same motions.
    """
    names, by_words = problem.free.names, dict[str, list[str]]()
    for body in some:
        left = null_space(grams[body])
        if not left.shape[1]:
            continue
        words = _motions(problem, left)
        if left.shape[1] == problem.bodies.num_modes:
            words = "any rigid motion"
        by_words.setdefault(words, []).append(names[body])
    most = 6  # so many bodies are named
    told = []
    for words, moving in by_words.items():
        shown = moving if len(moving) <= most else [*moving[:most], f"{len(moving) - most} more"]
        of_all = alone and len(moving) == len(some)
        told.append(words if of_all else f"{words} of {', '.join(shown)}")
    return told


def _motions(problem: Problem, left: Floats) -> str:
    """Return rigid motions of a body in words, along few axes each."""
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
