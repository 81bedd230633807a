"""Find loads that only facets of frictionless cylindrical contact carry.

A body can slide in a smooth bore along the axis, and rotate about it. The normals of contact rows
deviate from the radial direction, because facets are flat, and oblique to the axis in an arbitrary
mesh. The bodies then interlock, and the limit load has no meaning. If the facets lie along the
axis, the bodies can slide, but still resist rotation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compat import coordinate_map, entity_nodes
from perfplast_fenicsx.contact.rows.constraints import (
    Constraints,
    entries_of,
    matrix_of_entries,
    stacked,
    unknowns,
)
from perfplast_fenicsx.contact.rows.rigid_motions import (
    FreeMotions,
    RigidMotions,
    held_motions,
    rigid_jumps,
)
from perfplast_fenicsx.contact.surfaces.surface_facets import SHARP
from perfplast_fenicsx.problem.problem import Problem

NEAR = 1e-5
"""Distance from a cylinder up to which vertices lie on it, relative to its radius; also the
difference up to which two axes count as equal."""

SLIGHT = 0.05
"""Angle (degrees) up to which a normal counts as radial, and a facet as parallel to the axis."""

MOSTLY = 0.7
"""Component along the radial direction, or along the axis, from which a normal belongs to the
cylinder, or to its flat end."""

MUCH = 0.05
"""Smallest relative work that matters; polygons displace the resultant of a load across the
axis."""


@dataclass(frozen=True)
class FacetedCylinder:
    """A contact surface whose vertices lie on a cylinder, with normals that are not all radial.

    Attributes:
        source: Number of the contact among the sources of contact rows.
        surfaces: Names of both surfaces.
        axis: Unit vector of the axis.
        centre: A point of the axis.
        radius: Radius of the cylinder.
        tilt: Largest angle between a normal and the radial direction (degrees).
    """

    source: int
    surfaces: tuple[str, str]
    axis: Floats
    centre: Floats
    radius: float
    tilt: float


def interlocked(problem: Problem) -> str | None:
    """Return a remark if a load acts on a motion that only facets of cylinders resist. Collective.

    Loads are forces and moved supports. The remark names the bodies, a contact and a remedy.
    """
    found = with_common_axes(faceted_cylinders(problem))
    if not found:
        return None
    smooth = _smooth(problem, found)
    forces = [problem.loads.dead, problem.loads.live]
    free = _free(problem, smooth, problem.fixed)
    moved = (
        _moved_both_ways(problem, found, free, forces)
        or _moved_away(problem, found, free, forces)
        or _moved_by_supports(problem, found, smooth)
    )
    smooth.B.destroy()
    if moved is None:
        return None
    moving, worst = moved
    one, other = worst.surfaces
    return (
        f"a load moves {moving}, and only facets of cylinders resist this motion: the normals of "
        f"'{one}' and '{other}' deviate by up to {worst.tilt:.2g} degrees from the radial "
        "direction. Smooth cylinders without friction carry no load here, so the limit load has no "
        "meaning: write [[tie]] for a thread, give the contact friction, or add a support"
    )


def _free(problem: Problem, rows: Constraints, fixed: npt.NDArray[np.bool_]) -> FreeMotions:
    """Return the motions that contact rows, ties, friction and fixed components leave free.

    Collective.
    """
    V, bodies = problem.V, problem.bodies
    held = stacked(V, [problem.sliding, problem.ties])
    motions = RigidMotions(V, bodies, fixed, rows, held)
    free = held_motions(V, bodies, problem.free.names, motions)
    for matrix in (held.B, held.shares, held.weights):
        matrix.destroy()
    return free


Moved = tuple[str, FacetedCylinder]
"""Bodies and motions in words, and the contact with the largest tilt that resists them."""


def _moved_both_ways(
    problem: Problem,
    found: Sequence[FacetedCylinder],
    free: FreeMotions,
    forces: Sequence[PETSc.Vec],
) -> Moved | None:
    """Return the motions that only cylinders resist, in both directions, and that forces drive.

    Collective.
    """
    moved, taking = [], []
    for number in np.flatnonzero(free.drives(forces) > MUCH):
        resisting = _resisting(problem, found, free.basis[:, number])
        if resisting is not None:
            moved.append(number)
            taking.append(resisting)
    if not moved:
        return None
    return free.words(np.array(moved)), max(taking, key=lambda one: one.tilt)


def _moved_away(
    problem: Problem,
    found: Sequence[FacetedCylinder],
    free: FreeMotions,
    forces: Sequence[PETSc.Vec],
) -> Moved | None:
    """Return bodies that a force separates from a contact if cylinders are smooth. Collective.

    The force must do work on the motion, and no other force may do negative work on it.
    """
    facets = problem.free.leaving
    for number, force in enumerate(forces):
        others = [*forces[:number], *forces[number + 1 :]]
        v = free.leaving.away(force, others)
        if (
            v is None
            or free.leaving.drive(force, v) <= MUCH
            or facets.away(force, others) is not None
        ):
            continue
        resisting = _resisting(problem, found, free.leaving.basis @ v)
        if resisting is not None:
            return free.leaving.moving(v), resisting
    return None


def _moved_by_supports(
    problem: Problem, found: Sequence[FacetedCylinder], smooth: Constraints
) -> Moved | None:
    """Return rigid motions with the displacements of supports that only cylinders resist.

    Collective.
    """
    u = problem.motion.displacement_at(1.0)[: problem.V.dofmap.index_map.size_local].ravel()
    if not problem.motion.moves_supports:
        return None
    at_rest = problem.fixed & ~(problem.motion.displacement != 0).any(axis=0)
    free, facets = (_free(problem, rows, at_rest) for rows in (smooth, problem.constraints))
    factors, differs = _following(problem, free, u)
    small = 1e-6  # relative difference from rigid motions that counts as none
    if differs > small or _following(problem, facets, u)[1] <= small:
        return None
    resisting = _resisting(problem, found, free.basis @ factors)
    if resisting is None:
        return None
    taking = np.flatnonzero(np.abs(factors) > small * np.abs(factors).max())
    return free.words(taking), resisting


def _following(problem: Problem, free: FreeMotions, u: Floats) -> tuple[Floats, float]:
    """Return factors of the motions closest to moved supports, and the difference. Collective.

    The difference is relative to the displacements of supports.

    Args:
        problem: The problem.
        free: The motions.
        u: Displacements of supports at the unknowns of this rank, 0 at other unknowns.
    """
    moved = u != 0
    F, comm = free.at_nodes[moved].toarray(), problem.comm
    gram, work = comm.allreduce(F.T @ F), comm.allreduce(F.T @ u[moved])
    factors = np.linalg.lstsq(gram, work, rcond=1e-10)[0]
    squares = np.array([np.sum((u[moved] - F @ factors) ** 2), np.sum(u**2)])
    rest, all_of = comm.allreduce(squares)
    return factors, float(np.sqrt(rest / (all_of or 1.0)))


def _resisting(
    problem: Problem, found: Sequence[FacetedCylinder], motion: Floats
) -> FacetedCylinder | None:
    """Return the cylinder with the largest tilt that a rigid motion opens or closes. Collective.

    Args:
        problem: The problem.
        found: The cylinders.
        motion: Coefficients of the rigid motions of all bodies.

    Returns:
        The cylinder; None if the motion opens or closes none.
    """
    rows = problem.constraints
    jumps = np.abs(rigid_jumps(problem.V, problem.bodies, rows.B) @ motion)
    largest = [
        problem.comm.allreduce(float(jumps[rows.surface == one.source].max(initial=0)), MPI.MAX)
        for one in found
    ]
    rounding = 1e-9  # jumps up to this value, in motions of unit size, count as zero
    small = 1e-3  # jumps below this fraction of the largest jump do not resist a motion
    least = max(rounding, small * max(largest))
    resisting = [one for one, most in zip(found, largest, strict=True) if most > least]
    return max(resisting, key=lambda one: one.tilt) if resisting else None


def faceted_cylinders(problem: Problem) -> list[FacetedCylinder]:
    """Return the frictionless contacts on cylinders whose normals are not all radial. Collective.

    The edges of a prism with few sides also lie on a cylinder. If the facets are parallel to the
    axis, a surface whose facets meet at more than 40° is such a prism.
    """
    if problem.bodies.gdim != 3 or coordinate_map(problem.tagged_mesh.mesh).degree != 1:
        return []
    names = [source.name for source in problem.constraints.sources]
    found = []
    for contact in problem.given.contacts:
        if contact.tresca or contact.coulomb or contact.label not in names:
            continue
        corners = _corners(problem, contact.primary)
        fitted = _fitted(corners)
        if fitted is None:
            continue
        surfaces = (contact.primary, contact.secondary)
        one = FacetedCylinder(names.index(contact.label), surfaces, *fitted, 0.0)
        rows, radial = _radial(problem, one)
        cosines = np.einsum("ni,ni->n", problem.constraints.normal[rows], radial)
        apart = np.arccos(np.minimum(cosines, 1.0)).max(initial=0)
        tilt = float(np.degrees(problem.comm.allreduce(apart, MPI.MAX)))
        if tilt > SLIGHT and not _is_prism(corners, one):
            found.append(replace(one, tilt=tilt))
    return found


def _radial(problem: Problem, one: FacetedCylinder) -> tuple[Longs, Floats]:
    """Return the contact rows on a cylinder, and radial unit vectors along their normals.

    Rows at a flat end of the cylinder are omitted: their normals are far from radial.
    """
    constraints, x = problem.constraints, problem.V.tabulate_dof_coordinates()
    rows = np.flatnonzero(constraints.surface == one.source)
    out = x[constraints.host[rows]] - one.centre
    out -= (out @ one.axis)[:, None] * one.axis
    length = np.linalg.norm(out, axis=1, keepdims=True)
    out = np.divide(out, length, out=np.zeros_like(out), where=length > 0)
    along = np.einsum("ni,ni->n", constraints.normal[rows], out)
    kept = np.abs(along) >= MOSTLY
    return rows[kept], np.sign(along[kept])[:, None] * out[kept]


def _is_prism(corners: Floats, one: FacetedCylinder) -> bool:
    """Return whether facets are parallel to the axis, and meet at angles like those of a prism."""
    normals = np.abs(_normals(corners)[0] @ one.axis)
    around = normals < MOSTLY
    if np.degrees(np.arcsin(normals[around].max(initial=0))) > SLIGHT:
        return False
    out = corners[around] - one.centre
    out -= (out @ one.axis)[:, :, None] * one.axis
    out /= np.linalg.norm(out, axis=2, keepdims=True)
    widest = np.einsum("fci,fdi->fcd", out, out).min(initial=1.0)
    return bool(widest < SHARP)


def _corners(problem: Problem, surface: str) -> Floats:
    """Return the corners of the facets of a surface from all ranks, shape (n, 3, 3)."""
    mesh = problem.tagged_mesh.mesh
    facets = problem.tagged_mesh.facets(surface)
    facets = facets[facets < mesh.topology.index_map(2).size_local]
    own = mesh.geometry.x[entity_nodes(mesh, 2, facets)[:, :3]]
    return np.concatenate(problem.comm.allgather(own.reshape(-1, 3, 3)))


def _normals(corners: Floats) -> tuple[Floats, Floats]:
    """Return unit normals of triangles, with arbitrary sign, and areas."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    return cross / twice[:, None], twice / 2


def _fitted(corners: Floats) -> tuple[Floats, Floats, float] | None:
    """Return axis, centre and radius of the cylinder through vertices; None if there is none."""
    points = np.unique(corners.reshape(-1, 3), axis=0)
    enough = 8  # a cylinder has five parameters, so fewer points say little
    if len(points) < enough:
        return None
    normals, areas = _normals(corners)
    shares, vectors = np.linalg.eigh((normals * areas[:, None]).T @ normals / areas.sum())
    turned = 0.05  # smallest share of the area that faces a second direction across the axis
    if shares[1] < turned:
        return None
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    x = (points - middle) / size
    first, second, start = vectors[:, 1], vectors[:, 2], vectors[:, 0]

    def distances(p: Floats) -> Floats:
        axis = start + p[0] * first + p[1] * second
        axis = axis / np.linalg.norm(axis)
        out = x - p[2] * first - p[3] * second
        return np.asarray(np.linalg.norm(out - (out @ axis)[:, None] * axis, axis=1) - p[4])

    across = np.column_stack([x @ first, x @ second])
    squares = np.column_stack([2 * across, np.ones(len(x))])
    circle = np.linalg.lstsq(squares, (across**2).sum(axis=1), rcond=None)[0]
    radius = np.sqrt(max(circle[2] + circle[:2] @ circle[:2], 0.0))
    guess = np.array([0.0, 0.0, circle[0], circle[1], radius])
    from scipy.optimize import least_squares  # slow to import, and few cases need it

    fit = least_squares(distances, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if np.abs(distances(fit.x)).max() > NEAR * abs(fit.x[4]):
        return None
    axis = start + fit.x[0] * first + fit.x[1] * second
    axis /= np.linalg.norm(axis)
    axis *= np.sign(axis[np.argmax(np.abs(axis))])
    return axis, middle + size * (fit.x[2] * first + fit.x[3] * second), size * abs(float(fit.x[4]))


def with_common_axes(found: Sequence[FacetedCylinder]) -> list[FacetedCylinder]:
    """Return cylinders whose axes are exactly equal if they are nearly equal.

    A body that slides in several bores, or between half shells, can move only if their axes are
    exactly parallel and their centres lie on one axis.
    """
    same: list[FacetedCylinder] = []
    for one in found:
        for other in same:
            if np.linalg.norm(np.cross(one.axis, other.axis)) <= NEAR:
                one = replace(one, axis=other.axis)
                apart = one.centre - other.centre
                across = apart - (apart @ other.axis) * other.axis
                size = max(float(np.linalg.norm(apart)), one.radius)
                if np.linalg.norm(across) <= NEAR * size:
                    one = replace(one, centre=other.centre)
                    break
        same.append(one)
    return same


def _smooth(problem: Problem, found: Sequence[FacetedCylinder]) -> Constraints:
    """Return contact rows whose normals on faceted cylinders are those of the true cylinders.

    Collective.
    """
    V, constraints = problem.V, problem.constraints
    row, column, value = entries_of(constraints.B)
    radial = constraints.normal.copy()
    on = np.zeros(len(radial), dtype=np.bool_)
    for one in found:
        own, radial_there = _radial(problem, one)
        radial[own] = radial_there
        on[own] = True
    node, component = np.divmod(column, 3)
    sizes, total = unknowns(V), unknowns(V)[1] // 3
    pairs, number = np.unique(row * total + node, return_inverse=True)
    along = np.bincount(number, value * constraints.normal[row, component], len(pairs))
    of_row, of_node = np.divmod(pairs, total)
    kept = on[of_row]
    columns = (of_node[kept, None] * 3 + np.arange(3)).ravel()
    values = (along[kept, None] * radial[of_row[kept]]).ravel()
    others = ~on[row]
    rows = (len(radial), problem.comm.allreduce(len(radial)))
    entries = [
        (row[others], column[others], value[others]),
        (np.repeat(of_row[kept], 3), columns, values),
    ]
    return replace(constraints, B=matrix_of_entries(problem.comm, rows, sizes, entries))
