"""Match facets of bodies in contact with opposite facets, and their nodes with each other."""

from dataclasses import dataclass
from itertools import combinations

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.limit_analysis.facets.contact_facets import contact_facets
from perfplast_fenicsx.limit_analysis.facets.face_jumps import least_speed
from perfplast_fenicsx.limit_analysis.facets.facing_vertices import REACH, facing_vertices, fit
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class MatchedFacets:
    """Pairs of facets, each on one rank; nodes are vertices and then, in order, midsides.

    Attributes:
        first: Global numbers of the primary facet's nodes, shape (n, num_nodes).
        second: Global numbers of the opposite nodes, in the same order.
        held_first: Flags of components that supports hold, shape (n, num_nodes, d).
        held_second: The same for the opposite nodes.
        normals: Unit normals out of the primary body, shape (n, d).
        jumps: Jumps u_first − u_second (length) of a displacement, shape (n, num_nodes, d).
        speeds: Largest component of the displacement on both facets, at least
            :func:`face_jumps.least_speed`, shape (n,).
    """

    first: Longs
    second: Longs
    held_first: npt.NDArray[np.bool_]
    held_second: npt.NDArray[np.bool_]
    normals: Floats
    jumps: Floats
    speeds: Floats

    def edges(self) -> list[tuple[int, int]]:
        """Return pairs of vertex positions between which the midsides lie, in their order."""
        d = self.normals.shape[1]
        return list(combinations(range(d), 2)) if self.first.shape[1] > d else []

    def coefficients(self) -> Floats:
        """Return Bernstein coefficients of the jumps along the normals, shape (n, num_nodes)."""
        along: Floats = np.einsum("fni,fi->fn", self.jumps, self.normals)
        found = along.copy()
        for node, (a, b) in enumerate(self.edges(), start=self.normals.shape[1]):
            found[:, node] = 2 * along[:, node] - (along[:, a] + along[:, b]) / 2
        return found

    def entered(self) -> float:
        """Return the largest penetration relative to the velocities of its facet, on this rank."""
        most = self.coefficients().max(axis=1, initial=0.0)
        found = np.divide(most, self.speeds, out=np.zeros_like(most), where=self.speeds > 0)
        return float(found.max(initial=0.0))


def matched_facets(
    problem: Problem, displacement: fem.Function | None = None
) -> list[MatchedFacets] | None:
    """Return the matched facets of each contact, as its surfaces are declared. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        displacement: Displacement of the jumps; zero by default.

    Returns:
        A list with an entry for each contact; None if facets of a contact do not match.
    """
    comm = problem.comm
    rows = _rows(problem, displacement)
    slowest = 0.0 if displacement is None else least_speed(problem, displacement)
    found = []
    for contact in problem.given.contacts:
        tags = [problem.tagged_mesh.tags_of([it]) for it in (contact.primary, contact.secondary)]
        primary, secondary = (rows[np.isin(rows["tag"], some)] for some in tags)
        gdim = rows["normal"].shape[1]
        low, high = bounding_box(comm, np.concatenate([primary["x"], secondary["x"]]))
        reach = REACH * float(np.linalg.norm(high - low))
        matching = match_nodes(comm, primary, secondary, reach)
        a, b = matching.primary, matching.secondary
        corners = a["at"][:, :gdim]
        order, off = facing_vertices(corners, b["at"][:, :gdim], a["normal"])
        same = bool(fit(corners, off, a["normal"], b["normal"]).all())
        if matching.alone or not comm.allreduce(same, MPI.LAND):
            return None
        nodes = _with_midsides(order, a["nodes"].shape[1])

        def opposite(values: npt.NDArray, nodes: Longs = nodes) -> npt.NDArray:
            return values[np.arange(len(nodes))[:, None], nodes]

        found.append(
            MatchedFacets(
                a["nodes"],
                opposite(b["nodes"]),
                a["held"],
                opposite(b["held"]),
                a["normal"],
                a["u"] - opposite(b["u"]),
                np.maximum(np.abs(np.stack([a["u"], b["u"]])).max(axis=(0, 2, 3)), slowest),
            )
        )
    return found


def _rows(problem: Problem, displacement: fem.Function | None) -> npt.NDArray[np.void]:
    """Return owned facets in contact as rows that are exchanged between ranks. Collective."""
    facets = contact_facets(problem)
    gdim = facets.normals.shape[1]
    middles = np.take_along_axis(facets.nodes, facets.middles, axis=1)
    nodes = np.concatenate([facets.nodes[:, :gdim], middles], axis=1)[facets.areas > 0]
    count = nodes.shape[1]
    rows = np.zeros(
        len(nodes),
        dtype=[
            ("x", np.float64, 3),
            ("normal", np.float64, gdim),
            ("at", np.float64, (count, gdim)),
            ("nodes", np.int64, count),
            ("held", np.bool_, (count, gdim)),
            ("u", np.float64, (count, gdim)),
            ("tag", np.int32),
        ],
    )
    x = problem.V.tabulate_dof_coordinates()
    rows["at"] = x[nodes][..., :gdim]
    rows["x"] = x[nodes[:, :gdim]].mean(axis=1)
    rows["normal"] = facets.normals[facets.areas > 0]
    numbers = problem.V.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32))
    rows["nodes"] = numbers.reshape(nodes.shape)
    rows["held"] = problem.fixed[nodes]
    if displacement is not None:
        rows["u"] = displacement.x.array.reshape(-1, gdim)[nodes]
    rows["tag"] = facets.tags[facets.areas > 0]
    return rows


def _with_midsides(order: Longs, count: int) -> Longs:
    """Return the order of all nodes, given that of the vertices."""
    d = order.shape[1]
    place = np.zeros((d, d), dtype=np.int64)
    for node, (a, b) in enumerate(combinations(range(d), 2), start=d):
        place[a, b] = place[b, a] = node
    edges = combinations(range(d), 2)
    middles = [place[order[:, a], order[:, b]] for a, b in edges] if count > d else []
    return np.column_stack([order, *middles]).astype(np.int64)
