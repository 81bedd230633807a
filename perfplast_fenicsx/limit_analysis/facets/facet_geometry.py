"""Compute the geometry of a rank's exterior facets, and number the velocity unknowns on facets.

Each facet has d velocity unknowns at each of its vertices, and therefore d² unknowns. Their numbers
are global. In axisymmetry, a facet has three nodes: its ends and a point between the ends
(:mod:`stress_cells`).

Facets have the numbers of DOLFINx, and their vertices are in ascending order of global numbers.
Where two bodies touch, the jump along the normal replaces the normal velocity of one side as an
unknown. The velocity of this side is the jump plus the velocity of the other side, the *twin*. A
few unknowns, the *leads*, determine the velocities on a rigid surface; the unknowns of its facets
*follow* the leads.
"""

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
from dolfinx.mesh import Mesh, exterior_facet_indices
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.mesh.straight_geometry import facets_of, gradients
from perfplast_fenicsx.parallel import lasting
from perfplast_fenicsx.problem.problem import Problem


def turned_axes(normal: Floats, held: PairFlags, aligned: PairFlags) -> tuple[Floats, PairFlags]:
    """Return orthonormal axes with the normal as the first axis, and flags of the held axes.

    Args:
        normal: Unit vectors that are zero in held components, shape (n, d). Vectors that differ
            only by rounding give the same axes.
        held: Flags of Cartesian components that are held, shape (n, d).
        aligned: Flags of further components whose directions become axes, shape (n, d).

    Returns:
        Shapes (n, d, d) and (n, d).
    """
    tdim = normal.shape[1]
    digits = 6  # number of decimals to which components of normals are compared
    sizes = np.round(1 - np.abs(normal), digits)
    first = np.where(held, 3.0, np.where(aligned, 2.0, sizes))
    order = np.argsort(-first, axis=1, kind="stable")
    columns = np.swapaxes(np.eye(tdim)[order[:, : tdim - 1]], 1, 2)
    Q, R = np.linalg.qr(np.concatenate([normal[:, :, None], columns], axis=2))
    Q = Q * np.sign(np.einsum("nii->ni", R))[:, None, :]
    axes = np.swapaxes(Q, 1, 2)
    count = held.sum(axis=1)
    return axes, (np.arange(tdim) > 0) & (np.arange(tdim) <= count[:, None])


@dataclass(frozen=True)
class FacetNumbers:
    """The facets of this rank's cells.

    Attributes:
        facets: Local number of the facet opposite each vertex of each owned cell, shape (num_cells,
            d + 1).
        places: For each facet vertex in the cell's order, its position in the facet's own order,
            shape (num_cells, d + 1, d).
    """

    facets: Ints
    places: Longs


def facet_numbers(mesh: Mesh) -> FacetNumbers:
    """Return facet numbers and vertex positions, the same for both cells of a facet. Collective."""
    topology = mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim, tdim - 1)
    owned = topology.index_map(tdim).size_local
    facets = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[:owned]
    vertices = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[:owned]
    numbers = topology.index_map(0).local_to_global(vertices.ravel()).reshape(vertices.shape)
    others = facets_of(tdim)
    places = np.argsort(np.argsort(numbers[:, others], axis=2), axis=2)
    return FacetNumbers(facets, places)


@dataclass(frozen=True, eq=False)
class Followers:
    """Cells with facets whose unknowns follow other unknowns, the *leads*.

    Attributes:
        leads: Global numbers of all leads, on every rank.
        cells: Numbers of the cells.
        keep: 0 for unknowns that follow and 1 for other unknowns, shape (n, num_outer).
        shares: Coefficients of the leads in the unknowns that follow, shape (n, num_outer,
            num_leads).
        tall: Number of unknowns on all ranks that follow each lead, shape (num_leads,).
    """

    leads: Longs
    cells: Longs
    keep: Floats
    shares: Floats
    tall: Floats


class FacetVelocities:
    """Facet velocities as a PETSc vector and as arrays by cell.

    Attributes:
        count: Number of unknowns that this rank owns.
        of_cells: Local unknowns of each owned cell, in the order of
            :class:`stress_cells.CellLayout`, shape (num_cells, num_outer).
        numbers: Global numbers of the local unknowns, including ghosts.
        twins: Global number of the unknown whose value is added to each local unknown; −1 without a
            twin.
        followers: Cells with facets whose unknowns follow leads.
    """

    def __init__(
        self,
        mesh: Mesh,
        numbers: FacetNumbers,
        twins: Longs,
        nodes: int,
        followers: Followers,
    ) -> None:
        """Number the unknowns. Collective.

        Args:
            mesh: The mesh.
            numbers: Numbers of the facets.
            twins: Twins of the local unknowns, including ghosts.
            nodes: Number of nodes of a facet; its vertices come first.
            followers: Cells with facets whose unknowns follow leads.
        """
        tdim = mesh.topology.dim
        index_map, size = mesh.topology.index_map(tdim - 1), nodes * tdim
        num_local = index_map.size_local + index_map.num_ghosts
        of_facets = index_map.local_to_global(np.arange(num_local, dtype=np.int32))
        self.count = index_map.size_local * size
        self.numbers: Longs = (of_facets[:, None] * size + np.arange(size)).ravel()
        self.twins, self.followers = twins, followers
        more = np.broadcast_to(np.arange(tdim, nodes), (*numbers.facets.shape, nodes - tdim))
        places = np.concatenate([numbers.places, more], axis=2)
        at = (numbers.facets[:, :, None] * nodes + places)[..., None] * tdim
        self.of_cells: Longs = (at + np.arange(tdim)).reshape(len(at), -1).astype(np.int64)
        self._hosts = np.flatnonzero(twins >= 0)
        needed = np.concatenate([self.numbers, twins[self._hosts], followers.leads])
        needed = needed.astype(PETSc.IntType)
        comm = lasting(mesh.comm)
        self.vector = PETSc.Vec().createMPI((self.count, None), comm=comm)
        self._local = PETSc.Vec().createSeq(len(needed))
        there = PETSc.IS().createGeneral(needed, comm=comm)
        self._scatter = PETSc.Scatter().create(self.vector, there, self._local, None)
        there.destroy()

    def destroy(self) -> None:
        """Free the memory of PETSc objects. Collective."""
        for thing in (self.vector, self._local, self._scatter):
            thing.destroy()

    def gather(self, owned: Floats) -> Floats:
        """Return velocities by cell, shape (num_cells, num_outer), from the owned unknowns.

        Collective.
        """
        self.vector.array[:] = owned
        self._scatter.scatter(self.vector, self._local, addv=PETSc.InsertMode.INSERT)
        local = self._local.array_r
        values: Floats = local[: len(self.numbers)].copy()
        count, leads = len(self.numbers), len(local) - len(self.followers.leads)
        values[self._hosts] += local[count:leads]
        found: Floats = values[self.of_cells]
        at = self.followers
        found[at.cells] *= at.keep
        found[at.cells] += at.shares @ local[leads:]
        return found

    def matrix(self) -> sparse.csr_array:
        """Return the matrix of :meth:`gather`; only for a single rank.

        Returns:
            Shape (num_cells · num_outer, count).
        """
        at, rows = self.followers, np.arange(self.of_cells.size).reshape(self.of_cells.shape)
        keep = np.ones(self.of_cells.shape)
        keep[at.cells] = at.keep
        twins = self.twins[self.of_cells]
        hosts = twins >= 0
        led = np.broadcast_to(rows[at.cells, :, None], at.shares.shape)
        leads = np.broadcast_to(at.leads, at.shares.shape)
        places = [np.concatenate([rows.ravel(), rows[hosts], led.ravel()])]
        places += [
            np.concatenate([self.numbers[self.of_cells].ravel(), twins[hosts], leads.ravel()])
        ]
        values = np.concatenate([keep.ravel(), keep[hosts], at.shares.ravel()])
        return sparse.csr_array((values, tuple(places)), shape=(rows.size, self.count))

    def add_up(self, forces: Floats) -> Floats:
        """Return the forces on owned unknowns from forces by cell (transpose of :meth:`gather`).

        Collective.
        """
        at = self.followers
        return self._add_up(forces, np.einsum("nol,no->l", at.shares, forces[at.cells]))

    def meet(self, sizes: Floats, across: bool = True) -> Floats:
        """Return sums of the cells' positive numbers at each unknown; means at leads.

        Collective.

        Args:
            sizes: Numbers for the unknowns of each cell, shape (num_cells, num_outer).
            across: Whether numbers at jumps are also added at the twins of the jumps.
        """
        at = self.followers
        met = np.einsum("nol,no->l", at.shares != 0, sizes[at.cells])
        return self._add_up(sizes, met / np.maximum(at.tall, 1.0), across)

    def _add_up(self, forces: Floats, of_leads: Floats, across: bool = True) -> Floats:
        forces = forces.copy()
        forces[self.followers.cells] *= self.followers.keep
        at, count = self.of_cells.ravel(), len(self.numbers)
        leads = count + len(self._hosts)
        sums = np.bincount(at, weights=forces.ravel(), minlength=count)
        self._local.array[:count] = sums
        self._local.array[count:leads] = sums[self._hosts] if across else 0.0
        self._local.array[leads:] = of_leads
        self.vector.set(0)
        self._scatter.scatter(
            self._local,
            self.vector,
            addv=PETSc.InsertMode.ADD,
            mode=PETSc.ScatterMode.REVERSE,
        )
        summed: Floats = self.vector.array_r.copy()
        return summed


class FacetGeometry:
    """Geometry of this rank's exterior facets, by local number.

    Attributes:
        exterior: Local numbers of the exterior facets that this rank owns, sorted.
        cell: Cell of each facet, including ghosts, shape (num_facets,).
        side: Index of the vertex of the cell opposite the facet, shape (num_facets,).
        vertices: Vertices of the cells, shape (num_cells, d + 1, d).
    """

    def __init__(self, problem: Problem, numbers: FacetNumbers, vertices: Floats) -> None:
        topology = problem.tagged_mesh.mesh.topology
        self.tdim = tdim = topology.dim
        self.index_map = topology.index_map(tdim - 1)
        self.num: int = self.index_map.size_local + self.index_map.num_ghosts
        topology.create_connectivity(tdim - 1, tdim)
        self.exterior = exterior_facet_indices(topology)
        cell, side = np.zeros(self.num, dtype=np.int64), np.zeros(self.num, dtype=np.int64)
        cells, sides = np.indices(numbers.facets.shape)
        cell[numbers.facets], side[numbers.facets] = cells, sides
        self._numbers, self.vertices, self.cell, self.side = numbers, vertices, cell, side

    def normals(self, facets: Ints | Longs) -> Floats:
        """Return the outward unit normals of facets, shape (n, d)."""
        cells = self.vertices[self.cell[facets]]
        slopes = gradients(cells)[0][np.arange(len(facets)), self.side[facets]]
        normals: Floats = -slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
        return normals

    def areas(self, facets: Ints | Longs) -> Floats:
        """Return the areas of facets (lengths in 2D), shape (n,)."""
        slopes, volumes = gradients(self.vertices[self.cell[facets]])
        heights = np.linalg.norm(slopes[np.arange(len(facets)), self.side[facets]], axis=1)
        found: Floats = self.tdim * volumes * heights
        return found

    def corners(self, facets: Ints) -> Floats:
        """Return the vertices of facets in the facets' own order, shape (n, d, d)."""
        tdim, cell, side = self.tdim, self.cell[facets], self.side[facets]
        others = facets_of(tdim)
        x = self.vertices[cell[:, None], others[side]]
        places = self._numbers.places[cell, side]
        return np.take_along_axis(x, np.argsort(places, axis=1)[:, :, None], axis=1)

    def at_corners(self, facets: Ints, values: Floats) -> Floats:
        """Return values at vertices in the order of the cell's vertices, shape (n, d, ...).

        Args:
            facets: Numbers of facets.
            values: Values at vertices in the facets' own order, shape (n, d, ...).
        """
        places = self._numbers.places[self.cell[facets], self.side[facets]]
        return values[np.arange(len(facets))[:, None], places]

    def of(self, problem: Problem, surface: str) -> Ints:
        """Return the owned exterior facets of a surface."""
        found: Ints = np.intersect1d(problem.tagged_mesh.facets(surface), self.exterior)
        return found
