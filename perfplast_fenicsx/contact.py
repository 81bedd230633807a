"""Contact between named surfaces: node pairs, their normals, gaps and areas."""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.bodies import Bodies
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.pairing import Matching, match_rows, send_rows

MATCHING_TOLERANCE = 1e-6
"""Largest distance of matching nodes, relative to the size of the contact surfaces."""

LEAST_COSINE = 0.1
"""A displacement component may stand for the normal if its share of it is at least this."""


@dataclass(frozen=True)
class Contact:
    """Frictionless contact of two surfaces whose nodes match.

    Which of the two is called primary does not matter for the result.

    Args:
        primary: Physical name of the first surface; the normal points out of its body.
        secondary: Physical name of the second surface.
        gap: Initial gap g >= 0 (length) between them: a number or a formula in x, y, z.
    """

    primary: str
    secondary: str
    gap: float | str = 0.0


@dataclass(frozen=True)
class ContactPairs:
    """The inequalities (u_a − u_b)·n ≤ g, each kept by the rank that owns its *host* node.

    One displacement component of the host, which is a unless supports leave a no freedom along n,
    will be replaced by the jump (:mod:`perfplast_fenicsx.basis`).

    Attributes:
        host: Local block dof of the host node, shape (num_pairs,).
        guest: Global block dof of the other node.
        sign: 1 if the host is a, −1 if it is b.
        normal: Outward unit normal of the primary surface, shape (num_pairs, gdim).
        gap: Initial gap g (length).
        area: Share of the surface that belongs to the pair (area; length in 2D).
        host_free: Components of the host no support holds, shape (num_pairs, gdim).
        guest_free: The same of the guest.
        guest_body: Body of the guest (:class:`bodies.Bodies`).
        guest_x: Coordinates of the guest, shape (num_pairs, 3).
    """

    host: npt.NDArray[np.int32]
    guest: npt.NDArray[np.int64]
    sign: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]
    gap: npt.NDArray[np.float64]
    area: npt.NDArray[np.float64]
    host_free: npt.NDArray[np.bool_]
    guest_free: npt.NDArray[np.bool_]
    guest_body: npt.NDArray[np.int32]
    guest_x: npt.NDArray[np.float64]


def surface_nodes(
    V: fem.FunctionSpace, assembly: Assembly, surface: str
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Owned nodes of a surface with their area-weighted outward normals. Collective.

    Returns:
        Local block dofs, shape (n,); unit normals, shape (n, gdim); areas, shape (n,).
    """
    mesh, gdim = V.mesh, V.mesh.geometry.dim
    facets = assembly.facets(surface)
    tag = assembly.surfaces[surface]
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=assembly.facet_tags)(tag)
    v = ufl.TestFunction(V)
    n = ufl.FacetNormal(mesh)
    ones = ufl.as_vector([1.0] * gdim)
    assembled = []
    for density in (n, ones):
        vector = fem.assemble_vector(fem.form(ufl.inner(density, v) * ds))
        vector.scatter_reverse(la.InsertMode.add)
        assembled.append(vector.array.reshape(-1, gdim))
    nodes = fem.locate_dofs_topological(V, mesh.topology.dim - 1, facets)
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    normals = assembled[0][nodes]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return nodes, normals, assembled[1][nodes, 0]


def find_pairs(
    V: fem.FunctionSpace,
    assembly: Assembly,
    bodies: Bodies,
    contacts: Sequence[Contact],
    fixed: npt.NDArray[np.bool_],
) -> ContactPairs:
    """Find the node pairs of all contacts. Collective.

    Args:
        V: Displacement space.
        assembly: Mesh with names.
        bodies: Which node belongs to which body.
        contacts: What is in contact.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: Unknown names, surfaces whose nodes do not match or that do not face each other,
            or a negative gap.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    found = [np.zeros((0, 9 + 3 * gdim))]
    for number, contact in enumerate(contacts, start=1):
        place = f"contact {number} ('{contact.primary}', '{contact.secondary}')"
        if contact.primary == contact.secondary:
            raise InputError(f"{place}: a surface cannot touch itself; name two surfaces.")
        first = _rows(V, assembly, bodies, contact.primary, fixed, contact.gap, place)
        second = _rows(V, assembly, bodies, contact.secondary, fixed, 0.0, place)
        size = _size(comm, np.concatenate([first, second])[:, :3])
        matching = match_rows(comm, first, second, MATCHING_TOLERANCE * size)
        _check(comm, place, contact, matching, size, gdim)
        found.append(_to_hosts(comm, matching, gdim))
    rows = np.concatenate(found)
    host, guest, sign, gap, area, guest_body = rows[:, :6].T
    normal, host_free, guest_free = np.split(rows[:, 9:], 3, axis=1)
    return ContactPairs(
        host.astype(np.int32),
        guest.astype(np.int64),
        sign,
        normal,
        gap,
        area,
        host_free.astype(bool),
        guest_free.astype(bool),
        guest_body.astype(np.int32),
        rows[:, 6:9],
    )


def pair_functionals(
    V: fem.FunctionSpace, bodies: Bodies, pairs: ContactPairs
) -> npt.NDArray[np.float64]:
    """The jump (u_a − u_b)·n of each pair hosted here, as functional of the rigid motions.

    Returns:
        Shape (num_pairs, bodies.count * bodies.num_modes).
    """
    normal = pairs.sign[:, None] * pairs.normal
    host_x = V.tabulate_dof_coordinates()[pairs.host]
    host = bodies.functionals(bodies.of_node[pairs.host], host_x, normal)
    return host - bodies.functionals(pairs.guest_body, pairs.guest_x, normal)


def _rows(
    V: fem.FunctionSpace,
    assembly: Assembly,
    bodies: Bodies,
    surface: str,
    fixed: npt.NDArray[np.bool_],
    gap: float | str,
    place: str,
) -> npt.NDArray[np.float64]:
    """Rows (x y z | rank, local, global, body | gap, area | normal | free) of a surface's nodes."""
    comm, index_map = V.mesh.comm, V.dofmap.index_map
    nodes, normals, areas = surface_nodes(V, assembly, surface)
    x = V.tabulate_dof_coordinates()[nodes]
    message: str | None = None
    gaps: npt.NDArray[np.float64] = np.zeros(len(nodes))
    try:
        gaps = evaluate(gap, x, f"{place}: gap")
        if (gaps < 0).any():
            message = (
                f"{place}: gap = {gap} is negative ({gaps.min():.6g}) at some nodes, but bodies"
                " cannot overlap at first; give a gap of zero or more."
            )
    except InputError as error:
        message = str(error)
    raise_together(comm, message)
    ranks = np.full(len(nodes), comm.rank)
    where = [x, ranks, nodes, index_map.local_to_global(nodes), bodies.of_node[nodes]]
    return np.column_stack([*where, gaps, areas, normals, ~fixed[nodes]]).astype(np.float64)


def _size(comm: MPI.Intracomm, x: npt.NDArray[np.float64]) -> float:
    """Diagonal of the box around the points of all ranks."""
    low, high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return float(np.linalg.norm(high - low))


def _check(
    comm: MPI.Intracomm, place: str, contact: Contact, matching: Matching, size: float, gdim: int
) -> None:
    if matching.alone:
        raise InputError(
            f"{place}: {matching.alone} nodes have no partner on the other surface (up to"
            f" {matching.farthest:.3g} away, {MATCHING_TOLERANCE * size:.3g} allowed); mesh the two"
            " surfaces with the same nodes, for instance by fragmenting and splitting in gmsh."
        )
    cosine = np.einsum(
        "ni,ni->n", *(rows[:, 9 : 9 + gdim] for rows in (matching.first, matching.second))
    )
    same_side = comm.allreduce(int((cosine > 0).sum()))
    if same_side:
        raise InputError(
            f"{place}: at {same_side} nodes the outward normals of the two surfaces point to the"
            " same side, so they do not face each other; name one surface of each body."
        )


def _to_hosts(comm: MPI.Intracomm, matching: Matching, gdim: int) -> npt.NDArray[np.float64]:
    """Choose each pair's host, and send it there.

    Returns:
        Rows (host, guest, sign, gap, area, guest body | guest x y z | normal | host free |
        guest free) of the pairs hosted by this rank.
    """
    a, b = matching.first, matching.second
    normal = a[:, 9 : 9 + gdim]
    free_a, free_b = a[:, 9 + gdim :], b[:, 9 + gdim :]
    able_a = (np.abs(normal) * free_a).max(axis=1, initial=0) >= LEAST_COSINE
    able_b = (np.abs(normal) * free_b).max(axis=1, initial=0) >= LEAST_COSINE
    on_a = able_a[:, None]
    host, guest = np.where(on_a, a, b), np.where(on_a, b, a)
    frees = [np.where(on_a, free_a, free_b), np.where(on_a, free_b, free_a)]
    sign = np.where(able_a, 1.0, -1.0)
    numbers = [host[:, 4], guest[:, 5], sign, a[:, 7], a[:, 8], guest[:, 6], guest[:, :3]]
    rows = np.column_stack([*numbers, normal, *frees])
    movable = able_a | able_b
    return send_rows(comm, rows[movable], host[movable, 3].astype(np.int64))
