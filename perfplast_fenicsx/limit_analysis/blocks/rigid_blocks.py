"""Describe bodies that cannot yield as rigid blocks, with motions, loads and joints."""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import (
    REACH,
    Interface,
    facing_vertices,
)
from perfplast_fenicsx.limit_analysis.facets.bound_body import (
    HELD,
    BoundBody,
    FacetLoads,
    bound_body,
)
from perfplast_fenicsx.mesh.connected_bodies import components
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.straight_geometry import facets_of, gradients, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

CURVED = "cells are curved; use first-order cells"

HINGED = "parts of a body are connected only at a vertex or an edge; separate them, or join them"

PLATES = (
    "bounds of rigid blocks do not support rigid surfaces; remove them, because blocks are rigid "
    "anyway"
)

ROUND = "an obstacle is curved, and bounds of rigid blocks support only plane obstacles"


@dataclass(frozen=True, eq=False)
class Frames:
    """The reference frame of each block: rotations are about its middle, and scaled by its extent.

    Attributes:
        kinematics: Kinematics, which defines the rigid motions.
        middle: Centre of the bounding box of each block, shape (num_blocks, d).
        extent: Half the diagonal of the bounding box of each block, shape (num_blocks,).
    """

    kinematics: Kinematics
    middle: Floats
    extent: Floats

    @property
    def modes(self) -> int:
        """Return the number of rigid motions of a block: 3 in 2D, 6 in 3D."""
        return len(self.kinematics.motions)

    def at(self, block: Longs, x: Floats) -> Floats:
        """Return the velocities of points in each rigid motion of a block, shape (n, d, modes)."""
        return self.kinematics.rigid_modes((x - self.middle[block]) / self.extent[block][:, None])


def _row_type(d: int) -> np.dtype:
    """Return the structured dtype of joint facets, with the fields that node matching needs."""
    return np.dtype(
        [
            ("x", np.float64, 3),
            ("normal", np.float64, d),
            ("corners", np.float64, (d, d)),
            ("vertices", np.int64, d),
            ("area", np.float64),
            ("block", np.int64),
            ("interface", np.int64),
            ("side", np.int64),
            ("key", np.int64),
            ("rank", np.int64),
            ("place", np.int64),
        ]
    )


@dataclass(frozen=True, eq=False)
class JointFacets:
    """Joint facets on rank 0, each with its opposite facet.

    Attributes:
        rows: Facets on the first sides, in the structured dtype of ``_row_type``.
        others: The opposite facet of each facet; at obstacles the facet itself.
        order: Index of the opposite vertex for each vertex, shape (n, d).
        into: Unit normals that point out of the first side, shape (n, d).
        alone: Flags of facets that touch an obstacle instead of a block, shape (n,).
    """

    rows: npt.NDArray[np.void]
    others: npt.NDArray[np.void]
    order: Longs
    into: Floats
    alone: npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RigidBlocks:
    """The rigid blocks of a problem.

    Attributes:
        count: Number of blocks.
        body: Cells and facets of the blocks, as data for both bounds.
        of_node: Block of each local node of the displacements.
        of_outer: Block of each owned exterior facet.
        corners: Coordinates of the vertices of the owned exterior facets, in the order of their
            cells, shape (num_outer, d, d).
        frames: Reference frames of the rigid motions, the same on all ranks.
        free: Orthonormal motions that the supports allow, shape (num_blocks · modes, num_motions).
        gram: Gram matrices of the held directions, shape (num_blocks, modes, modes).
        live: Forces from the live loads, and their moments divided by the extents, shape
            (num_blocks · modes,).
        dead: Forces from the constant loads, and their moments divided by the extents, same shape.
        facets: Joint facets; None on ranks other than 0.
    """

    count: int
    body: BoundBody
    of_node: Longs
    of_outer: Longs
    corners: Floats
    frames: Frames
    free: Floats
    gram: Floats
    live: Floats
    dead: Floats
    facets: JointFacets | None


def are_blocks(problem: Problem) -> bool:
    """Return whether no body can yield and there are contacts or obstacles. Collective."""
    touch = problem.given.contacts or problem.given.obstacles
    return bool(touch) and not any(it.yields for it in body_cones(problem).cones)


def check_blocks(problem: Problem) -> None:
    """Refuse joints with which the limit load of rigid blocks cannot be bounded. Collective.

    Raises:
        InputError: If a joint is not supported; the message says why.
    """
    body = bound_body(problem)
    tdim = problem.bodies.gdim
    topology = problem.tagged_mesh.mesh.topology
    in_contact = body.facets.in_contact
    held = body.supported.any(axis=1) | np.asarray(body.guided.any(axis=1))
    touched = bool(held[in_contact].any())
    topology.create_connectivity(tdim, tdim - 1)
    sides = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    pieces, _ = components(problem.comm, topology.index_map(tdim - 1), sides)
    curved = has_curved_cells(problem.tagged_mesh.mesh)
    faults = (
        (CURVED, curved),
        (body.prevents, body.prevents is not None),
        (PLATES, bool(body.rigid.names)),
        (ROUND, any(it.obstacle is not None and it.into is None for it in body.interfaces)),
        (HELD, touched),
        (HINGED, pieces != problem.bodies.count),
    )
    for why, so in faults:
        if problem.comm.allreduce(so, MPI.LOR):
            raise InputError(f"no body can yield, so only the joints limit the load, but {why}.")


def rigid_blocks(problem: Problem) -> RigidBlocks:
    """Return the blocks of a problem that :func:`check_blocks` does not refuse. Collective."""
    comm, body, d = problem.comm, bound_body(problem), problem.bodies.gdim
    mesh = problem.tagged_mesh.mesh
    topology = mesh.topology
    owned = topology.index_map(d).size_local
    count = problem.bodies.count
    keys = np.asarray(topology.original_cell_index, dtype=np.int64)[:owned]
    of_cell = problem.bodies.of_node[problem.V.dofmap.list[:owned, 0]]
    first = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(first, of_cell, keys)
    comm.Allreduce(MPI.IN_PLACE, first, MPI.MIN)
    # Blocks are numbered by their first cells, so the ranks do not affect the numbers.
    number = np.argsort(np.argsort(first))
    of_cell, of_node = number[of_cell], number[problem.bodies.of_node]
    middle, extent = _sizes(comm, body.vertices, of_cell, count)
    outer = body.geometry.exterior
    cell, side = body.geometry.cell[outer], body.geometry.side[outer]
    corners = body.vertices[cell[:, None], facets_of(d)[side]]
    of_outer = of_cell[cell]
    frames = Frames(problem.kinematics, middle, extent)
    gram = _held(comm, body, frames, of_outer, corners)
    loads = [
        _loads(comm, body, frames, of, (of_cell, of_outer, corners))
        for of in (body.live, body.dead)
    ]
    nodes = geometry_dofmap(mesh)[:owned, : d + 1]
    vertices = mesh.geometry.index_map().local_to_global(
        np.take_along_axis(nodes[cell], facets_of(d)[side], axis=1).ravel().astype(np.int32)
    )
    rows = np.zeros(len(outer), dtype=_row_type(d))
    rows["corners"], rows["vertices"] = corners, vertices.reshape(-1, d)
    rows["x"][:, :d] = corners.mean(axis=1)
    rows["normal"], rows["area"] = body.geometry.normals(outer), body.geometry.areas(outer)
    rows["block"], rows["key"] = of_outer, (d + 1) * keys[cell] + side
    rows["rank"], rows["place"] = comm.rank, np.arange(len(outer))
    mine = []
    for at, interface in enumerate(body.interfaces):
        for side_of, surface in enumerate(interface.surfaces):
            on = np.flatnonzero(np.isin(outer, body.geometry.of(problem, surface)))
            chosen = rows[on]
            chosen["interface"], chosen["side"] = at, side_of
            mine.append(chosen)
    gathered = comm.gather(np.concatenate([rows[:0], *mine]), root=0)
    facets = None if gathered is None else _joined(np.concatenate(gathered), body.interfaces)
    return RigidBlocks(
        count=count,
        body=body,
        of_node=of_node,
        of_outer=of_outer,
        corners=corners,
        frames=frames,
        free=_left_free(gram),
        gram=gram,
        live=loads[0],
        dead=loads[1],
        facets=facets,
    )


def _sizes(
    comm: MPI.Intracomm, vertices: Floats, of_cell: Longs, count: int
) -> tuple[Floats, Floats]:
    """Return the centre and half the diagonal of each block's bounding box. Collective."""
    d = vertices.shape[2]
    low, high = np.full((count, d), np.inf), np.full((count, d), -np.inf)
    np.minimum.at(low, of_cell, vertices.min(axis=1))
    np.maximum.at(high, of_cell, vertices.max(axis=1))
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2


def held_directions(body: BoundBody) -> Floats:
    """Return the directions in which supports hold the owned exterior facets; zero if free.

    Returns:
        Directions, shape (num_outer, d + 1, d). The first d rows are Cartesian axes; the last row
        is the normal of a roller support. A row is zero if supports do not hold its direction.
    """
    outer = body.geometry.exterior
    held, guided = body.supported[outer], body.guided[outer]
    along = np.where(held, 0.0, guided)
    sizes = np.linalg.norm(along, axis=1, keepdims=True)
    rounding = 1e-9
    along = np.where(sizes > rounding, along / np.where(sizes > 0, sizes, 1.0), 0.0)
    axes = held[:, :, None] * np.eye(held.shape[1])
    return np.concatenate([axes, along[:, None]], axis=1)


def _held(
    comm: MPI.Intracomm, body: BoundBody, frames: Frames, of_outer: Longs, corners: Floats
) -> Floats:
    """Return the Gram matrix of each block's motions, in its held directions. Collective."""
    d = corners.shape[2]
    directions = held_directions(body)
    found = np.zeros((len(frames.extent), frames.modes, frames.modes))
    some = np.flatnonzero(directions.any(axis=(1, 2)))
    for vertex in range(d):
        rows = directions[some] @ frames.at(of_outer[some], corners[some, vertex])
        np.add.at(found, of_outer[some], np.einsum("fka,fkb->fab", rows, rows))
    comm.Allreduce(MPI.IN_PLACE, found, MPI.SUM)
    return found


def _left_free(gram: Floats) -> Floats:
    """Return orthonormal motions that supports allow, shape (num_blocks · modes, num_motions)."""
    count, modes = gram.shape[:2]
    values, vectors = np.linalg.eigh(gram)
    negligible = 1e-12  # relative eigenvalue below which a motion is free
    most = np.maximum(values.max(axis=1, initial=0.0), np.finfo(float).tiny)
    block, number = np.nonzero(values <= negligible * most[:, None])
    found = np.zeros((count, modes, len(block)))
    found[block, :, np.arange(len(block))] = vectors[block, :, number]
    return found.reshape(count * modes, len(block))


def _loads(
    comm: MPI.Intracomm,
    body: BoundBody,
    frames: Frames,
    loads: FacetLoads,
    places: tuple[Longs, Longs, Floats],
) -> Floats:
    """Return the forces of loads on each block, and moments divided by extents. Collective."""
    of_cell, of_outer, corners = places
    d = corners.shape[2]
    found = np.zeros((len(frames.extent), frames.modes))

    def act(block: Longs, x: Floats, force: Floats) -> None:
        np.add.at(found, block, np.einsum("ni,nim->nm", force, frames.at(block, x)))

    volumes = gradients(body.vertices)[1]
    act(of_cell, body.vertices.mean(axis=1), loads.forces * volumes[:, None])
    outer = body.geometry.exterior
    tractions = body.geometry.at_corners(outer, loads.tractions[outer])
    means = (np.eye(d) + 1) / (d * (d + 1))  # mean products of barycentric coordinates
    spread = np.einsum("f,ab,fbi->fai", body.geometry.areas(outer), means, tractions)
    for vertex in range(d):
        act(of_outer, corners[:, vertex], spread[:, vertex])
    comm.Allreduce(MPI.IN_PLACE, found, MPI.SUM)
    return found.ravel()


def _joined(rows: npt.NDArray[np.void], interfaces: Sequence[Interface]) -> JointFacets:
    """Return the facets with their opposite facets; the ranks do not affect the order."""
    rows = rows[np.lexsort([rows["key"], rows["side"], rows["interface"]])]
    d = rows["normal"].shape[1]
    first, second, orders, into, alone = [rows[:0]], [rows[:0]], [], [], []
    for number, interface in enumerate(interfaces):
        here = rows[rows["interface"] == number]
        if interface.into is not None:
            first.append(here)
            second.append(here)
            orders.append(np.tile(np.arange(d), (len(here), 1)))
            into.append(np.tile(interface.into, (len(here), 1)))
            alone.append(np.ones(len(here), dtype=bool))
            continue
        one, other = (here[here["side"] == side] for side in (0, 1))
        corners = here["corners"].reshape(-1, d)
        size = float(np.linalg.norm(np.ptp(corners, axis=0))) if len(corners) else 0.0
        found = match_nodes(MPI.COMM_SELF, one, other, REACH * size)
        a, b = found.primary, found.secondary
        sorting = np.argsort(a["key"])
        a, b = a[sorting], b[sorting]
        order, _ = facing_vertices(a["corners"], b["corners"], a["normal"])
        first.append(a)
        second.append(b)
        orders.append(order)
        into.append(a["normal"])
        alone.append(np.zeros(len(a), dtype=bool))
    return JointFacets(
        rows=np.concatenate(first),
        others=np.concatenate(second),
        order=np.concatenate([np.zeros((0, d), dtype=np.int64), *orders]),
        into=np.concatenate([np.zeros((0, d)), *into]),
        alone=np.concatenate([np.zeros(0, dtype=bool), *alone]),
    )
