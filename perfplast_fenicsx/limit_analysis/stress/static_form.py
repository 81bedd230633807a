"""Create the equilibrium operators and the loads of a lower bound, once for each mesh.

The module computes the areas of facets and cells in the equilibrium equations, and the loads on
multipliers. In 2D and 3D, stresses are linear in the cells, and the nodes of a facet are its
vertices. In axisymmetry, rσ is quadratic, and each facet has one more node (:mod:`stress_cells`).
"""

import math
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.limit_analysis.conic.discretisation import Stiffness, Strains
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.friction_points import (
    FrictionStiffness,
    FrictionStrains,
    SlipPlaces,
)
from perfplast_fenicsx.limit_analysis.facets.bound_body import (
    BoundBody,
    FacetLoads,
    bare_vertices,
    bound_body,
)
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetVelocities
from perfplast_fenicsx.limit_analysis.facets.stress_cells import (
    NODES,
    cell_layout,
    on_facets,
    ring_forces,
)
from perfplast_fenicsx.limit_analysis.stress.condensed_stiffness import CondensedStiffness
from perfplast_fenicsx.limit_analysis.stress.multiplier_strains import MultiplierStrains
from perfplast_fenicsx.mesh.straight_geometry import facets_of, gradients
from perfplast_fenicsx.problem.problem import Problem


class StressForm:
    """Geometry of the cells that a rank owns, and of the rank's facets.

    Attributes:
        vertices: Vertices of the cells, shape (num_cells, d + 1, d).
        turned: Whether the cells are sections of rings.
        nodes: Number of nodes of a facet; its vertices come first.
        twins: Twins of the unknowns of facets, shape (num_facets, nodes, d).
        areas: Area of each node of each facet, shape (num_facets, nodes); in axisymmetry for the
            full turn.
        measures: The same areas, with nonzero values for nodes on the axis.
        sections: Section V^((d − 1)/d) of each cell; in axisymmetry multiplied by 2πr.
        slopes: Gradients of barycentric coordinates, shape (num_cells, d + 1, d).
        shares: Area of each facet of each cell divided by d, shape (num_cells, d + 1).
        volumes: Volumes of the cells; in axisymmetry areas of their sections.
    """

    def __init__(self, at: BoundBody) -> None:
        """Compute the geometry. Not collective."""
        self.vertices, self.turned, on = at.vertices, at.turned, at.numbers.facets
        tdim = self.vertices.shape[2]
        self.slopes, self.volumes = gradients(self.vertices)
        self.shares = np.linalg.norm(self.slopes, axis=2) * self.volumes[:, None]
        self.nodes = NODES if self.turned else tdim
        lengths = np.zeros((len(at.facets.held), 1))
        lengths[on, 0] = self.shares * tdim / self.nodes
        rings = np.ones((len(at.facets.held), self.nodes))
        self.twins, self.sections = at.facets.twins, self.volumes ** ((tdim - 1) / tdim)
        if self.turned:
            radii = self.vertices[..., 0]
            rings[on[..., None], at.numbers.places] = radii[:, facets_of(tdim)]
            rings[:, 2] = rings[:, :2].mean(axis=1)
            rings *= 2 * math.pi
            self.sections = self.sections * 2 * math.pi * radii.mean(axis=1)
            self.twins = _with_middles(at.facets.twins)
        some = np.where(rings > 0, rings, rings.max(axis=1, keepdims=True))
        self.areas = lengths * rings
        self.measures = lengths * np.where(some > 0, some, 1.0)

    def pushes(self, tractions: Floats, loads: FacetLoads) -> Floats:
        """Return the Cartesian loads on the nodes of facets.

        Args:
            tractions: Tractions of the loads at the vertices of facets, shape (num_cells, d + 1, d,
                d).
            loads: The loads; in axisymmetry without pore pressure.

        Returns:
            Shape (num_cells, d + 1, nodes, d).
        """
        shares = self.shares[:, :, None, None]
        if self.turned:
            radii = self.vertices[:, facets_of(2), 0]
            return np.asarray(on_facets(tractions, radii) * (4 * math.pi / NODES) * shares)
        around, _ = loads.pushes(self.slopes, self.volumes)
        return np.asarray(around + tractions * shares)

    def forces(self, loads: FacetLoads) -> Floats:
        """Return the loads on the multipliers of cells, shape (num_cells, inner).

        Args:
            loads: The loads; in axisymmetry without pore pressure.
        """
        if self.turned:
            return ring_forces(self.vertices, loads.forces)
        layout = cell_layout(self.vertices.shape[2])
        parts = layout.rows[:, 0, 0] - layout.outer
        _, inside = loads.pushes(self.slopes, self.volumes)
        inside = inside + loads.forces * self.volumes[:, None]
        found = np.zeros((len(inside), layout.inner))
        found[:, parts] = (inside / len(parts))[:, None]
        return found


def _with_middles(twins: Longs) -> Longs:
    """Return the numbers of twins, renumbered for facets with a node between their ends."""
    facet, rest = np.divmod(twins, 4)
    moved = np.where(twins >= 0, facet * 2 * NODES + rest, -1)
    middle = np.where(twins[:, 0] >= 0, facet[:, 0] * 2 * NODES + 4 + rest[:, 0] % 2, -1)
    return np.concatenate([moved, middle[:, None]], axis=1)


@dataclass(frozen=True, eq=False)
class StaticForm:
    """The data of a lower bound that do not depend on the load factor that is bounded.

    Attributes:
        comm: The ranks.
        body: The bodies.
        strains: Strain rates of the cells, without places of slip.
        stiffness: Stiffness of the cells.
        every: Strain rates at all points: the points of cells, followed by places of slip.
        whole: Stiffness with all points.
        areas: Area of each node of an owned facet, shape (num_facets, num_nodes).
        sections: Section V^((d − 1)/d) of each cell, by which forces in the cell are divided.
        live: Loads that ζ multiplies, in the user's units.
        dead: Constant loads.
        open_jumps: Owned unknowns that are contact jumps and can open.
        jumps: Flags of owned facet unknowns that are contact jumps, shape (num_unknowns,).
        slips: Flags of tangential unknowns on contact surfaces without friction.
        places: Places of slip.
    """

    comm: MPI.Intracomm
    body: BoundBody
    strains: MultiplierStrains
    stiffness: CondensedStiffness
    every: Strains
    whole: Stiffness
    areas: Floats
    sections: Floats
    live: PETSc.Vec
    dead: PETSc.Vec
    open_jumps: Ints
    jumps: npt.NDArray[np.bool_]
    slips: npt.NDArray[np.bool_]
    places: SlipPlaces

    def destroy(self) -> None:
        """Free the memory of PETSc objects. Collective."""
        for thing in (self.every, self.whole, self.live, self.dead):
            thing.destroy()


def static_form(problem: Problem) -> StaticForm:
    """Return the form of a problem's lower bound. Collective.

    Args:
        problem: The bodies and their loads.

    Raises:
        InputError: If bounds do not support the yield set of a body.
    """
    mesh, at = problem.tagged_mesh.mesh, bound_body(problem)
    tdim, on = mesh.topology.dim, at.numbers.facets
    form = StressForm(at)
    followers = at.rigid.followers(problem.comm, at.numbers, at.vertices, form.nodes)
    facets = FacetVelocities(mesh, at.numbers, form.twins.ravel(), form.nodes, followers)
    size = form.nodes * tdim
    axes = np.where(at.facets.held[:, :, None], 0.0, at.facets.axes)[on]
    turned, cones = problem.tagged_mesh.axisymmetric, body_cones(problem)
    bare = bare_vertices(problem, at, (cones.at_cells()[0] == 0) & (not turned))
    strains = MultiplierStrains(facets, at.vertices, axes, cones, bare, turned)

    num_owned = facets.count // (form.nodes * tdim)
    everywhere = np.zeros((num_owned, form.nodes, tdim), dtype=bool)
    jumps, slips, held = everywhere.copy(), everywhere.copy(), everywhere
    jumps[at.facets.hosts, :, 0] = True
    dilates, flat = at.facets.friction[:num_owned] > 0, tdim == 2
    jumps[dilates, :, :2] = flat
    slips[at.facets.in_contact, :, 1:] = True
    slips[at.facets.rubbing] = False
    on_axis = form.areas[:num_owned] == 0
    held[:] = at.facets.held[:num_owned, None] | on_axis[..., None]
    held[at.rigid.surface[:num_owned] >= 0] = True
    lead = at.rigid.lead - mesh.topology.index_map(tdim - 1).local_range[0]
    mine = np.flatnonzero((lead >= 0) & (lead < num_owned))
    lead, unknowns = lead[mine], at.rigid.free.shape[1]
    held.reshape(num_owned, size)[lead, :unknowns] = at.rigid.free[mine] == 0
    jumps &= ~on_axis[..., None]
    moves, parts_freely = _idle(strains)
    pushes = jumps.ravel() & moves & ~parts_freely
    open_jumps = np.flatnonzero(pushes).astype(np.int32)
    still = np.flatnonzero(held.ravel() | ~moves | (jumps.ravel() & ~pushes)).astype(np.int32)
    stiffness = CondensedStiffness(strains, still, open_jumps)

    places = _slip_places(at, form.areas)
    both = FrictionStrains(strains, places)
    rubs = problem.comm.allreduce(len(places.area)) > 0

    def vector(loads: FacetLoads) -> PETSc.Vec:
        tractions = np.take_along_axis(loads.tractions[on], at.numbers.places[..., None], axis=2)
        pushes = np.einsum("cfik,cfjk->cfji", axes, form.pushes(tractions, loads))
        load = strains.create_vector()
        load.array[: facets.count] = facets.add_up(pushes.reshape(len(on), -1))
        at_leads = load.array[: facets.count].reshape(-1, size)
        at_leads[lead, :unknowns] += loads.resultants[mine]
        strains.inner(load.array)[:] = form.forces(loads)
        return load

    areas = form.measures[:num_owned].copy()
    areas[lead] = at.rigid.area[mine, None] / form.nodes
    return StaticForm(
        comm=problem.comm,
        body=at,
        strains=strains,
        stiffness=stiffness,
        every=both if rubs else strains,
        whole=FrictionStiffness(stiffness, both, strains.count) if rubs else stiffness,
        areas=areas,
        sections=form.sections,
        live=vector(at.live),
        dead=vector(at.dead),
        open_jumps=open_jumps,
        jumps=jumps.ravel(),
        slips=slips.ravel() & ~held.ravel(),
        places=places,
    )


def _idle(strains: MultiplierStrains) -> tuple[PairFlags, PairFlags]:
    """Return flags of owned facet unknowns with a stress, and of jumps without one. Collective.

    Returns:
        Flags of unknowns with a stress in their row of equilibrium; flags of jumps without a stress
        on one side, and therefore without contact pressure.
    """
    facets, busy = strains.facets, ~strains.idle[:, : strains.layout.outer]
    if not facets.vector.comm.tompi4py().allreduce(bool(strains.idle.any())):
        return np.ones(facets.count, dtype=bool), np.zeros(facets.count, dtype=bool)
    sizes = busy.astype(np.float64)
    alone = facets.meet(sizes, across=False) == 0
    either = facets.meet(facets.gather(alone.astype(np.float64)), across=False) > 0
    return facets.meet(sizes) > 0, either


def _slip_places(at: BoundBody, areas: Floats) -> SlipPlaces:
    """Return the nodes of host facets with friction as places of slip.

    The strength at a place bounds the shear traction. For dilating joints in 3D, the strength is
    the sum of the adhesion and a part from pressure, and each of the two has its own place.

    Args:
        at: Conditions on facets.
        areas: Area of each node of each facet; 0 on the axis, where tractions have no area.
    """
    tdim, nodes = at.facets.held.shape[1], areas.shape[1]
    hosts = at.facets.hosts

    def nodes_of(facets: Longs) -> tuple[Longs, Longs, Floats]:
        """Return the facet, the first unknown and the area of each node of facets."""
        which = np.flatnonzero(areas[facets] > 0)
        of, places = facets[which // nodes], which % nodes
        return of, (of * nodes + places) * tdim, areas[of, places]

    of, first, area = nodes_of(hosts[at.facets.adhesion[hosts] > 0])
    shares = np.eye(tdim - 1) * ~at.facets.held[of, None, 1:]
    index = (first[:, None] + np.arange(1, tdim)).astype(np.int32)
    friction = at.facets.friction[of]
    dilates = (friction > 0) & (tdim == 2)
    if dilates.any():  # w_t = (a − b)/2μ of two unknowns
        index = np.column_stack([index, np.full(len(of), -1, dtype=np.int32)])
        shares = np.concatenate([shares, np.zeros_like(shares)], axis=2)
        index[dilates] = first[dilates, None] + np.arange(2)
        half = 0.5 / friction[dilates]
        shares[dilates, 0] = np.column_stack([half, -half])
    adheres = SlipPlaces.that_slip(index, shares, area, at.facets.adhesion[of] * area)
    if tdim == 2:
        return adheres
    of, first, area = nodes_of(hosts[at.facets.friction[hosts] > 0])
    pressed = SlipPlaces(
        index=(first[:, None] + np.arange(1, tdim)).astype(np.int32),
        shares=np.tile(np.eye(tdim - 1), (len(of), 1, 1)),
        area=area,
        bound=np.zeros(len(of)),
        closing=first.astype(np.int32),
        slope=at.facets.friction[of],
    )
    return adheres.and_those(pressed)
