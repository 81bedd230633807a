"""Flat surfaces that slide along themselves, of any direction, as rows B u = 0 of their nodes.

The normal is one of the whole surface, so that nodes where facets meet have one condition, however
their coordinates are rounded. Where several such surfaces meet, or one meets other supports, nodes
have the rows that these leave to be said.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.surface_normals import surface_facets
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, name_of
from perfplast_fenicsx.problem.declared.supports import Support


@dataclass(frozen=True, eq=False)
class Guides:
    """Supports that hold what is normal to their surface.

    Attributes:
        surfaces: What each is on.
        names: As results name them (:func:`rigid_surface.name_of`).
        normals: Outward unit normals, the same on every rank, shape (num_guides, gdim).
        host: Local block dof of the node of each row, owned by this rank, shape (num_rows,).
        number: The guide of each row.
        component: The one of its node that it takes.
    """

    surfaces: tuple[str, ...]
    names: tuple[str, ...]
    normals: Floats
    host: Ints
    number: Ints
    component: Ints

    @property
    def held(self) -> tuple[Ints, Ints, Floats]:
        """Node, component and unit normal of each row."""
        return self.host, self.component, self.normals[self.number]

    def through(self, ties: Constraints, u: PETSc.Vec) -> float:
        """The largest displacement of a node through its guide, on any rank. Collective.

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
    """The guides of a problem and their rows. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        supports: All supports; those that hold components are left out.
        taken: Components held by supports at each local node, shape (num_nodes, gdim); those that
            rows take the place of are added.
        displacement: u_D at each local node (length), its constant part and that which ζ
            multiplies, shape (2, num_nodes, gdim).

    Raises:
        InputError: If a surface is not flat, nearly parallel to another one, or moved along its
            normal.
    """
    gdim, size = V.mesh.geometry.dim, V.dofmap.index_map.size_local
    told = [it for it in supports if isinstance(it, Support) and it.guides]
    normals, message = np.zeros((len(told), gdim)), None
    reduced, pivots = np.zeros((gdim, len(taken), gdim)), np.full((gdim, len(taken)), -1)
    free, found = ~taken, [np.zeros((3, 0), dtype=np.int32)]
    for number, support in enumerate(told):
        known = np.concatenate([np.eye(gdim), normals[:number]])
        normals[number] = normal = flat_normal(V, tagged_mesh, support, known)
        nodes = fem.locate_dofs_topological(V, gdim - 1, tagged_mesh.facets(support.on))
        _check_rests(V.mesh.comm, support, displacement[:, nodes] @ normal, displacement)
        left, place = normal * free[nodes], np.zeros(len(nodes), dtype=np.int64)
        for rows, pivot in zip(reduced, pivots, strict=True):
            has = np.flatnonzero(pivot[nodes] >= 0)
            place[has] += 1
            at = nodes[has]
            factors = left[has, pivot[at]] / rows[at, pivot[at]]
            left[has] -= factors[:, None] * rows[at]
        # Parts of a unit normal that others leave: what is rounding, and too little for a row.
        rounding, least = 1e-9, 1e-3
        sizes = np.abs(left).max(axis=1, initial=0)
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
        taken[at, chosen] = True
        rows = np.stack([at, np.full(len(at), number), chosen]).astype(np.int32)
        found.append(rows[:, at < size])
    raise_together(V.mesh.comm, message)
    host, number_of, component = np.concatenate(found, axis=1)
    names = tuple(it.on for it in told), tuple(name_of(it) for it in told)
    guides = Guides(*names, normals, host, number_of, component)
    every, along = np.arange(len(host)), normals[number_of]
    terms = [(every, V.dofmap.index_map.local_to_global(host), along)]
    return guides, make_constraints(V, host, np.zeros(len(host)), along, number_of, terms)


def flat_normal(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, support: Support, known: Floats
) -> Floats:
    """The outward unit normal of a flat surface, the same on every rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        support: What is on it.
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
        raise InputError(
            f"components = 'normal' of the support on '{support.on}' is for flat surfaces, and its"
            f" facets turn by up to {np.degrees(turn):.3g}° from their mean; give each flat part a"
            " name and a support of its own, or letters."
        )
    rounding = 1e-12
    for one in known:
        if np.linalg.norm(normal - (normal @ one) * one) <= turn + rounding:
            normal = one.copy()
    normal[np.abs(normal) < rounding] = 0.0
    normal *= (-1.0 if outward @ normal < 0 else 1.0) / np.linalg.norm(normal)
    return normal


def _check_rests(comm: MPI.Intracomm, support: Support, moved: Floats, given: Floats) -> None:
    """Refuse what moves a guide, or nodes of it off it. Collective.

    Args:
        comm: The ranks.
        support: The guide.
        moved: u_D along its normal, at its nodes.
        given: All u_D.

    Raises:
        InputError: If anything does.
    """
    if support.moves:
        raise InputError(
            f"value = {support.value:g} of the support on '{support.on}' does not go with"
            " components = 'normal', which rests; leave it out, or give letters."
        )
    rounding = 1e-12  # displacements that differ by this share of the largest are one
    most = comm.allreduce(np.abs(given).max(initial=0), MPI.MAX)
    if comm.allreduce(np.abs(moved).max(initial=0), MPI.MAX) > rounding * most:
        raise InputError(
            f"another support moves nodes of '{support.on}' off its plane, which components ="
            " 'normal' holds; leave one of them out, or part their surfaces."
        )
