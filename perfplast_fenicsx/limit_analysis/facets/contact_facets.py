"""Match facets of surfaces in contact, and evaluate jumps of a velocity on them.

The module evaluates jumps on flat contact faces by Bernstein coefficients (:mod:`entering`), in the
same way as the proof checker.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import Flags, match_facets
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry, facet_numbers
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.parallel import Exchange, send_rows
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class ContactFacets:
    """Contact facets of this rank's cells.

    Attributes:
        nodes: Nodes of each facet, shape (num_facets, num_nodes): its vertices, and with quadratic
            elements the midpoints of its edges, in the order of pairs of vertices.
        cells: Cells of the facets.
        sides: Index of the vertex opposite each facet in its cell.
        areas: Areas. In axisymmetry, areas of the full turn at the radius of the facet's midpoint,
            0 on the axis.
        normals: Unit normals that point out of the cells, shape (num_facets, d).
        tags: Tags of the surfaces.
    """

    nodes: Ints
    cells: Longs
    sides: Longs
    areas: Floats
    normals: Floats
    tags: Ints

    def edges(self, chosen: PairFlags | slice = slice(None)) -> Ints:
        """Return the midside and end nodes of edges of chosen facets, shape (num_edges, 3)."""
        nodes, d = self.nodes[chosen], self.normals.shape[1]
        found: list[Ints] = [np.zeros((0, 3), dtype=np.int32)]
        for (a, b), at in zip(combinations(range(d), 2), nodes[:, d:].T, strict=False):
            found.append(np.column_stack([at, nodes[:, a], nodes[:, b]]))
        edges: Ints = np.unique(np.concatenate(found), axis=0)
        return edges


@once_a_problem
def contact_facets(problem: Problem) -> ContactFacets:
    """Return the contact facets of a problem. Collective."""
    V, tagged_mesh = problem.V, problem.tagged_mesh
    vertices, places = corners(V.mesh)
    geometry, tdim = (
        FacetGeometry(problem, facet_numbers(V.mesh), places[vertices]),
        V.mesh.topology.dim,
    )
    tags = tagged_mesh.facet_tags
    touching = np.isin(tags.values, problem.contact_tags)
    touching &= np.isin(tags.indices, geometry.exterior)
    facets = tags.indices[touching]
    cells, sides = geometry.cell[facets], geometry.side[facets]
    layout = V.dofmap.dof_layout
    closure = np.array([layout.entity_closure_dofs(tdim - 1, i) for i in range(tdim + 1)])
    closure[:, tdim:] = closure[
        :, : tdim - 1 : -1
    ]  # the last edge of a cell has the first vertices
    nodes: Ints = V.dofmap.list[cells[:, None], closure[sides]]
    middles = V.tabulate_dof_coordinates()[nodes, :tdim].mean(axis=1)
    return ContactFacets(
        nodes=nodes,
        cells=cells,
        sides=sides,
        areas=geometry.areas(facets) * problem.kinematics.around(middles),
        normals=geometry.normals(facets),
        tags=tags.values[touching],
    )


SAME = 1e-9
"""Normals whose components differ by less than this number count as equal."""

UNSEEN = 5e-13
"""Largest allowed penetration rate, relative to the velocities at a facet: half of the proof
checker's limit.
"""


@dataclass(frozen=True, eq=False)
class FaceJumps:
    """The jump of a velocity on the facets of one flat face.

    Attributes:
        source: Number of the contact or obstacle among the sources of constraints.
        normal: Normal of the pairs on the face, shape (d,). A jump along this normal is positive
            where bodies penetrate each other.
        here: Flags of the contact facets (:func:`contact_facets`) on the face.
        moves: Flags of local nodes that have no pair of this face and are not completely held by
            supports.
        w: Bernstein coefficients of the jump at local nodes, shape (num_nodes, d); 0 where supports
            prevent penetration.
        along: Components of the jump along the facets' own normals, shape (here.sum(),
            num_nodes_of_facet).
        across: Norms of the tangential components of the jump, same shape.
        speeds: Largest velocity component on each facet and its opposite facet, shape
            (here.sum(),).
    """

    source: int
    normal: Floats
    here: PairFlags
    moves: PairFlags
    w: Floats
    along: Floats
    across: Floats
    speeds: Floats

    def entered(self, friction: float = 0.0) -> float:
        """Return the largest penetration, relative to the velocities at its facet.

        Args:
            friction: Coefficient μ of Coulomb's friction. If μ > 0, a separation that is too small
                for associated slip counts as penetration.
        """
        most = (self.along + friction * self.across).max(axis=1, initial=0.0)
        found = np.divide(most, self.speeds, out=np.zeros_like(most), where=self.speeds > 0)
        return float(found.max(initial=0.0))


def face_jumps(problem: Problem, velocity: fem.Function) -> Iterator[FaceJumps]:
    """Yield the jumps of each face in turn. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity whose ghosts are up to date.
    """
    faces = flat_faces(problem)
    if faces is None or not len(faces):
        return
    facets, constraints = contact_facets(problem), problem.constraints
    nodes, fixed, paired = facets.nodes, problem.fixed, has_pair(problem)
    values = velocity.x.array.reshape(fixed.shape)
    jumps = [_times(constraints.weights, of) for of in values.T]
    sizes = np.abs(values).max(axis=1, initial=0.0)
    at_host = sizes[constraints.host]  # and beside: the largest component at each pair
    beside = np.maximum(at_host, _times(constraints.shares, sizes) - at_host)
    beside = np.maximum(beside, least_speed(problem, velocity))
    for face in faces:
        chosen, normal = rows_of(problem, face), face[1:]
        of = [at_nodes(problem, values, chosen) for values in (*jumps, beside)]
        w, known = np.column_stack([values for values, _ in of[:-1]]), of[0][1]
        kept = ~paired & (fixed | (np.abs(normal) <= SAME)).all(axis=1)
        here = known[nodes].any(axis=1) & (known | kept)[nodes].all(axis=1)
        if problem.degree == 2:
            middle, *ends = facets.edges(here).T
            w[middle] = 2 * w[middle] - (w[ends[0]] + w[ends[1]]) / 2
        own, at = facets.normals[here], w[nodes[here]]
        own = own * np.sign(own @ normal)[:, None]
        along = np.einsum("fni,fi->fn", at, own)
        across = np.linalg.norm(at - along[:, :, None] * own[:, None], axis=2)
        speeds = np.maximum(sizes, of[-1][0])[nodes[here]].max(axis=1, initial=0.0)
        moves = ~known & ~fixed.all(axis=1)
        yield FaceJumps(int(face[0]), normal, here, moves, w, along, across, speeds)


@once_a_problem
def has_pair(problem: Problem) -> PairFlags:
    """Return flags of the local nodes, including ghosts, that have a pair. Collective."""
    every = np.ones(len(problem.constraints.host), dtype=bool)
    return at_nodes(problem, np.zeros(len(every)), every)[1]


def _times(matrix: PETSc.Mat, values: Floats) -> Floats:
    """Return the product of a matrix and values at local nodes, shape (num_rows,). Collective."""
    on_nodes, on_rows = matrix.createVecs()
    on_nodes.array[:] = values[: on_nodes.getLocalSize()]
    matrix.mult(on_nodes, on_rows)
    found: Floats = on_rows.array_r.copy()
    for vector in (on_nodes, on_rows):
        vector.destroy()
    return found


def least_speed(problem: Problem, velocity: fem.Function) -> float:
    """Return the lower limit of the speeds by which jumps are divided. Collective.

    Without this limit, rounding errors of the largest velocity would count as penetration of slow
    bodies.
    """
    slowest = 1e-8  # share of the largest velocity, as in the proof checker
    mine = float(np.abs(velocity.x.array).max(initial=0.0))
    return slowest * float(problem.comm.allreduce(mine, MPI.MAX))


@once_a_problem
def flat_faces(problem: Problem) -> Floats | None:
    """Return the distinct rows (contact number, normal) of all pairs. Collective.

    The function returns None if there are too many rows, because the surfaces are then curved.
    """
    constraints = problem.constraints
    mine = _distinct(np.column_stack([constraints.surface, constraints.normal]))
    most_faces = 64  # surfaces with more different normals count as curved
    faces = _distinct(np.concatenate(problem.comm.allgather(mine[: most_faces + 1])))
    return faces if len(faces) <= most_faces else None


def rows_of(problem: Problem, face: Floats) -> PairFlags:
    """Return flags of the pairs that belong to a flat face."""
    rows = np.column_stack([problem.constraints.surface, problem.constraints.normal])
    return np.asarray((np.abs(rows - face) <= SAME).all(axis=1))


def _distinct(rows: Floats) -> Floats:
    """Return one row from each set of rows that are equal up to rounding."""
    _, first = np.unique(np.round(rows / SAME / 100), axis=0, return_index=True)
    return rows[first]


def at_nodes(problem: Problem, jumps: Floats, chosen: PairFlags) -> tuple[Floats, PairFlags]:
    """Return jumps of chosen pairs at all their nodes, and flags of these nodes. Collective.

    Returns:
        Values for each local node, including ghosts; 0 or False at nodes without a chosen pair. At
        a node of several chosen pairs, the jump is a weighted mean.
    """
    shares = problem.constraints.shares
    on_nodes, on_rows = shares.createVecs()

    def summed(values: Floats) -> Floats:
        on_rows.array[:] = values
        shares.multTranspose(on_rows, on_nodes)
        sums = la.vector(problem.V.dofmap.index_map, 1)
        sums.array[: on_nodes.getLocalSize()] = on_nodes.array_r
        sums.scatter_forward()
        return np.array(sums.array, dtype=np.float64)

    jump, weight = summed(np.where(chosen, jumps, 0.0)), summed(chosen.astype(np.float64))
    for thing in (on_nodes, on_rows):
        thing.destroy()
    known: PairFlags = weight > 0
    jump[known] /= weight[known]
    return jump, known


@dataclass(frozen=True, eq=False)
class MatchedFacets:
    """Pairs of opposite facets, each on one rank; their nodes are the vertices, then the midsides.

    Attributes:
        nodes: Global numbers of opposite nodes, the primary facet's node first, shape (n,
            num_nodes, 2).
        held: Flags of components that supports hold at these nodes, shape (n, num_nodes, 2, d).
        normals: Unit normals out of the primary body, shape (n, d).
        jumps: Jumps u_first − u_second (length) of a displacement, shape (n, num_nodes, d).
        speeds: Largest displacement component on both facets, at least :func:`least_speed`, shape
            (n,).
    """

    nodes: Longs
    held: Flags
    normals: Floats
    jumps: Floats
    speeds: Floats

    def edges(self) -> list[tuple[int, int]]:
        """Return the columns of the vertices at both ends of each midside's edge, by midside."""
        d = self.normals.shape[1]
        return list(combinations(range(d), 2)) if self.nodes.shape[1] > d else []

    def coefficients(self) -> Floats:
        """Return Bernstein coefficients of the jumps along normals, shape (n, num_nodes)."""
        along: Floats = np.einsum("fni,fi->fn", self.jumps, self.normals)
        found = along.copy()
        for node, (a, b) in enumerate(self.edges(), start=self.normals.shape[1]):
            found[:, node] = 2 * along[:, node] - (along[:, a] + along[:, b]) / 2
        return found

    def entered(self) -> float:
        """Return this rank's largest penetration, relative to the velocities at its facet."""
        most = self.coefficients().max(axis=1, initial=0.0)
        found = np.divide(most, self.speeds, out=np.zeros_like(most), where=self.speeds > 0)
        return float(found.max(initial=0.0))


def matched_facets(
    problem: Problem, displacement: fem.Function | None = None
) -> list[MatchedFacets] | None:
    """Return the matched facets of each contact, in the order of its declared surfaces. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        displacement: Displacement from which jumps are computed; zero by default.

    Returns:
        A list with an entry for each contact; None if facets of a contact do not match.
    """
    rows = _rows(problem, displacement)
    slowest = 0.0 if displacement is None else least_speed(problem, displacement)
    found = []
    for contact in problem.given.contacts:
        tags = [problem.tagged_mesh.tags_of([it]) for it in (contact.primary, contact.secondary)]
        primary, secondary = (rows[np.isin(rows["tag"], some)] for some in tags)
        matched = match_facets(problem.comm, primary, secondary)
        if matched is None:
            return None
        a, b, order = matched
        there = np.arange(len(order))[:, None], _with_midsides(order, a["nodes"].shape[1])
        found.append(
            MatchedFacets(
                np.stack([a["nodes"], b["nodes"][there]], axis=2),
                np.stack([a["held"], b["held"][there]], axis=2),
                a["normal"],
                a["u"] - b["u"][there],
                np.maximum(np.abs(np.stack([a["u"], b["u"]])).max(axis=(0, 2, 3)), slowest),
            )
        )
    return found


def _rows(problem: Problem, displacement: fem.Function | None) -> npt.NDArray[np.void]:
    """Return the owned contact facets as rows that the ranks exchange. Collective."""
    facets = contact_facets(problem)
    gdim = facets.normals.shape[1]
    nodes = facets.nodes[facets.areas > 0]
    count = nodes.shape[1]
    rows = np.zeros(
        len(nodes),
        dtype=[
            ("x", np.float64, 3),
            ("normal", np.float64, gdim),
            ("corners", np.float64, (gdim, gdim)),
            ("nodes", np.int64, count),
            ("held", np.bool_, (count, gdim)),
            ("u", np.float64, (count, gdim)),
            ("tag", np.int32),
        ],
    )
    x = problem.V.tabulate_dof_coordinates()
    rows["corners"] = x[nodes[:, :gdim], :gdim]
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
    """Return the order of all nodes that corresponds to an order of the vertices."""
    d = order.shape[1]
    place = np.zeros((d, d), dtype=np.int64)
    for node, (a, b) in enumerate(combinations(range(d), 2), start=d):
        place[a, b] = place[b, a] = node
    edges = combinations(range(d), 2)
    middles = [place[order[:, a], order[:, b]] for a, b in edges] if count > d else []
    return np.column_stack([order, *middles]).astype(np.int64)


Record = npt.NDArray[np.void]


@dataclass(frozen=True, eq=False)
class FacingNodes:
    """Pairs of opposite nodes; the rank that owns the first node stores the pair.

    Attributes:
        nodes: Global numbers of both nodes, shape (n, 2).
        ends: For midsides, the pairs at both ends of the edge, shape (n, 2, 2); −1 for vertices.
        held: Flags of components that supports hold at either node, shape (n, 2, d).
        normals: Normals of all facets around the pair, out of the first node's body, shape (n,
            most, d); components that supports hold on both sides are zero.
        known: Flags of the existing normals, shape (n, most).
        contact: Smallest number among the contacts to which the pair belongs, shape (n,).
        crowded: Flags of pairs with a node that belongs to several pairs, shape (n,).
    """

    nodes: Longs
    ends: Longs
    held: Flags
    normals: Floats
    known: Flags
    contact: Longs
    crowded: Flags

    def __len__(self) -> int:
        return len(self.nodes)


def owners(problem: Problem, nodes: Longs) -> Longs:
    """Return the ranks that own the nodes with given global numbers. Collective."""
    ends = np.cumsum(problem.comm.allgather(problem.V.dofmap.index_map.size_local))
    found: Longs = np.searchsorted(ends, nodes, side="right")
    return found


def facing_nodes(problem: Problem, matched: list[MatchedFacets]) -> FacingNodes:
    """Return the pairs of opposite nodes, with the normals of all facets around them. Collective.

    Args:
        problem: The bodies and their contact.
        matched: Matched facets of each contact.
    """
    comm, gdim = problem.comm, problem.bodies.gdim
    rows = np.concatenate([_records(facets, i, gdim) for i, facets in enumerate(matched)])
    rows = send_rows(comm, rows, owners(problem, rows["nodes"][:, 0]))
    nodes, first, of, counts = np.unique(
        rows["nodes"], axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(of.ravel(), kind="stable")
    slot = np.empty(len(rows), dtype=np.int64)
    slot[order] = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    most = comm.allreduce(int(counts.max(initial=1)), MPI.MAX)
    normals = np.zeros((len(nodes), most, gdim))
    known = np.zeros((len(nodes), most), dtype=np.bool_)
    normals[of.ravel(), slot], known[of.ravel(), slot] = rows["normal"], True
    held = rows["held"][first]
    contact = np.full(len(nodes), len(matched), dtype=np.int64)
    np.minimum.at(contact, of.ravel(), rows["contact"])
    both: Flags = np.asarray(held.all(axis=1), dtype=np.bool_)
    normals = np.where(both[:, None], 0.0, normals)
    asked = Exchange(comm, owners(problem, nodes.ravel()))
    there = asked.forward(nodes.ravel())
    _, places, times = np.unique(there, return_inverse=True, return_counts=True)
    often = asked.back(times[places.ravel()]).reshape(-1, 2) > 1
    crowded: Flags = np.asarray(often.any(axis=1))
    return FacingNodes(nodes, rows["ends"][first], held, normals, known, contact, crowded)


def _records(facets: MatchedFacets, contact: int, gdim: int) -> Record:
    """Return a row for each pair of opposite nodes of each pair of facets."""
    pairs = facets.nodes
    rows = np.zeros(
        pairs.shape[:2],
        dtype=[
            ("nodes", np.int64, 2),
            ("ends", np.int64, (2, 2)),
            ("held", np.bool_, (2, gdim)),
            ("normal", np.float64, gdim),
            ("contact", np.int64),
        ],
    )
    rows["nodes"], rows["ends"], rows["contact"] = pairs, -1, contact
    rows["held"], rows["normal"] = facets.held, facets.normals[:, None]
    for node, edge in enumerate(facets.edges(), start=gdim):
        rows["ends"][:, node] = pairs[:, list(edge)]
    swapped = rows["nodes"][..., 0] > rows["nodes"][..., 1]  # the same for all facets
    for name, axis in (("nodes", -1), ("ends", -1), ("held", -2)):
        rows[name][swapped] = np.flip(rows[name][swapped], axis=axis)
    rows["normal"][swapped] *= -1.0
    return rows.ravel()
