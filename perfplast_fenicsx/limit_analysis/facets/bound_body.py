"""Convert the bodies and loads of a problem to this rank's arrays for strict bounds.

Supports, loads and interfaces determine the conditions on cells and on the tractions on each facet.
Stress and velocity programs, error indicators, the division of corners and the proof file use these
arrays.

A few unknowns determine all velocities on the facets of a rigid surface. If a body is tied to a
rigid surface, only the resultant force and moment of the tractions are known. The multiplier of the
surface is therefore a rigid motion a + ω × (x − c), with the centre c of the surface. The unknowns
are a, and ω times the extent of the surface, both in the same unit. These 3 unknowns (6 in 3D)
replace the first unknowns of one facet of the surface. The remaining unknowns of this facet, and
the unknowns of the other facets of the surface, are zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import (
    Interface,
    InterfaceFacets,
    interfaces_of,
)
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import (
    FacetGeometry,
    FacetNumbers,
    Followers,
    facet_numbers,
)
from perfplast_fenicsx.mesh.straight_geometry import facets_of
from perfplast_fenicsx.parallel import sums_at
from perfplast_fenicsx.problem.assembled.declared_loads import (
    ROUNDING,
    linear_pores,
    linear_tractions,
)
from perfplast_fenicsx.problem.assembled.rigid_rows import moments_of, rigid_resultants
from perfplast_fenicsx.problem.declared.loads import (
    BodyForce,
    Force,
    ForceBelow,
    Load,
    PorePressure,
    is_bounded,
    is_known,
)
from perfplast_fenicsx.problem.declared.supports import RigidSurface, turned
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem

MANY = np.iinfo(np.int64).max
"""Facet number that no rank uses."""


@dataclass(frozen=True, eq=False)
class RigidFacets:
    """Facets of free rigid surfaces on this rank, and the unknowns of these surfaces.

    Attributes:
        names: Names of the surfaces.
        surface: Number of the surface of each local facet; −1 for facets that are on no rigid
            surface.
        lead: For each surface, the global number of the facet whose unknowns are its rigid motion.
        free: 1 for free unknowns and 0 for unknowns that supports hold, shape (num_surfaces, 3 or
            6).
        middle: Centre c, shape (num_surfaces, d).
        extent: Length by which rotations are scaled, shape (num_surfaces,).
        area: Area of each surface; in axisymmetry, the area of the full turn.
    """

    names: tuple[str, ...]
    surface: Longs
    lead: Longs
    free: Floats
    middle: Floats
    extent: Floats
    area: Floats

    def resultants(self, forces: Floats, moments: Floats) -> Floats:
        """Return the loads on the unknowns, shape (num_surfaces, 3 or 6).

        Args:
            forces: Forces on each surface, shape (num_surfaces, d).
            moments: Moments about the origin, shape (num_surfaces, 1 or 3).
        """
        about = moments - moments_of(self.middle, forces)
        found: Floats = np.hstack([forces, about / self.extent[:, None]]) * self.free
        return found

    def follow(self, number: int, x: Floats) -> Floats:
        """Return matrices that map a surface's unknowns to the velocities of points.

        Args:
            number: Number of the surface.
            x: Points, shape (n, d).

        Returns:
            Shape (n, d, 3 or 6).
        """
        d = x.shape[1]
        arms = (x - self.middle[number]) / self.extent[number]
        shifts = np.broadcast_to(np.eye(d), (len(x), d, d))
        turns = np.stack([turned(axis, arms) for axis in np.eye(2 * d - 3)], axis=2)
        found: Floats = np.concatenate([shifts, turns], axis=2) * self.free[number]
        return found

    def followers(
        self, comm: MPI.Intracomm, numbers: FacetNumbers, vertices: Floats, nodes: int
    ) -> Followers:
        """Return how the unknowns of cells follow the motions of rigid surfaces. Collective.

        Args:
            comm: The ranks.
            numbers: Numbers of the facets.
            vertices: Vertices of the owned cells, shape (num_cells, d + 1, d).
            nodes: Number of nodes of a facet. In axisymmetry a facet has more nodes than vertices;
                rigid surfaces do not rotate there.
        """
        d, (count, unknowns) = vertices.shape[2], self.free.shape
        others = facets_of(d)
        of_cells = self.surface[numbers.facets]
        cells = np.flatnonzero((of_cells >= 0).any(axis=1))
        shares = np.zeros((len(cells), d + 1, nodes, d, count, unknowns))
        for number in range(count):
            at, side = np.nonzero(of_cells[cells] == number)
            x = vertices[cells[at][:, None], others[side]]
            # The traction at a vertex acts on area/d, at the centre of the vertex's linear traction
            # function.
            x = (x + x.sum(axis=1, keepdims=True)) / (d + 1)
            x = np.concatenate([x, np.tile(x.mean(axis=1, keepdims=True), (nodes - d, 1))], axis=1)
            follow = self.follow(number, x.reshape(-1, d)).reshape(-1, nodes, d, unknowns)
            shares[at, side, :, :, number] = follow
        keep = np.repeat(of_cells[cells] < 0, nodes * d, axis=1).astype(np.float64)
        flat: Floats = shares.reshape(len(cells), keep.shape[1], count * unknowns)
        leads = (self.lead[:, None] * nodes * d + np.arange(unknowns)).ravel()
        tall = np.count_nonzero(flat, axis=(0, 1)).astype(np.float64)
        comm.Allreduce(MPI.IN_PLACE, tall, MPI.SUM)
        return Followers(leads, cells, keep, flat, tall)


def rigid_facets(problem: Problem, facets: FacetGeometry) -> RigidFacets:
    """Return the facets of a problem's free rigid surfaces. Collective."""
    comm, d = problem.comm, facets.tdim
    surfaces = free_surfaces(problem)
    number = np.full(facets.num, -1)
    lead = np.full(len(surfaces), MANY)
    sums = np.zeros((len(surfaces), 1 + d))
    low, high = np.full((len(surfaces), d), np.inf), np.full((len(surfaces), d), -np.inf)
    free = np.ones((len(surfaces), d + 2 * d - 3))
    for i, surface in enumerate(surfaces):
        on = facets.of(problem, surface.on)
        number[on] = i
        x = facets.corners(on)
        areas = facets.areas(on) * problem.kinematics.around(x.mean(axis=1))
        sums[i] = areas.sum(), *(areas @ x.mean(axis=1))
        if len(on):
            lead[i] = facets.index_map.local_to_global(on).min()
            low[i], high[i] = x.min(axis=(0, 1)), x.max(axis=(0, 1))
        if surface.held:
            free[i, surface.axes(d)] = free[i, d:] = 0.0
    for values, how in ((lead, MPI.MIN), (sums, MPI.SUM), (low, MPI.MIN), (high, MPI.MAX)):
        comm.Allreduce(MPI.IN_PLACE, values, how)
    area = sums[:, 0]
    middle = sums[:, 1:] / area[:, None]
    extent = np.linalg.norm(high - low, axis=1) / 2
    names = tuple(surface.on for surface in surfaces)
    return RigidFacets(names, number, lead, free, middle, extent, area)


def free_surfaces(problem: Problem) -> list[RigidSurface]:
    """Return the rigid surfaces that can move."""
    return [surface for surface in problem.given.rigid if surface.free]


BENT = "a formula that is not linear"


@dataclass(frozen=True, eq=False)
class FacetLoads:
    """Loads on cells and facets; with a pore pressure, stresses are effective stresses.

    Attributes:
        tractions: Cartesian tractions at the vertices in the facets' own order, shape (num_facets,
            d, d).
        forces: Forces per volume, shape (num_cells, d).
        pores: Pore pressure at the vertices of each cell, shape (num_cells, d + 1).
        wet: Whether any load is a pore pressure.
        rigid_forces: Forces on free rigid surfaces, shape (num_surfaces, d).
        rigid_moments: Moments of these forces about the origin, shape (num_surfaces, 1 or 3).
        resultants: Forces and moments as loads on the unknowns of the surfaces
            (:meth:`RigidFacets.resultants`).
        on_rigid: Largest resultant divided by the area of its surface (stress).
    """

    tractions: Floats
    forces: Floats
    pores: Floats
    wet: bool
    rigid_forces: Floats
    rigid_moments: Floats
    resultants: Floats
    on_rigid: float

    def pushes(self, slopes: Floats, volumes: Floats) -> tuple[Floats, Floats]:
        """Return the forces from a pore pressure u: u n on the facets, −∇u inside each cell.

        Args:
            slopes: Gradients ∇φ of the barycentric coordinates, shape (num_cells, d + 1, d).
            volumes: Volumes of the cells.

        Returns:
            Forces on the facet opposite each vertex, divided among the vertices of the facet in the
            cell's order, shape (num_cells, d + 1, d, d); and forces in each cell, shape (num_cells,
            d).
        """
        corners = range(slopes.shape[1])
        around = [[v for v in corners if v != facet] for facet in corners]
        outward = -slopes * volumes[:, None, None]  # with the length area / d
        on_facets = self.pores[:, around][..., None] * outward[:, :, None]
        inside = -np.einsum("cv,cvi,c->ci", self.pores, slopes, volumes)
        return on_facets, inside

    def largest(self, extent: float) -> float:
        """Return the order of magnitude of the stress that the loads cause on this rank.

        The result is the sum of the largest traction, the largest pore pressure, the largest force
        per volume times the extent, and the largest resultant of a rigid surface divided by its
        area.

        Args:
            extent: Extent of the bodies.
        """
        tractions = np.linalg.norm(self.tractions, axis=2).max(initial=0.0)
        forces = np.linalg.norm(self.forces, axis=1).max(initial=0.0)
        pores = np.abs(self.pores).max(initial=0.0)
        return float(tractions + pores + forces * extent + self.on_rigid)


def loads_of(
    problem: Problem, facets: FacetGeometry, rigid: RigidFacets, loads: Sequence[Load]
) -> tuple[FacetLoads, str | None]:
    """Return the sums of loads, and a clause on the first nonlinear load (or None). Collective.

    Args:
        problem: The bodies.
        facets: Geometry of the facets of the bodies.
        rigid: Facets of rigid surfaces.
        loads: Loads, all of kinds that strict bounds support.
    """
    count, corners, tdim = facets.vertices.shape
    values = np.zeros((facets.num, tdim, tdim))
    forces, pores = np.zeros((count, tdim)), np.zeros((count, corners))
    sizes = np.zeros((2, len(loads)))
    for number, load in enumerate(loads):
        if isinstance(load, BodyForce):
            cells = problem.tagged_mesh.cells(load.on)
            cells = cells[cells < count]
            if isinstance(load, ForceBelow):
                cells = cells[load.cells_below(facets.vertices[cells])]
            forces[cells] += np.asarray(load.value, dtype=np.float64)
            continue
        if isinstance(load, PorePressure):
            cells = problem.tagged_mesh.cells(load.on)
            cells = cells[cells < count]
            there, off = linear_pores(load, facets.vertices[cells])
            pores[cells] += there
        elif isinstance(load, Force):
            continue
        else:
            on = facets.of(problem, load.on)
            there, off = linear_tractions(load, facets.corners(on), facets.normals(on))
            values[on] += there
        sizes[:, number] = np.abs(there).max(initial=0.0), off.max(initial=0.0)
    problem.comm.Allreduce(MPI.IN_PLACE, sizes, MPI.MAX)
    bent = [loads[number] for number in np.flatnonzero(sizes[1] > ROUNDING * sizes[0])]
    words = None
    if bent:
        where = "in each cell" if isinstance(bent[0], PorePressure) else "on each facet"
        words = f"the load on '{bent[0].on}' is {BENT} {where}"
    on_surfaces = rigid_resultants(free_surfaces(problem), loads, tdim)
    resultants = rigid.resultants(*on_surfaces)
    on_rigid = float((np.linalg.norm(resultants, axis=1) / rigid.area).max(initial=0.0))
    wet = any(isinstance(load, PorePressure) for load in loads)
    return FacetLoads(values, forces, pores, wet, *on_surfaces, resultants, on_rigid), words


Flags = npt.NDArray[np.bool_]

UNMATCHED = "surfaces in contact do not match facet by facet"

OBLIQUE = "a support holds a surface in contact obliquely to its normal"

VARYING = "a load is a force per volume that is given as a formula"

UNKNOWN = "a load is of a kind that strict bounds do not support"

TWICE = "a surface is in contact with more than one other surface"

RIGID = "a surface is rigid and in contact, where only the resultant of the tractions is known"

TIED = "surfaces are tied together only in the mean"

HELD = "supports hold surfaces in contact, on both sides or along their normal"


@dataclass(frozen=True, eq=False)
class BoundBody:
    """Data of the local facets, including ghosts, and of the cells that this rank owns.

    Attributes:
        numbers: Numbers of the facets.
        geometry: Geometry of the outer facets.
        vertices: Vertices of the owned cells, in the order of their geometry, shape (num_cells, d +
            1, d).
        supported: Flags of the Cartesian components that supports hold, shape (num_facets, d);
            False on free rigid surfaces.
        guided: Unit vectors along which roller supports hold facets, shape (num_facets, d); 0 on
            other facets.
        live: Loads that ζ multiplies, at ζ = 1.
        dead: Constant loads.
        rigid: Facets of free rigid surfaces.
        interfaces: Contacts, followed by obstacles.
        facets: Supports and interfaces of the facets, including facets of rigid surfaces.
        why_not: Reasons why bounds do not hold for the true bodies.
        prevents: Reason why strict bounds are not possible; None if they are possible.
        turned: Whether the bodies are bodies of revolution.
    """

    numbers: FacetNumbers
    geometry: FacetGeometry
    vertices: Floats
    supported: Flags
    guided: Floats
    live: FacetLoads
    dead: FacetLoads
    rigid: RigidFacets
    interfaces: Sequence[Interface]
    facets: InterfaceFacets
    why_not: tuple[str, ...]
    prevents: str | None
    turned: bool


@once_a_problem
def bound_body(problem: Problem) -> BoundBody:
    """Return the arrays of a problem for strict bounds; they are computed once for each problem.

    Collective.
    """
    mesh, given = problem.tagged_mesh.mesh, problem.given
    tdim = mesh.topology.dim
    numbers = facet_numbers(mesh)
    nodes = geometry_dofmap(mesh)[: len(numbers.facets), : tdim + 1]
    vertices: Floats = np.asarray(mesh.geometry.x[nodes][:, :, :tdim], dtype=np.float64)
    facets = FacetGeometry(problem, numbers, vertices)
    held, rigid = _held(problem, facets), rigid_facets(problem, facets)
    known = [load for load in given.loads if is_bounded(load)]
    live, dead = (
        loads_of(problem, facets, rigid, [load for load in known if load.constant is constant])
        for constant in (False, True)
    )
    bent = live[1] or dead[1]
    unknown = not all(is_known(load) for load in given.loads)
    varies = not unknown and len(known) < len(given.loads)
    guided = _guided(problem, facets)
    interfaces, at = interfaces_of(problem), InterfaceFacets.none(held, guided)
    for interface in interfaces:
        at.add(problem, facets, interface)
    curved = any(it.obstacle is not None and it.into is None for it in interfaces)
    faults = {
        RIGID: bool((rigid.surface[at.in_contact] >= 0).any()),
        TIED: len(given.ties) > 0,
        VARYING: varies,
        UNKNOWN: unknown,
        str(bent): bent is not None,
        UNMATCHED: not at.matched,
        OBLIQUE: at.oblique,
        HELD: at.both_held or bool(guided[at.in_contact].any()),
        TWICE: len(np.unique(at.in_contact)) < len(at.in_contact),
    }
    found = [words for words, is_so in faults.items() if problem.comm.allreduce(is_so)]
    return BoundBody(
        numbers=numbers,
        geometry=facets,
        vertices=vertices,
        supported=held & (rigid.surface < 0)[:, None],
        guided=guided,
        live=live[0],
        dead=dead[0],
        rigid=rigid,
        interfaces=interfaces,
        facets=at,
        why_not=(CURVED,) if curved else (),
        prevents=found[0] if found else None,
        turned=problem.tagged_mesh.axisymmetric,
    )


def _guided(problem: Problem, facets: FacetGeometry) -> Floats:
    """Return the directions along which roller supports hold facets, the same on all ranks.

    Collective.
    """
    guides = problem.guides
    found = np.zeros((facets.num, facets.tdim))
    for surface, normal in zip(guides.surfaces, guides.normals, strict=True):
        flags = sums_at(facets.index_map, 1, (problem.tagged_mesh.facets(surface), 1.0))
        found[flags[:, 0] > 0] = normal
    return found


def _held(problem: Problem, facets: FacetGeometry) -> Flags:
    """Return flags of the components that supports hold, the same on all ranks. Collective."""
    tdim = facets.tdim
    flags = la.vector(facets.index_map, tdim)
    array = flags.array.reshape(-1, tdim)
    for support in problem.given.holding:
        on = problem.tagged_mesh.facets(support.on)
        for axis in support.axes(tdim):
            array[on, axis] = 1.0
    flags.scatter_reverse(la.InsertMode.add)
    flags.scatter_forward()
    held: Flags = flags.array.reshape(-1, tdim) > 0
    return held


def bare_vertices(
    problem: Problem, at: BoundBody, loose: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return flags of vertices without stress in this rank's cells. Collective.

    On a free facet, σn = 0, so one principal stress is zero. Without cohesion, the yield condition
    then requires σ = 0. At this vertex, the tractions on all other facets of the cell are then zero
    too, and so is σ in the neighbouring cells. With a pore pressure this does not hold, because
    yielding depends on effective stresses. Stresses at these vertices are not unknowns of a lower
    bound, because their yield set has no interior.

    Args:
        problem: The bodies.
        at: Conditions on the facets of the bodies.
        loose: Flags of the cells without cohesion, shape (num_cells,).

    Returns:
        Flags, shape (num_cells, d + 1).
    """
    topology, on = problem.tagged_mesh.mesh.topology, at.numbers.facets
    tdim = topology.dim
    exterior = np.isin(on, exterior_facet_indices(topology))
    free = (
        exterior
        & ~at.facets.held[on].any(axis=2)
        & ~np.isin(on, at.facets.in_contact)
        & loose[:, None]
    )
    free &= at.rigid.surface[on] < 0
    pushed = (at.live.tractions != 0).any(axis=2) | (at.dead.tractions != 0).any(axis=2)
    vertices: Longs = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[: len(on)]
    others = facets_of(tdim)
    bare = free[:, :, None] & ~np.take_along_axis(pushed[on], at.numbers.places, axis=2)
    wet = (at.live.pores != 0) | (at.dead.pores != 0)
    bare &= ~wet[:, others]
    flags = sums_at(topology.index_map(0), 1, (vertices[:, others][bare], 1.0))[:, 0]
    found: npt.NDArray[np.bool_] = (flags[vertices] > 0) & loose[:, None]
    return found
