"""Match opposite nodes of two surfaces, and compute their normals and gaps.

The module sends each node to the rank of its slab of space, where a k-d tree finds the opposite
node. Matched nodes may then go to other ranks. A node is a row of a structured type. The matching
uses its coordinates "x" and its outward unit "normal".
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.surfaces.surface_facets import SurfaceNodes, extent, surface_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box, send_rows


@dataclass(frozen=True)
class Matching:
    """Matched nodes, each pair on one rank, and the number of nodes without a match.

    Attributes:
        primary: Primary nodes of the pairs on this rank, shape (num_pairs,).
        secondary: Secondary nodes of the same pairs, shape (num_pairs,).
        alone: Number of nodes of both surfaces without a separate partner, on all ranks.
        farthest: Largest distance from a primary node without a partner to the nearest secondary
            node on the rank of the search; inf if this rank has no secondary node, 0 if all nodes
            match.
    """

    primary: SurfaceNodes
    secondary: SurfaceNodes
    alone: int
    farthest: float


def match_nodes(
    comm: MPI.Intracomm, primary: SurfaceNodes, secondary: SurfaceNodes, distance: float
) -> Matching:
    """Return the matched nodes of two surfaces that are opposite each other. Collective.

    Among the nearest nodes, the partner is the node that is most nearly opposite along the mean
    normal. Among several nodes at one point, the partner is the node with the most nearly opposite
    normal. Primary nodes within ``distance`` are matched first; the remaining nodes are matched at
    growing distances, up to the size of the surfaces. The function counts the nodes without a
    separate partner.

    Args:
        comm: Communicator of the ranks.
        primary: Nodes of the primary surface on this rank, shape (n,).
        secondary: Nodes of the secondary surface on this rank.
        distance: Largest distance between touching nodes (length).
    """
    low, high = bounding_box(comm, np.concatenate([primary["x"], secondary["x"]]))
    size = float(np.linalg.norm(high - low))
    found: list[tuple[SurfaceNodes, SurfaceNodes]] = []
    twice = 0
    while True:
        near = _match_near(comm, primary, secondary, distance, low, high)
        found.append((near.primary, near.secondary))
        counts = (len(near.left_primary), len(near.left_secondary), near.twice)
        left = comm.allreduce(np.array(counts))
        twice += int(left[2])
        if not left[:2].all() or distance >= size:
            break
        primary, secondary = near.left_primary, near.left_secondary
        distance = max(4 * distance, size / 64)
    joined = [np.concatenate(nodes) for nodes in zip(*found, strict=True)]
    farthest = comm.allreduce(near.farthest, MPI.MAX)
    return Matching(joined[0], joined[1], int(left[:2].sum()) + twice, farthest)


@dataclass(frozen=True)
class _Near:
    """The matches that :func:`_match_near` finds on this rank.

    Attributes:
        primary: Matched nodes of the primary surface.
        secondary: Partners of these nodes.
        left_primary: Nodes of the primary surface without a match.
        left_secondary: Nodes of the secondary surface without a match.
        twice: Number of surplus matches of secondary nodes with more than one match.
        farthest: Largest distance from ``left_primary`` to the nearest secondary node.
    """

    primary: SurfaceNodes
    secondary: SurfaceNodes
    left_primary: SurfaceNodes
    left_secondary: SurfaceNodes
    twice: int
    farthest: float


def _match_near(
    comm: MPI.Intracomm,
    primary: SurfaceNodes,
    secondary: SurfaceNodes,
    distance: float,
    low: Floats,
    high: Floats,
) -> _Near:
    """Return the matches of nodes within ``distance``. Collective."""
    axis = int(np.argmax(high - low))
    width = max(high[axis] - low[axis], distance) / comm.size

    def slab(x: Floats) -> Longs:
        return np.clip(np.floor((x - low[axis]) / width), 0, comm.size - 1).astype(np.int64)

    here = send_rows(comm, primary, slab(primary["x"][:, axis]))
    # The partner of a node may be this many times as far away as the nearest node. If two surfaces
    # have a gap and are not parallel, their nodes are opposite along the mean normal, not at the
    # shortest distance.
    oblique = 1.2
    along, reach = secondary["x"][:, axis], oblique * distance
    lowest, highest = slab(along - reach), slab(along + reach)
    copies = highest - lowest + 1
    offset = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    there = send_rows(
        comm, np.repeat(_labelled(comm, secondary), copies), np.repeat(lowest, copies) + offset
    )

    far = np.full(len(here), np.inf)
    nearest = np.zeros(len(here), dtype=np.int64)
    if len(here) and len(there):
        most_candidates = 32  # number of nearest nodes that are examined
        many = np.arange(1, min(most_candidates, len(there)) + 1)
        fars, candidates = cKDTree(there["row"]["x"]).query(here["x"], k=many)
        far = fars[:, 0]
        # Distance between nodes at the same point, relative to the size of the surfaces.
        same_place = 1e-9
        rounding = same_place * float(np.linalg.norm(high - low))
        misfit = _misfit(here[:, None], there["row"][candidates], rounding)
        misfit[fars > oblique * fars[:, :1] + rounding] = np.inf
        nearest = candidates[np.arange(len(here)), np.argmin(misfit, axis=1)]
    paired = far <= distance
    taken = there[nearest[paired]] if len(there) else there
    # Several nodes, on this or other ranks, may have found the same secondary node.
    times = np.bincount(send_rows(comm, taken["place"], taken["rank"]), minlength=len(secondary))
    return _Near(
        primary=here[paired],
        secondary=taken["row"],
        left_primary=here[~paired],
        left_secondary=secondary[times == 0],
        twice=int(np.maximum(times - 1, 0).sum()),
        farthest=float(far[~paired].max(initial=0.0)),
    )


def _labelled(comm: MPI.Intracomm, nodes: SurfaceNodes) -> npt.NDArray[np.void]:
    """Return the rows, with their original rank and index."""
    labelled = np.empty(
        len(nodes), dtype=[("row", nodes.dtype), ("rank", np.int32), ("place", np.int64)]
    )
    labelled["row"], labelled["rank"], labelled["place"] = nodes, comm.rank, np.arange(len(nodes))
    return labelled


def _misfit(primary: SurfaceNodes, secondary: SurfaceNodes, rounding: float) -> Floats:
    """Return the distance of nodes from opposite positions (length); the arrays broadcast."""
    n, m = primary["normal"], secondary["normal"]
    facing = np.einsum("...i,...i->...", n, m)
    mean = n - m
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-300)
    between = (secondary["x"] - primary["x"])[..., : n.shape[-1]]
    apart = np.einsum("...i,...i->...", between, mean)
    sideways = np.linalg.norm(between - apart[..., None] * mean, axis=-1)
    far = np.linalg.norm(between, axis=-1)
    return np.asarray(sideways + (1 + facing) * (0.1 * far + rounding))


MATCHING_TOLERANCE = 1e-6
"""Largest distance between touching nodes, relative to the size of the contact surfaces."""


OVERLAP = 1e-9
"""An overlap below this fraction of the size of the surfaces is a rounding error."""


class NoPartners(InputError):
    """Raised on every rank if the nodes of two surfaces do not match."""


def normals_and_gaps(
    comm: MPI.Intracomm,
    place: str,
    contact: Contact,
    matching: Matching,
    size: float,
) -> tuple[Floats, Floats]:
    """Return the normals and gaps of matched nodes, and check that they can be in contact.

    Collective.

    Args:
        comm: Communicator of the ranks.
        place: Location of the contact in the case file, for messages.
        contact: The contact. Its gap is a number, a formula, or None to measure the gap; it also
            states whether the gap may be negative.
        matching: Nodes of both surfaces, as rows of :func:`surface_facets.surface_node_type`.
        size: Size of the surfaces (length).

    Raises:
        NoPartners: If nodes have no opposite partner.
        InputError: If the surfaces overlap or do not face each other, or if a gap is negative.
    """
    if matching.alone:
        far = matching.farthest
        away = f" (the nearest is up to {far:.3g} away)" if 0 < far < np.inf else ""
        raise NoPartners(
            f"{place}: {matching.alone} nodes have no separate partner on the other surface{away}; "
            "choose formulation = 'mortar', or mesh the two surfaces with the same nodes, for "
            "instance with BooleanFragments in gmsh and then write_split."
        )
    primary, secondary = matching.primary, matching.secondary
    facing = np.einsum("ni,ni->n", primary["normal"], secondary["normal"])
    same_side = comm.allreduce(int((facing > 0).sum()))
    if same_side:
        raise InputError(
            f"{place}: at {same_side} nodes, the outward normals of the two surfaces point to the"
            " same side, so the surfaces do not face each other; name one surface of each body."
        )
    normal = primary["normal"] - secondary["normal"]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    between = (secondary["x"] - primary["x"])[:, : normal.shape[1]]
    apart = np.einsum("ni,ni->n", between, normal)
    sideways = np.linalg.norm(between - apart[:, None] * normal, axis=1)
    least = MATCHING_TOLERANCE * size
    mesh_size = np.minimum(primary["size"], secondary["size"])
    # Nodes across a gap may be shifted sideways by this fraction of their distance (or of the mesh
    # size if that is smaller). Matching surfaces that are not parallel have such a shift relative
    # to their mean normal.
    tilt = 0.5
    allowed = least + tilt * np.minimum(np.abs(apart), mesh_size)
    shifted = comm.allreduce(int((sideways > allowed).sum()))
    if shifted:
        farthest = comm.allreduce(float(sideways.max(initial=0)), MPI.MAX)
        raise NoPartners(
            f"{place}: {shifted} nodes have no partner opposite them (sideways shift up to"
            f" {farthest:.3g}); choose formulation = 'mortar', or mesh the two surfaces with the"
            " same nodes, for instance with BooleanFragments in gmsh and then write_split."
        )
    if contact.gap is not None:
        return normal, given_gap(comm, place, contact, primary["x"], size)
    if contact.interference:
        return normal, np.where(np.abs(apart) > OVERLAP * size, apart, 0.0)
    return normal, without_overlap(comm, place, apart, size)


def without_overlap(comm: MPI.Intracomm, place: str, gap: Floats, size: float) -> Floats:
    """Return measured gaps without rounding errors. Collective.

    Raises:
        InputError: If the bodies overlap.
    """
    overlap = -comm.allreduce(float(gap.min(initial=0)), MPI.MIN)
    if overlap > OVERLAP * size:
        raise InputError(
            f"{place}: the surfaces initially overlap by up to {overlap:.6g}, or they are two "
            "sides of one body and face away from each other; move one surface, name two "
            "surfaces that face each other, or give the contact interference = true if the "
            "overlap is intended."
        )
    return np.where(gap > OVERLAP * size, gap, 0.0)


def given_gap(comm: MPI.Intracomm, place: str, contact: Contact, x: Floats, size: float) -> Floats:
    """Return the gaps at points from a number or formula; negative only with interference.

    Collective.
    """
    message: str | None = None
    gap = 0.0 if contact.gap is None else contact.gap
    gaps: Floats = np.zeros(len(x))
    try:
        gaps = evaluate(gap, x, f"{place}: gap")
        if not contact.interference and (gaps < -OVERLAP * size).any():
            message = (
                f"{place}: gap = {gap} is negative ({gaps.min():.6g}) at some nodes, but "
                "bodies must not overlap initially; give a gap >= 0, or interference = true "
                "if the overlap is intended."
            )
    except InputError as error:
        message = str(error)
    raise_together(comm, message)
    return gaps if contact.interference else np.maximum(gaps, 0.0)


def opposite_vertices(tagged_mesh: TaggedMesh, contacts: Sequence[Contact | Tie]) -> Longs:
    """Return pairs of vertices that coincide, or that are opposite each other across a gap.

    Collective.

    Args:
        tagged_mesh: The bodies.
        contacts: Contacts or ties of the bodies. If surfaces do not match everywhere, only matching
            vertices are returned.

    Returns:
        Global numbers of vertices, shape (num_pairs, 2); each pair is on exactly one rank.
    """
    comm, topology = tagged_mesh.mesh.comm, tagged_mesh.mesh.topology
    V = fem.functionspace(tagged_mesh.mesh, ("Lagrange", 1, (topology.dim,)))
    nodes = V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts
    fixed = np.zeros((nodes, topology.dim), dtype=np.bool_)
    vertices = topology.connectivity(topology.dim, 0).array
    number = np.empty(nodes, dtype=np.int64)
    number[V.dofmap.list.ravel()] = topology.index_map(0).local_to_global(vertices)
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for contact in contacts:
        one, other = (
            surface_nodes(V, tagged_mesh, name, fixed)
            for name in (contact.primary, contact.secondary)
        )
        for rows in (one, other):
            rows["number"] = number[rows["node"]]
        size = extent(comm, np.concatenate([one["x"], other["x"]]))
        found = match_nodes(comm, one, other, MATCHING_TOLERANCE * size)
        pairs.append(np.column_stack([found.primary["number"], found.secondary["number"]]))
    return np.concatenate(pairs)
