"""Move supports, rigid surfaces, obstacles and overlaps in stages, by factors of names."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.problem.assembled.given_motion import GivenMotion, given_motion
from perfplast_fenicsx.problem.assembled.prescribed_displacement import known_displacements
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.stage import called, follows
from perfplast_fenicsx.problem.declared.supports import AXES, Support
from perfplast_fenicsx.problem.problem import Problem


def named_motions(problem: Problem) -> dict[str, GivenMotion]:
    """Return the motion of each name for the factor 1. Collective.

    Raises:
        InputError: If the same components of a node follow two names.
    """
    V, given = problem.V, problem.given
    supports = given.holding
    for support in supports:
        if isinstance(support, Support) and support.guides and follows(support):
            raise InputError(
                f"the support on '{support.on}' moves along its normal, which stages do "
                "not support; give control = 'displacement', constant = true, or letters "
                "as components."
            )
    _, values, holder = known_displacements(V, problem.tagged_mesh, supports)
    _check_parted(problem, supports, values[1] != 0, holder)
    followers = [called(one) if follows(one) else None for one in supports]
    others = (*given.obstacles, *given.contacts)
    names = [*followers, *(called(one) for one in others if follows(one))]
    rows = (problem.constraints, problem.sliding, problem.friction)
    parts = {}
    for name in dict.fromkeys(name for name in names if name is not None):
        mine = np.array([*(follower == name for follower in followers), False])  # -1: no holder
        moved = np.where(mine[holder], values[1], 0.0)
        sources = [
            one if one.called == name else replace(one, move=(), grows=False)
            for one in problem.constraints.sources
        ]
        both = np.stack([np.zeros_like(moved), moved])
        parts[name] = given_motion(V, both, *rows, sources)
    return parts


def in_stage(
    constant: GivenMotion,
    parts: Mapping[str, GivenMotion],
    first: Mapping[str, float],
    rate: Mapping[str, float],
) -> GivenMotion:
    """Return the motion in a stage, in which each name has the factor first + ζ · rate.

    Args:
        constant: The problem's motion, of which only the part without ζ counts.
        parts: See :func:`named_motions`.
        first: Factors extrapolated to ζ = 0, by name.
        rate: Growth of the factors with ζ, by name.
    """
    displacement = np.stack([constant.displacement[0], np.zeros_like(constant.displacement[0])])
    gap = np.stack([constant.gap[0], np.zeros_like(constant.gap[0])])
    slide = np.stack([constant.slide[0], np.zeros_like(constant.slide[0])])
    sources, overlap = np.zeros_like(constant.sources), np.zeros_like(constant.overlap)
    for name, part in parts.items():
        both = np.array([first[name], rate[name]])
        displacement += np.multiply.outer(both, part.displacement[1])
        gap += np.multiply.outer(both, part.gap[1])
        slide += np.multiply.outer(both, part.slide[1])
        sources += rate[name] * part.sources
        overlap += rate[name] * part.overlap
    return replace(
        constant,
        displacement=displacement,
        gap=gap,
        slide=slide,
        sources=sources,
        overlap=overlap,
        parts=parts,
    )


def _check_parted(
    problem: Problem,
    supports: Sequence[Support | RigidSurface],
    moved: npt.NDArray[np.bool_],
    holder: Ints,
) -> None:
    """Refuse two names for one component of a node. Collective."""
    mesh, message = problem.tagged_mesh, None
    fdim, gdim = mesh.mesh.topology.dim - 1, mesh.mesh.geometry.dim
    for support in supports:
        if not follows(support):
            continue
        nodes = fem.locate_dofs_topological(problem.V, fdim, mesh.facets(support.on))
        for axis in support.axes(gdim):
            theirs = holder[nodes, axis][moved[nodes, axis]]
            others = {called(supports[i]) for i in np.unique(theirs)}
            for other in sorted(others - {called(support)}):
                message = (
                    f"the supports '{other}' and '{called(support)}' hold the same nodes "
                    f"along {AXES[axis]}, but stages could move them differently; give "
                    "both one name, or separate their surfaces."
                )
    raise_together(problem.comm, message)
