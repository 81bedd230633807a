"""Compute residuals of the balance of each piece of the bodies, relative to its own loads.

Unbalanced forces that are rounding compared with all loads may be all that holds a piece with small
loads, as where it is pressed against nothing. Cells belong to one piece if facets join them.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetNumbers
from perfplast_fenicsx.mesh.connected_bodies import components


@dataclass(frozen=True, eq=False)
class Pieces:
    """Groups of cells that facets join.

    Attributes:
        comm: The ranks.
        count: Number of pieces.
        of_facets: Piece of each local facet.
        of_cells: Piece of each owned cell.
    """

    comm: MPI.Intracomm
    count: int
    of_facets: Ints
    of_cells: Ints

    @classmethod
    def of(cls, mesh: Mesh, numbers: FacetNumbers) -> "Pieces":
        """Return the pieces of a mesh. Collective."""
        index_map = mesh.topology.index_map(mesh.topology.dim - 1)
        count, of_facets = components(mesh.comm, index_map, numbers.facets)
        return cls(mesh.comm, count, of_facets, of_facets[numbers.facets[:, 0]])

    def sums(self, at_facets: Floats, in_cells: Floats) -> Floats:
        """Return sums of numbers over each piece, shape (count,). Collective.

        Args:
            at_facets: Numbers of owned facets, shape (num_facets, n).
            in_cells: Numbers of owned cells, shape (num_cells, n).
        """
        found = np.zeros(self.count)
        np.add.at(found, self.of_facets[: len(at_facets)], at_facets.sum(axis=1))
        np.add.at(found, self.of_cells, in_cells.sum(axis=1))
        self.comm.Allreduce(MPI.IN_PLACE, found, MPI.SUM)
        return found


def largest_left(forces: Floats, loads: Floats, borne: Floats) -> float:
    """Return the largest ratio of unbalanced forces to the loads of one piece.

    Args:
        forces: Unbalanced force of each piece.
        loads: Loads of each piece, contact included; a piece without loads could be free of stress.
        borne: Force that its cells can bear.
    """
    # Share of all loads whose rounding may remain in a piece, unless its cells bear less.
    of_all = 1e-3
    sizes = loads + of_all * np.minimum(loads.sum(), borne)
    loaded = loads != 0
    return float(np.max(forces[loaded] / sizes[loaded], initial=0.0))
