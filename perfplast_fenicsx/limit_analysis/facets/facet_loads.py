"""Collect loads of cells and facets, in the form that cell-wise linear stresses balance."""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry
from perfplast_fenicsx.limit_analysis.facets.rigid_facets import RigidFacets, free_surfaces
from perfplast_fenicsx.problem.assembled.declared_loads import (
    ROUNDING,
    linear_pores,
    linear_tractions,
)
from perfplast_fenicsx.problem.assembled.rigid_rows import rigid_resultants
from perfplast_fenicsx.problem.declared.loads import (
    BodyForce,
    Force,
    ForceBelow,
    Load,
    PorePressure,
)
from perfplast_fenicsx.problem.problem import Problem

BENT = "a formula that is not linear"


@dataclass(frozen=True, eq=False)
class FacetLoads:
    """Loads on cells and facets; with pore pressure, stresses are effective stresses.

    Attributes:
        tractions: Cartesian tractions at the vertices in the facets' own order, shape (num_facets,
            d, d).
        forces: Forces per volume, shape (num_cells, d).
        pores: Pore pressure at the vertices of each cell, shape (num_cells, d + 1).
        wet: Whether any of the loads is a pore pressure.
        rigid_forces: Forces on free rigid surfaces, shape (num_surfaces, d).
        rigid_moments: Moments of these forces about the origin, shape (num_surfaces, 1 or 3).
        resultants: The same in the surfaces' unknowns (:meth:`RigidFacets.resultants`).
        on_rigid: Largest resultant over the area of its surface.
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
        """Return the forces of a pore pressure u: u n around each cell, and −∇u inside it.

        Args:
            slopes: Gradients ∇φ of the barycentric coordinates, shape (num_cells, d + 1, d).
            volumes: Volumes of the cells.

        Returns:
            Forces of the facet opposite each vertex, divided among its vertices in the order of the
            cell's, shape (num_cells, d + 1, d, d); and forces in each cell, shape (num_cells, d).
        """
        corners = range(slopes.shape[1])
        around = [[v for v in corners if v != facet] for facet in corners]
        outward = -slopes * volumes[:, None, None]  # with the length area / d
        on_facets = self.pores[:, around][..., None] * outward[:, :, None]
        inside = -np.einsum("cv,cvi,c->ci", self.pores, slopes, volumes)
        return on_facets, inside

    def largest(self, extent: float) -> float:
        """Return the order of the stress that the loads cause on this rank.

        It is the sum of the largest traction and pressure, of the weight of a column, and of the
        largest resultant of a rigid surface over its area.

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
    """Return sums of loads, and the load that is not linear, in words. Collective.

    Args:
        problem: The bodies.
        facets: Geometry of their facets.
        rigid: Facets of rigid surfaces.
        loads: Loads of kinds that strict bounds support.
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
