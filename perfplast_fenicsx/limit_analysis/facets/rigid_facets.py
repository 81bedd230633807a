"""Let all velocities on facets of rigid surfaces follow a few unknowns.

For a body that is glued to such a surface, only force and moment of the tractions are known. So the
multiplier of the surface is a rigid motion a + ω × (x − c), with the centre c of the surface. ω is
divided by the surface's extent, to have the units of the other unknowns. These 3 unknowns (6 in
space) replace the first ones of one of its facets. The remaining unknowns there, and on its other
facets, are zero.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetNumbers, Followers
from perfplast_fenicsx.problem.assembled.rigid_rows import moments_of
from perfplast_fenicsx.problem.declared.supports import RigidSurface, turned
from perfplast_fenicsx.problem.problem import Problem

MANY = np.iinfo(np.int64).max
"""Facet number that is on no rank."""


@dataclass(frozen=True, eq=False)
class RigidFacets:
    """Free rigid surfaces as facets of this rank.

    Attributes:
        names: Names of the surfaces.
        surface: Number of the surface of each local facet, −1 for none.
        lead: Global number of the facet that has the unknowns of each surface.
        free: 1 for existing unknowns and 0 for others, shape (num_surfaces, 3 or 6).
        middle: Centre c, shape (num_surfaces, d).
        extent: Length by which rotations are scaled.
        area: Area of each surface; around an axis that of the full turn.
    """

    names: tuple[str, ...]
    surface: Longs
    lead: Longs
    free: Floats
    middle: Floats
    extent: Floats
    area: Floats

    def resultants(self, forces: Floats, moments: Floats) -> Floats:
        """Return the loads of the unknowns, shape (num_surfaces, 3 or 6).

        Args:
            forces: Forces on each surface, shape (num_surfaces, d).
            moments: Moments about the origin, shape (num_surfaces, 1 or 3).
        """
        about = moments - moments_of(self.middle, forces)
        found: Floats = np.hstack([forces, about / self.extent[:, None]]) * self.free
        return found

    def follow(self, number: int, x: Floats) -> Floats:
        """Return the velocities of points of a surface as linear functions of its unknowns.

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
        """Return cells at rigid surfaces. Collective.

        Args:
            comm: The ranks.
            numbers: Numbers of the facets.
            vertices: Vertices of the owned cells, shape (num_cells, d + 1, d).
            nodes: Nodes of a facet; more than its vertices around an axis, where no surface
                rotates.
        """
        d, (count, unknowns) = vertices.shape[2], self.free.shape
        others = np.array([[b for b in range(d + 1) if b != a] for a in range(d + 1)])
        of_cells = self.surface[numbers.facets]
        cells = np.flatnonzero((of_cells >= 0).any(axis=1))
        shares = np.zeros((len(cells), d + 1, nodes, d, count, unknowns))
        for number in range(count):
            at, side = np.nonzero(of_cells[cells] == number)
            x = vertices[cells[at][:, None], others[side]]
            # a vertex has area/d of its traction, at the point where this is the integral of its
            # linear function
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
    """Return the rigid surfaces that loads can move."""
    return [surface for surface in problem.given.rigid if surface.free]
