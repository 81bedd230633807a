"""Find loads that only oblique facets of frictionless cylindrical contact carry.

A body can slide in a smooth bore along the axis, and rotate about it. Facets of an arbitrary mesh
of the bore are oblique to the axis, so the bodies interlock, and the limit load has no meaning.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import coordinate_map, entity_nodes
from perfplast_fenicsx.contact.rows.constraints import (
    Constraints,
    entries_of,
    matrix_of_entries,
    stacked,
    unknowns,
)
from perfplast_fenicsx.contact.rows.rigid_motions import RigidMotions, held_motions
from perfplast_fenicsx.problem.problem import Problem

NEAR = 1e-5
"""Distance from a cylinder up to which vertices lie on it, relative to its radius; also the
difference up to which two axes count as equal."""


@dataclass(frozen=True)
class FacetedCylinder:
    """A contact surface whose vertices lie on a cylinder, with facets oblique to the axis.

    Attributes:
        source: Number of the contact among the sources of contact rows.
        surfaces: Names of both surfaces.
        axis: Unit vector of the axis.
        centre: A point of the axis.
        tilt: Largest angle between a facet and the axis (degrees).
    """

    source: int
    surfaces: tuple[str, str]
    axis: Floats
    centre: Floats
    tilt: float


def interlocked(problem: Problem) -> str | None:
    """Return a remark if a load acts on a motion that only oblique facets resist. Collective.

    The remark names the motion, the contacts and a remedy.
    """
    found = _with_common_axes(faceted_cylinders(problem))
    if not found:
        return None
    V, bodies = problem.V, problem.bodies
    smooth = _smooth(problem, found)
    held = stacked(V, [problem.sliding, problem.ties])
    motions = RigidMotions(V, bodies, problem.fixed, smooth, held)
    free = held_motions(V, bodies, problem.free.names, motions)
    for matrix in (smooth.B, held.B, held.shares, held.weights):
        matrix.destroy()
    # smallest relative work that matters; polygons displace the resultant of a load across the axis
    much = 0.05
    moving = free.moved_by([problem.loads.dead, problem.loads.live], much)
    if not moving:
        return None
    worst = max(found, key=lambda one: one.tilt)
    one, other = worst.surfaces
    return (
        f"a load moves {moving}, and only facets of cylinders resist this motion: those of "
        f"'{one}' and '{other}' are up to {worst.tilt:.2g} degrees oblique to the axis. Smooth "
        "cylinders without friction carry no load here, so the limit load has no meaning: write "
        "[[tie]] for a thread, give the contact friction, or add a support"
    )


def faceted_cylinders(problem: Problem) -> list[FacetedCylinder]:
    """Return the frictionless contacts on cylinders with oblique facets. Collective."""
    if problem.bodies.gdim != 3 or coordinate_map(problem.tagged_mesh.mesh).degree != 1:
        return []
    names = [source.name for source in problem.constraints.sources]
    found = []
    for contact in problem.given.contacts:
        name = f"contact {contact.primary} {contact.secondary}"
        if contact.tresca or contact.coulomb or name not in names:
            continue
        corners = _corners(problem, contact.primary)
        fitted = _fitted(corners)
        if fitted is None:
            continue
        axis, centre = fitted
        tilt = float(np.degrees(np.arcsin(np.abs(_normals(corners)[0] @ axis).max())))
        slight = 0.05  # tilt (degrees) that counts as none
        if tilt > slight:
            surfaces = (contact.primary, contact.secondary)
            found.append(FacetedCylinder(names.index(name), surfaces, axis, centre, tilt))
    return found


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


def _fitted(corners: Floats) -> tuple[Floats, Floats] | None:
    """Return the axis and a point of the axis of the cylinder through vertices, if there is one."""
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
    fit = least_squares(distances, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if np.abs(distances(fit.x)).max() > NEAR * abs(fit.x[4]):
        return None
    axis = start + fit.x[0] * first + fit.x[1] * second
    axis /= np.linalg.norm(axis)
    axis *= np.sign(axis[np.argmax(np.abs(axis))])
    return axis, middle + size * (fit.x[2] * first + fit.x[3] * second)


def _with_common_axes(found: Sequence[FacetedCylinder]) -> list[FacetedCylinder]:
    """Return cylinders whose axes are exactly equal if they are nearly equal.

    A body that slides in several bores can move only if their axes are exactly parallel.
    """
    same: list[FacetedCylinder] = []
    for one in found:
        for other in same:
            if np.linalg.norm(np.cross(one.axis, other.axis)) <= NEAR:
                one = replace(one, axis=other.axis)
                apart = one.centre - other.centre
                across = apart - (apart @ other.axis) * other.axis
                size = np.linalg.norm(apart) or 1.0
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
    x = V.tabulate_dof_coordinates()[constraints.host]
    for one in found:
        own = constraints.surface == one.source
        out = x[own] - one.centre
        out -= (out @ one.axis)[:, None] * one.axis
        radial[own] = out / np.linalg.norm(out, axis=1)[:, None]
        on |= own
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
