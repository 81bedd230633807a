"""Assemble all equality rows: of ties, rigid bodies, rigid surfaces, and supports along normals.

Supports along normals (guides) are assembled as rows B u = g of their nodes. On a flat surface all
nodes have the same normal, so a node where facets meet has one condition, however coordinates are
rounded. A curved surface uses the mean normal of the facets at each node, and must have a
prescribed motion. Increments satisfy B δu = 0. At the start of a level, :meth:`Guides.settle` moves
the nodes to their prescribed positions. Where such surfaces meet each other or other supports, a
node has only linearly independent rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.formulations.tied_rows import tied_rows
from perfplast_fenicsx.contact.rows.constraints import Constraints, joined, make_constraints
from perfplast_fenicsx.contact.surfaces.surface_facets import face_nodes, surface_facets
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.prescribed_displacement import check_moved_ties, motion_of
from perfplast_fenicsx.problem.assembled.rigid_bodies import RigidBodies, check_touching
from perfplast_fenicsx.problem.assembled.rigid_rows import rigid_rows
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support, name_of
from perfplast_fenicsx.profiling import phase


class Curved(InputError):
    """Raised if a surface is not flat."""


@dataclass(frozen=True, eq=False)
class Guides:
    """Supports that prescribe the displacement along the normal of their surface.

    Attributes:
        surfaces: Surface of each guide.
        names: Names of the guides in results (:func:`supports.name_of`).
        normals: Outward unit normals, NaN for curved guides, the same on every rank, shape
            (num_guides, gdim).
        host: Local block dof of each row's node, which this rank owns, shape (num_rows,).
        number: Number of the guide to which each row belongs.
        component: Component of the node that each row eliminates.
        along: Unit normal of each row, shape (num_rows, gdim).
        curved: Whether each guide is curved.
        rows: Normals at local nodes, orthogonalised against earlier rows and against components
            that supports hold, shape (gdim, num_nodes, gdim).
        pivots: Component that each of ``rows`` eliminates, −1 if there is no row, shape (gdim,
            num_nodes).
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
        """Return the node, the component and the unit normal of each row."""
        return self.host, self.component, self.along

    def settle(self, u: Floats, known: Floats) -> None:
        """Move nodes to the prescribed positions, along the components that the rows eliminate.

        Args:
            u: Displacements of local nodes that already satisfy the other supports, shape
                (num_nodes, gdim).
            known: The displacements that guides and supports prescribe, same shape.
        """
        off = np.einsum("kni,ni->kn", self.rows, known - u)
        _add_motion(u, off, self.rows, self.pivots)

    def through(self, ties: Constraints, u: PETSc.Vec) -> float:
        """Return the largest displacement of a node through its guide, on all ranks. Collective.

        Args:
            ties: All rows B u = 0 of the problem, with the rows of guides last.
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
        tagged_mesh: Mesh with named bodies and surfaces.
        supports: All supports; the function ignores supports with given components.
        taken: Components at each local node that supports hold, shape (num_nodes, gdim). The
            function adds the components that its rows eliminate.
        displacement: u_D at each local node (length): the constant part and the part times ζ, shape
            (2, num_nodes, gdim). The function adds the motion of guides.

    Raises:
        InputError: If a surface without a motion is not flat, if other supports nearly fix its
            normal, or if another support moves its nodes differently.
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
        # An orthogonalised normal shorter than ``rounding`` is a rounding error; one shorter
        # than ``least`` is too short for a row.
        rounding, least = 1e-9, 1e-3
        sizes = np.abs(left).max(axis=1, initial=0)
        _check_moves(V.mesh.comm, support, offset[:, sizes <= rounding], wanted, displacement)
        new = np.flatnonzero(sizes > rounding)
        if (sizes[new] < least).any():
            message = (
                f"components = 'normal' of the support on '{support.on}': where its surface meets "
                f"other supports, its normal is within {np.degrees(sizes[new].min()):.2g}° of the "
                "directions that these supports fix; remove one of the supports, or separate "
                "their surfaces."
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
        tagged_mesh: Mesh with named bodies and surfaces.
        support: The support.
        known: Unit vectors. If the normal differs from one of them by no more than the facets
            differ from the normal, this vector replaces it.

    Raises:
        InputError: If the facets differ in direction, or if no facet lies on the outside of a body.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    facets = surface_facets(V, tagged_mesh, support.on)
    n = facets.normal.reshape(-1, gdim)
    areas = np.repeat(facets.area, facets.normal.shape[1])
    squares = comm.allreduce(np.einsum("f,fi,fj->ij", areas, n, n))
    outward = comm.allreduce(areas @ n)
    if not np.trace(squares) > 0:
        raise InputError(
            f"components = 'normal' of the support on '{support.on}': no facet of the surface lies "
            "on the outside of a body, so the surface has no normal; name another surface, or "
            "give letters as components."
        )
    normal: Floats = np.linalg.eigh(squares)[1][:, -1]
    across = np.linalg.norm(n - (n @ normal)[:, None] * normal, axis=1)
    turn = np.arcsin(min(1.0, comm.allreduce(float(across.max(initial=0)), MPI.MAX)))
    flat = 1e-4  # largest angle (rad) in a plane, as for coordinates with six digits
    if turn > flat:
        raise Curved(
            f"components = 'normal' of the support on '{support.on}' needs a flat surface, but the "
            f"normals of its facets deviate by up to {np.degrees(turn):.3g}° from their mean; give "
            "each flat part its own name and support, or give letters as components, or give a "
            "value to move a curved surface along its normals."
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
    """Return the normal of a surface (NaN if curved), and its normal at each node. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        support: The support.
        known: See :func:`flat_normal`; the function ignores rows of NaN.
        nodes: Local nodes of the surface.

    Raises:
        InputError: If a surface without a motion is not flat, or if facets meet at an edge.
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
            f"components = 'normal' of the support on '{support.on}': facets of the "
            "surface meet at an edge, where nodes have two normals; give each smooth part "
            "its own name and support."
        )
    field = la.vector(V.dofmap.index_map, gdim)
    field.array.reshape(-1, gdim)[faces.node] = faces.normal
    field.scatter_forward()
    return np.full(gdim, np.nan), np.array(field.array.reshape(-1, gdim)[nodes])


def _wanted(V: fem.FunctionSpace, support: Support, nodes: Ints) -> Floats:
    """Return the prescribed displacement of nodes along their normals, shape (2, num_nodes).

    Row 0 has the constant part, row 1 the part times ζ. Collective.
    """
    found = np.zeros((2, len(nodes)))
    x = V.tabulate_dof_coordinates()[nodes, : V.mesh.geometry.dim]
    found[0 if support.constant else 1] = motion_of(V.mesh.comm, support, x)[:, 0]
    return found


def _check_moves(
    comm: MPI.Intracomm, support: Support, off: Floats, wanted: Floats, given: Floats
) -> None:
    """Refuse other supports that move nodes off the position that a guide prescribes. Collective.

    Args:
        comm: Communicator of the ranks.
        support: The support that is the guide.
        off: Distances of nodes that other supports hold from the positions that the guide
            prescribes.
        wanted: Displacement along the normal that the guide prescribes.
        given: Constant and growing parts of u_D at all nodes.

    Raises:
        InputError: If a support moves such a node.
    """
    rounding = 1e-9  # a relative difference below this value is a rounding error
    most = np.array([float(np.abs(of).max(initial=0)) for of in (wanted, given, off)])
    comm.Allreduce(MPI.IN_PLACE, most, MPI.MAX)
    if most[2] > rounding * most[:2].max():
        raise InputError(
            f"components = 'normal' of the support on '{support.on}': another support moves nodes "
            "of this surface by a different amount along its normal; remove one of the supports, "
            "or separate their surfaces."
        )


def _add_motion(displacement: Floats, offset: Floats, rows: Floats, pivots: Ints) -> None:
    """Add the motion of guides to ``displacement``, along the components that rows eliminate.

    Args:
        displacement: u_D, shape (num_nodes, gdim).
        offset: Prescribed displacement along each row after orthogonalisation, shape (gdim,
            num_nodes).
        rows: See :class:`Guides`.
        pivots: See :class:`Guides`.
    """
    left = offset.copy()
    for place in reversed(range(len(rows))):
        at = np.flatnonzero(pivots[place] >= 0)
        moved = left[place, at] / rows[place, at, pivots[place, at]]
        for before in range(place):
            left[before, at] -= rows[before, at, pivots[place, at]] * moved
        displacement[at, pivots[place, at]] += moved


@phase("contact set-up")
def glued_rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    given: Given,
    fixed: npt.NDArray[np.bool_],
    displacement: Floats,
    bodies: RigidBodies | None = None,
) -> tuple[Constraints, Guides, npt.NDArray[np.bool_]]:
    """Return the rows, the guides, and the components that contact cannot use. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        given: The declaration: ties, rigid surfaces, and supports along a normal.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
        displacement: u_D at each local node (length): the constant part and the part times ζ, shape
            (2, num_nodes, gdim).
        bodies: Rigid bodies, whose nodes are not hosts of other rows; None if there are none.

    Returns:
        The rows, with the rows of guides last; the guides; and flags of components at local nodes.
        Contact cannot use a flagged component, because a support holds it, a row eliminates it, or
        a rigid surface prescribes it.

    Raises:
        InputError: If names or surfaces do not fit the mesh or each other.
    """
    taken, solid = fixed.copy(), list[Constraints]()
    if bodies is not None:
        check_touching(V, tagged_mesh, given, bodies)
        taken[bodies.of_node >= 0] = True
        solid = bodies.rows
        for part in displacement:
            for rows in solid:
                check_moved_ties(V, rows, part)
    guides, held = find_guides(V, tagged_mesh, given.supports, taken, displacement)
    glued = tied_rows(V, tagged_mesh, given.ties, taken)
    for part in displacement:
        check_moved_ties(V, glued, part)
    for surface in given.rigid if tagged_mesh.axisymmetric else ():
        if not (surface.free and surface.held == "x"):
            raise InputError(
                f"the rigid surface '{surface.on}' can move only along the axis in "
                "axisymmetry; give held = 'x', or replace it by a support with components "
                "= 'y' and a value."
            )
    taken[glued.host, np.argmax(glued.normal, axis=1)] = True
    parts = rigid_rows(V, tagged_mesh, given.rigid, taken)
    return joined(V, [*solid, glued, *parts, held]), guides, taken
