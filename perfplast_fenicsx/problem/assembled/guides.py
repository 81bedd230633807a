"""Surfaces that slide along themselves, of any direction, as rows B u = g of their nodes.

The normal of a flat one is that of the whole surface, so that nodes where facets meet have one
condition, however their coordinates are rounded. A curved one has the mean normal of the facets at
each node, and is known with a motion alone. Increments keep to B δu = 0; what moves is put where it
is at the beginning of a level (:meth:`Guides.settle`). Where several such surfaces meet, or one
meets other supports, nodes have the rows that these leave to be said.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.surface_normals import face_nodes, surface_facets
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.prescribed_displacement import motion_of
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, name_of
from perfplast_fenicsx.problem.declared.supports import Support


class Curved(InputError):
    """A surface that is not flat."""


@dataclass(frozen=True, eq=False)
class Guides:
    """Supports that hold what is normal to their surface.

    Attributes:
        surfaces: Surface of each.
        names: As results name them (:func:`rigid_surface.name_of`).
        normals: Outward unit normals, the same on every rank, shape (num_guides, gdim).
        host: Local block dof of the node of each row, owned by this rank, shape (num_rows,).
        number: The guide of each row.
        component: The one of its node that it takes.
        along: Unit normal of each row, shape (num_rows, gdim).
        curved: Which of the guides are curved.
        rows: What is left of the normals of local nodes, those before being eliminated and what
            supports hold left out, shape (gdim, num_nodes, gdim).
        pivots: The component that each of these takes, −1 for none, shape (gdim, num_nodes).
    """

    surfaces: tuple[str, ...]
    names: tuple[str, ...]
    normals: Floats
    host: Ints
    number: Ints
    component: Ints
    along: Floats
    curved: tuple[bool, ...]
    rows: Floats
    pivots: Ints

    @property
    def held(self) -> tuple[Ints, Ints, Floats]:
        """Node, component and unit normal of each row."""
        return self.host, self.component, self.along

    def settle(self, u: Floats, known: Floats) -> None:
        """Put nodes where guides have them, along the components that these take.

        Args:
            u: Displacements of local nodes that supports have already, shape (num_nodes, gdim).
            known: Any that guides and supports have.
        """
        off = np.einsum("kni,ni->kn", self.rows, known - u)
        _add_motion(u, off, self.rows, self.pivots)

    def through(self, ties: Constraints, u: PETSc.Vec) -> float:
        """Return the largest displacement of a node through its guide, on any rank. Collective.

        Args:
            ties: All rows B u = 0 of the problem, those of guides last.
            u: Displacement.
        """
        jumps = ties.jumps(u)[len(ties.host) - len(self.host) :]
        largest: float = ties.B.comm.tompi4py().allreduce(
            float(np.abs(jumps).max(initial=0)), MPI.MAX
        )
        return largest


def find_guides(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    supports: Sequence[Support | RigidSurface],
    taken: npt.NDArray[np.bool_],
    displacement: Floats,
) -> tuple[Guides, Constraints]:
    """Return the guides of a problem and their rows. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        supports: All supports; those that hold components are left out.
        taken: Components held by supports at each local node, shape (num_nodes, gdim); those that
            rows take the place of are added.
        displacement: u_D at each local node (length), its constant part and that which ζ
            multiplies, shape (2, num_nodes, gdim); what guides move is added.

    Raises:
        InputError: If a surface that rests is not flat, or one is nearly parallel to another one,
            or moved otherwise by another support.
    """
    gdim, size = V.mesh.geometry.dim, V.dofmap.index_map.size_local
    told = [it for it in supports if isinstance(it, Support) and it.guides]
    normals, message = np.zeros((len(told), gdim)), None
    reduced, pivots = np.zeros((gdim, len(taken), gdim)), np.full((gdim, len(taken)), -1)
    offsets = np.zeros((gdim, 2, len(taken)))
    free, found, every_normal = ~taken, [np.zeros((3, 0), dtype=np.int32)], [np.zeros((0, gdim))]
    for number, support in enumerate(told):
        known = np.concatenate([np.eye(gdim), normals[:number]])
        nodes = fem.locate_dofs_topological(V, gdim - 1, tagged_mesh.facets(support.on))
        normals[number], normal = _normals(V, tagged_mesh, support, known, nodes)
        wanted = _wanted(V, support, nodes)
        offset = wanted - np.einsum("kni,ni->kn", displacement[:, nodes], normal)
        left, place = normal * free[nodes], np.zeros(len(nodes), dtype=np.int64)
        for rows, pivot, of in zip(reduced, pivots, offsets, strict=True):
            has = np.flatnonzero(pivot[nodes] >= 0)
            place[has] += 1
            at = nodes[has]
            factors = left[has, pivot[at]] / rows[at, pivot[at]]
            left[has] -= factors[:, None] * rows[at]
            offset[:, has] -= factors * of[:, at]
        # Parts of a unit normal that others leave: what is rounding, and too little for a row.
        rounding, least = 1e-9, 1e-3
        sizes = np.abs(left).max(axis=1, initial=0)
        _check_moves(V.mesh.comm, support, offset[:, sizes <= rounding], wanted, displacement)
        new = np.flatnonzero(sizes > rounding)
        if (sizes[new] < least).any():
            message = (
                f"components = 'normal' of the support on '{support.on}': its normal is within"
                f" {np.degrees(sizes[new].min()):.2g}° of what other supports hold already where"
                " they meet; leave one of them out, or part their surfaces."
            )
            new = new[sizes[new] >= least]
        at, chosen = nodes[new], np.argmax(np.abs(left[new]), axis=1)
        reduced[place[new], at], pivots[place[new], at] = left[new], chosen
        offsets[place[new], :, at] = offset[:, new].T
        taken[at, chosen] = True
        rows = np.stack([at, np.full(len(at), number), chosen]).astype(np.int32)
        found.append(rows[:, at < size])
        every_normal.append(normal[new][at < size])
    raise_together(V.mesh.comm, message)
    host, number_of, component = np.concatenate(found, axis=1)
    names = tuple(it.on for it in told), tuple(name_of(it) for it in told)
    along, curved = np.concatenate(every_normal), tuple(bool(np.isnan(n).any()) for n in normals)
    guides = Guides(
        *names, normals, host, number_of, component, along, curved, reduced, pivots.astype(np.int32)
    )
    for part, offset in enumerate(offsets.transpose(1, 0, 2)):
        _add_motion(displacement[part], offset, reduced, pivots)
    every = np.arange(len(host))
    terms = [(every, V.dofmap.index_map.local_to_global(host), along)]
    return guides, make_constraints(V, host, np.zeros(len(host)), along, number_of, terms)


def flat_normal(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, support: Support, known: Floats
) -> Floats:
    """Return the outward unit normal of a flat surface, the same on every rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        support: The support.
        known: Unit vectors that are taken for it where they differ by no more than its facets do.

    Raises:
        InputError: If its facets turn, or there are none outside.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    facets = surface_facets(V, tagged_mesh, support.on)
    n = facets.normal.reshape(-1, gdim)
    areas = np.repeat(facets.area, facets.normal.shape[1])
    squares = comm.allreduce(np.einsum("f,fi,fj->ij", areas, n, n))
    outward = comm.allreduce(areas @ n)
    if not np.trace(squares) > 0:
        raise InputError(
            f"components = 'normal' of the support on '{support.on}': no facet of it is on the"
            " outside of a body, and has a normal; name another surface, or give letters."
        )
    normal: Floats = np.linalg.eigh(squares)[1][:, -1]
    across = np.linalg.norm(n - (n @ normal)[:, None] * normal, axis=1)
    turn = np.arcsin(min(1.0, comm.allreduce(float(across.max(initial=0)), MPI.MAX)))
    flat = 1e-4  # by which facets of a plane may turn (rad), as of coordinates of six digits
    if turn > flat:
        raise Curved(
            f"components = 'normal' of the support on '{support.on}' is for flat surfaces, and its"
            f" facets turn by up to {np.degrees(turn):.3g}° from their mean; give each flat part a"
            " name and a support of its own, or letters, or a value to move a curved one along its"
            " normals."
        )
    rounding = 1e-12
    for one in known:
        if np.linalg.norm(normal - (normal @ one) * one) <= turn + rounding:
            normal = one.copy()
    normal[np.abs(normal) < rounding] = 0.0
    normal *= (-1.0 if outward @ normal < 0 else 1.0) / np.linalg.norm(normal)
    return normal


def _normals(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, support: Support, known: Floats, nodes: Ints
) -> tuple[Floats, Floats]:
    """Return the normal of a surface, no number of a curved one, and that at each node. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        support: The support.
        known: As for :func:`flat_normal`; rows without numbers are left out.
        nodes: Local nodes of the surface.

    Raises:
        InputError: As :func:`flat_normal` for a surface that rests; or if facets meet at an edge.
    """
    gdim = known.shape[1]
    try:
        normal = flat_normal(V, tagged_mesh, support, known[~np.isnan(known).any(axis=1)])
    except Curved:
        if not support.moves:
            raise
    else:
        return normal, np.tile(normal, (len(nodes), 1))
    faces = face_nodes(V, tagged_mesh, support.on)
    twice = len(np.unique(faces.node)) < len(faces.node)
    if V.mesh.comm.allreduce(twice, MPI.LOR):
        raise InputError(
            f"components = 'normal' of the support on '{support.on}': facets of it meet at an edge,"
            " whose nodes have two normals; give each smooth part a name and a support of its own."
        )
    field = la.vector(V.dofmap.index_map, gdim)
    field.array.reshape(-1, gdim)[faces.node] = faces.normal
    field.scatter_forward()
    return np.full(gdim, np.nan), np.array(field.array.reshape(-1, gdim)[nodes])


def _wanted(V: fem.FunctionSpace, support: Support, nodes: Ints) -> Floats:
    """Return the displacement of nodes along their normals, constant and times ζ. Collective."""
    found = np.zeros((2, len(nodes)))
    x = V.tabulate_dof_coordinates()[nodes, : V.mesh.geometry.dim]
    found[0 if support.constant else 1] = motion_of(V.mesh.comm, support, x)[:, 0]
    return found


def _check_moves(
    comm: MPI.Intracomm, support: Support, off: Floats, wanted: Floats, given: Floats
) -> None:
    """Refuse other supports that move nodes of a guide off it. Collective.

    Args:
        comm: The ranks.
        support: The guide.
        off: What nodes that others hold are off where the guide has them.
        wanted: Where the guide has nodes along its normal.
        given: All u_D.

    Raises:
        InputError: If any does.
    """
    rounding = 1e-9  # displacements that differ by this share of the largest are one
    most = np.array([float(np.abs(of).max(initial=0)) for of in (wanted, given, off)])
    comm.Allreduce(MPI.IN_PLACE, most, MPI.MAX)
    if most[2] > rounding * most[:2].max():
        raise InputError(
            f"another support moves nodes of '{support.on}' off its plane, which components ="
            " 'normal' holds; leave one of them out, or part their surfaces."
        )


def _add_motion(displacement: Floats, offset: Floats, rows: Floats, pivots: Ints) -> None:
    """Add to u_D what guides move, along the components that they take.

    Args:
        displacement: Shape (num_nodes, gdim).
        offset: What is left of the displacement along each row, shape (gdim, num_nodes).
        rows: As for :class:`Guides`.
        pivots: As ``rows``.
    """
    left = offset.copy()
    for place in reversed(range(len(rows))):
        at = np.flatnonzero(pivots[place] >= 0)
        moved = left[place, at] / rows[place, at, pivots[place, at]]
        for before in range(place):
            left[before, at] -= rows[before, at, pivots[place, at]] * moved
        displacement[at, pivots[place, at]] += moved
