"""Create the problems whose limit loads are bounded, and convert their results back.

The bodies of these problems differ from the declared bodies if ground has ψ < φ, or if pore
pressures have kinks inside cells. The limit loads of these problems then bound the limit loads of
the declared bodies.

Pore pressures are enclosed between functions that are linear in each cell. Suppose that a stress is
in equilibrium, and that its effective stress σ + uδ satisfies the yield condition. Then the bodies
also carry the loads with any smaller pressure, because compression never brings ground closer to
yielding. In a mechanism, the pressure does the work ∫ u tr ε with tr ε ≥ 0, and a smaller pressure
does at most this work. Therefore a lower bound uses linear pressures above the given pressures, and
an upper bound uses linear pressures below them. Both bounds are strict.

In axisymmetry, bodies with pore pressures must preserve their volume. The pressures then do no
work, and :func:`without_pores` removes them.

The module also makes the facets of contacts and ties of plane meshes match, and glues ties. If the
two surfaces of a pair coincide, the bodies do not change. Two polygons that approximate one curve
overlap and leave gaps. For such surfaces the bounds hold for a projected model, in which each body
ends at the polygon through the nodes of both surfaces.
"""

import logging
from dataclasses import dataclass, fields, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import ROUNDING
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.point_strains import has_coefficients
from perfplast_fenicsx.limit_analysis.facets.ring_flux import by_flux, nodal_velocity
from perfplast_fenicsx.limit_analysis.facets.stress_cells import with_points_at_vertices
from perfplast_fenicsx.materials.coulomb_ground import MohrCoulomb, Tresca
from perfplast_fenicsx.materials.drucker_prager import DruckerPrager
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.nonassociated_flow import pair_of
from perfplast_fenicsx.materials.von_mises import VonMises
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit, alfeld_split
from perfplast_fenicsx.mesh.divided_surfaces import divided, farthest, surface_ends
from perfplast_fenicsx.mesh.glued_bodies import glue
from perfplast_fenicsx.mesh.ring_polynomials import coefficients_of_radius, polynomials
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.loads import EnclosedPores, Load, PorePressure
from perfplast_fenicsx.problem.problem import Problem, variant

log = logging.getLogger(__name__)

PRESSED = (Elastic, VonMises, Tresca, DruckerPrager, MohrCoulomb)
"""Laws for which an admissible stress stays admissible if a compressive pressure is added."""


@dataclass(frozen=True)
class FlowProblem:
    """The problem for which a mechanism is sought.

    Attributes:
        problem: The problem. With quadratic elements on straight cells, 3D cells are split from
            their centres, the unknown in axisymmetry is v = ru (:mod:`ring_flux`), and the flow
            rule of dilating bodies is imposed at the vertices.
        split: The mesh of split cells; None without a split.
    """

    problem: Problem
    split: AlfeldSplit | None


def flow_problem(problem: Problem) -> FlowProblem:
    """Return the problem whose mechanism gives the upper bound of a problem. Collective.

    Args:
        problem: See :func:`limit_bounds.admitted`.
    """
    straight, split = is_straight(problem), split_of(problem)
    if split is not None:
        problem = problem.on(split)
    if problem.tagged_mesh.axisymmetric and straight:
        problem = by_flux(problem)
    if straight and body_cones(problem).dilates:
        problem = with_points_at_vertices(problem)
    return FlowProblem(problem, split)


def split_of(problem: Problem) -> AlfeldSplit | None:
    """Return the mesh of split cells for strict bounds; None if cells are not split. Collective."""
    if problem.bodies.gdim == 3 and is_straight(problem):
        return alfeld_split(problem.tagged_mesh)
    return None


def is_straight(problem: Problem) -> bool:
    """Return whether the elements are quadratic on straight cells. Collective."""
    return problem.degree == 2 and not has_curved_cells(problem.tagged_mesh.mesh)


@dataclass(frozen=True)
class VelocityOf:
    """A velocity, and the problem whose displacement space contains it.

    Attributes:
        problem: The problem.
        velocity: A function in the displacement space of this problem.
    """

    problem: Problem
    velocity: fem.Function


def of_displacements(
    problem: Problem, flow: VelocityOf, mesh: LimitLoad
) -> tuple[fem.Function, LimitLoad]:
    """Return the velocity u, and the limit load with u and with the contact forces conjugate to u.

    Collective.

    Args:
        problem: Problem of the displacements u.
        flow: Flow problem with its velocity v = ru.
        mesh: Limit load of the flow problem.
    """
    velocity, forces = nodal_velocity(problem, flow.velocity), mesh.contact_forces
    rows = flow.problem.constraints
    if forces is not None and len(forces) == len(rows.host):  # one force for each pair
        told = problem.constraints
        ours, theirs = (
            it.host.astype(np.int64) * len(told.sources) + it.surface for it in (told, rows)
        )
        _, here, there = np.intersect1d(ours, theirs, return_indices=True)
        pushed = np.zeros(len(ours))  # zero on the axis, where v is held
        pushed[here] = problem.V.tabulate_dof_coordinates()[told.host[here], 0] * forces[there]
        forces = pushed
    stress = mesh.stress
    if stress is not None and has_coefficients(flow.problem):
        stress = _at_points(problem, flow.problem, stress)
    return velocity, replace(mesh, mechanism=velocity, contact_forces=forces, stress=stress)


def _at_points(problem: Problem, flow: Problem, stress: fem.Function) -> fem.Function:
    """Return a stress σ at the quadrature points, from a stress at Bernstein points. Collective.

    Args:
        problem: Problem with the quadrature points.
        flow: Flow problem on the same cells, with coefficients at its points.
        stress: Mandel vectors σ_i = S_i/ρ_i, with the coefficients S_i of S = rσ and ρ_i of r.
    """
    vertices, places = corners(problem.tagged_mesh.mesh)
    x, size = places[vertices], problem.S.dofmap.index_map_bs
    at = interpolation_points(problem.S.element)
    shares = np.hstack([1 - at.sum(axis=1, keepdims=True), at])
    given = stress.x.array.reshape(-1, size)[flow.Q.dofmap.list[: len(x)]]
    given = coefficients_of_radius(x)[..., None] * given
    found = fem.Function(problem.S, name=stress.name)
    values = np.einsum("pi,cim->cpm", polynomials(shares), given)
    values /= (x[..., 0] @ shares.T)[..., None]
    found.x.array.reshape(-1, size)[problem.Q.dofmap.list[: len(x)]] = values
    found.x.scatter_forward()
    return found


def weaker_and_stronger(problem: Problem) -> tuple[Problem, Problem]:
    """Return the problems for the lower and for the upper bound. Collective.

    Both problems have the mesh of the given problem and associated flow
    (:mod:`nonassociated_flow`).

    Args:
        problem: The bodies as they were declared.

    Returns:
        Both problems; the given problem twice if its own limit load is bounded from both sides.
    """
    pair = pair_of(problem.given.materials)
    below = above = problem
    if pair is not None:
        below, above = (variant(problem, materials=materials) for materials in pair)
    return with_enclosed_pores(below, "above"), with_enclosed_pores(above, "below")


def with_enclosed_pores(problem: Problem, side: str) -> Problem:
    """Return the problem with linear pore pressures above or below the given pressures. Collective.

    The function returns the problem itself if all pressures are linear in each cell, if a load
    grows, in axisymmetry, and on curved cells. With growing loads, one proof contains both bounds,
    which therefore need the same loads. Pressures in bodies of laws other than :data:`PRESSED` do
    not change.

    Args:
        problem: The bodies and their loads.
        side: "above" or "below": the side of the given pressures on which the linear functions lie.
    """
    bent = _bent(problem)
    if not bent:
        return problem
    loads = [enclosed_pores(load, side) if load in bent else load for load in problem.given.loads]
    return variant(problem, loads=loads)


def without_pores(problem: Problem, dilates: bool) -> Problem:
    """Return the axisymmetric problem without pore pressures. Collective.

    If bodies preserve their volume, a pore pressure does no work. Effective and total stresses then
    differ by a mean stress, which does not affect yielding.

    Args:
        problem: The bodies.
        dilates: Whether any body dilates.

    Raises:
        InputError: If a body dilates and there are pore pressures.
    """
    loads = [load for load in problem.given.loads if not isinstance(load, PorePressure)]
    if len(loads) == len(problem.given.loads):
        return problem
    if dilates:
        raise InputError(
            "in axisymmetry strict bounds do not support pore pressure in ground that dilates; "
            "remove the pressure, or give control = 'work' and until = 'limit', for the limit "
            "load of the mesh."
        )
    return Problem.from_given(problem.tagged_mesh, replace(problem.given, loads=loads))


def pores_in_words(problem: Problem) -> tuple[str, ...]:
    """Return clauses on how bounds approximate nonlinear pressures. Collective."""
    return tuple(
        f"the pore pressure in '{load.on}', which is not linear in each cell, is bounded from "
        "above for the lower bound and from below for the upper bound, so both bounds are strict"
        for load in _bent(problem)
    )


def _bent(problem: Problem) -> list[Load]:
    """Return the pore pressures that are not linear in each cell and can be enclosed.

    Collective.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    pores = [it for it in given.loads if type(it) is PorePressure and isinstance(it.value, str)]
    if not pores or not all(load.constant for load in given.loads):
        return []
    if tagged_mesh.axisymmetric or has_curved_cells(tagged_mesh.mesh):
        return []
    found: list[Load] = []
    for load in pores:
        _, _, places = cells_with_corners(tagged_mesh, load.on)
        low, high = (enclosed_pores(load, side).at_corners(places) for side in ("below", "above"))
        known = isinstance(given.materials[load.on], PRESSED) and low is not None
        apart = np.zeros(2)
        if low is not None and high is not None:
            apart[:] = (high - low).max(initial=0.0), np.abs(high).max(initial=0.0)
        problem.comm.Allreduce(MPI.IN_PLACE, apart, MPI.MAX)
        if problem.comm.allreduce(known, MPI.LAND) and apart[0] > ROUNDING * apart[1]:
            found.append(load)
    return found


def cells_with_corners(tagged_mesh: TaggedMesh, name: str) -> tuple[Ints, Ints, Floats]:
    """Return a volume's owned cells, the local vertices of these cells, and their coordinates."""
    vertices, points = corners(tagged_mesh.mesh)
    cells = tagged_mesh.cells(name)
    cells = cells[cells < len(vertices)]
    return cells, vertices[cells], points[vertices[cells]]


def enclosed_pores(load: Load, side: str) -> EnclosedPores:
    """Return linear pressures on one side of a pressure (:func:`with_enclosed_pores`)."""
    told: dict[str, Any] = {it.name: getattr(load, it.name) for it in fields(PorePressure)}
    return EnclosedPores(**told, side=side)


def on_parts(stress: Floats, split: AlfeldSplit) -> Floats:
    """Return the stress on the parts of cells as a stress on the cells of the split mesh."""
    parts = split.mesh.topology.dim + 1
    return of_parts(stress.reshape(len(stress), parts, parts, stress.shape[2]), split)


def of_parts(values: Floats, split: AlfeldSplit) -> Floats:
    """Return values of each cell's parts, (num_cells, d + 1, ...), by cell of the split mesh."""
    chosen: Floats = values[split.parents, _places(split)]
    return chosen


def by_cells(values: Floats, split: AlfeldSplit) -> Floats:
    """Return values of the split mesh's cells, grouped by parent cell.

    This function is the inverse of :func:`of_parts`.
    """
    parts = split.mesh.topology.dim + 1
    found: Floats = np.empty((len(values) // parts, parts, *values.shape[1:]))
    found[split.parents, _places(split)] = values
    return found


def of_parents(values: Floats, split: AlfeldSplit) -> Floats:
    """Return the sums of values over the parts of each cell before the split."""
    sums: Floats = np.zeros(len(values) // (split.mesh.topology.dim + 1))
    np.add.at(sums, split.parents, values)
    return sums


def _places(split: AlfeldSplit) -> npt.NDArray[np.integer]:
    """Return the index of each part in its cell."""
    original: Longs = np.asarray(split.mesh.topology.original_cell_index, dtype=np.int64)
    return original % (split.mesh.topology.dim + 1)


def with_divided_interfaces(problem: Problem) -> Problem:
    """Return the problem on a mesh with a node opposite each node of a contact or tie. Collective.

    Facets that lie on each other then match, and the tractions and velocities of both sides can be
    compared point by point. The attribute ``taken`` of the new mesh describes the differences
    between the new and the old bodies.

    Args:
        problem: The problem. It is returned unchanged without contacts and ties, in 3D, on curved
            cells, if its loads are not the declared loads, and if surfaces neither lie on each
            other nor are polygons of one curve.

    Raises:
        InputError: If a cell is so thin that moving its facet to the polygon would fold the cell.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    pairs: list[Contact | Tie] = [*given.contacts, *given.ties]
    plane = problem.bodies.gdim == 2
    if not pairs or not plane or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    finer = tagged_mesh
    for pair in pairs:
        finer = _matching(finer, pair.primary, pair.secondary)
    if finer is tagged_mesh:
        return problem
    log.info("cells at interfaces are divided to make the facets of both sides match")
    return problem.on(finer)


def _matching(tagged_mesh: TaggedMesh, primary: str, secondary: str) -> TaggedMesh:
    """Return the mesh with cells divided at one pair of surfaces. Collective."""
    one, other = (surface_ends(tagged_mesh, name) for name in (primary, secondary))
    ends = one.reshape(-1, 2), other.reshape(-1, 2)
    away = farthest(one, ends[1]), farthest(other, ends[0])
    moved = 0.0 if None in away else max(it for it in away if it is not None)
    # The limit is the distance by which rounding moves vertices off a straight surface, relative
    # to the size of the surface.
    size = max((float(it.max() - it.min()) for it in ends if len(it)), default=0.0)
    bent = moved > 1e-8 * size
    finer = divided(tagged_mesh, primary, ends[1], one if bent else None)
    finer = divided(finer, secondary, ends[0], other if bent else None)
    if not bent:
        return finer
    words = (
        f"the bounds hold for a projected model: '{primary}' and '{secondary}', whose chords"
        f" differ, are both replaced by the polygon through the nodes of both, up to {moved:.2g}"
        " away"
    )
    return replace(finer, taken=(*finer.taken, words))


def with_matching_facets(problem: Problem) -> Problem:
    """Return the problem with matching facets at contact surfaces and with glued ties. Collective.

    Facets that cannot match stay unchanged. Contact conditions apply at each node, even if the
    mortar formulation was requested.
    """
    return with_glued_ties(with_divided_interfaces(_at_each_point(problem)))


def _at_each_point(problem: Problem) -> Problem:
    """Return the problem with node-to-node contact wherever nodes match. Collective."""
    given, mesh = problem.given, problem.tagged_mesh.mesh
    in_mean = any(it.formulation == "mortar" for it in given.contacts)
    if not in_mean or not problem.as_declared or has_curved_cells(mesh):
        return problem
    contacts = [replace(it, formulation=None, hosts=None) for it in given.contacts]
    return Problem.from_given(problem.tagged_mesh, replace(given, contacts=contacts))


def with_glued_ties(problem: Problem) -> Problem:
    """Return the problem on a mesh whose cells share vertices where bodies are tied. Collective.

    If the facets of a tie match, the velocity and the tractions are the same on both sides of the
    tie, as for cells that share a facet.

    Args:
        problem: The problem. It is returned unchanged without ties, if the facets of a tie do not
            match, on curved cells, and if its loads are not the declared loads.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    if not given.ties or not problem.as_declared or has_curved_cells(tagged_mesh.mesh):
        return problem
    pairs = opposite_vertices(tagged_mesh, given.ties)
    surfaces = {name for tie in given.ties for name in (tie.primary, tie.secondary)}
    glued = glue(tagged_mesh, pairs, surfaces)
    if glued is None:
        return problem
    log.info("the facets of all ties match, and bodies share their vertices there")
    return Problem.from_given(glued, replace(given, ties=[]))
