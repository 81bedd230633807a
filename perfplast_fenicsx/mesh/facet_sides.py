"""Count cells on both sides of facets, to detect folds: two cells on one side of a facet."""

from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.compat import coordinate_map, geometry_dofmap
from perfplast_fenicsx.errors import place_of, raise_together
from perfplast_fenicsx.mesh.straight_geometry import corners


@dataclass(frozen=True)
class Sides:
    """The number of cells at each facet, and the sides on which they lie.

    Attributes:
        of_cell: Local facets of each owned cell, shape (n, tdim + 1); facet i is opposite vertex i.
        count: Number of cells, on all ranks, at each local facet, shape (num_facets,).
        signs: Sum over these cells: 1 for a cell on one side and −1 on the other, shape
            (num_facets,). Which side has the sign 1 is arbitrary.
    """

    of_cell: Ints
    count: npt.NDArray[np.int64]
    signs: npt.NDArray[np.int64]


def sides_of_facets(mesh: Mesh) -> Sides:
    """Return the number and the sides of the cells at facets. Collective."""
    topology, tdim = mesh.topology, mesh.topology.dim
    for pair in ((tdim - 1, tdim), (tdim, tdim - 1), (tdim - 1, 0)):
        topology.create_connectivity(*pair)
    cells, x = corners(mesh)
    facets = topology.index_map(tdim - 1)
    of_cell = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[: len(cells)]
    number = topology.index_map(0).local_to_global(cells.ravel()).reshape(cells.shape)
    vector = la.vector(facets, 2, dtype=np.int64)
    seen = vector.array.reshape(-1, 2)
    seen[:] = 0
    for place in range(tdim + 1):
        others = np.delete(np.arange(tdim + 1), place)
        # sorted by global numbers, the vertices have the same order on all ranks and in both cells
        order = np.argsort(number[:, others], axis=1)
        corner = np.take_along_axis(cells[:, others], order, axis=1)
        edges = np.concatenate([x[corner[:, 1:]], x[cells[:, [place]]]], axis=1) - x[corner[:, :1]]
        sign = np.sign(np.linalg.det(edges)).astype(np.int64)
        np.add.at(seen, of_cell[:, place], np.column_stack([np.ones_like(sign), sign]))
    vector.scatter_reverse(la.InsertMode.add)
    vector.scatter_forward()
    return Sides(of_cell, seen[:, 0].copy(), seen[:, 1].copy())


def check_sides(mesh: Mesh) -> None:
    """Raise an error if two cells lie on one side of a facet, or if curved cells fold. Collective.

    Raises:
        InputError: If there are such cells; the message has their number and one place.
    """
    sides = sides_of_facets(mesh)
    cells, x = corners(mesh)
    owned = mesh.topology.index_map(mesh.topology.dim - 1).size_local
    mine = sides.of_cell < owned
    folded = mine & ((sides.count == 2) & (abs(sides.signs) == 2))[sides.of_cell]
    what = "inner facets have both cells on the same side"
    _refuse(mesh, x[cells], folded, what, sides.of_cell)
    _refuse(mesh, x[cells], _inside_out(mesh)[:, None], "curved cells fold over")


def _refuse(
    mesh: Mesh, x: Floats, wrong: npt.NDArray[np.bool_], what: str, numbers: Ints | None = None
) -> None:
    """Raise an error with the place of one wrong cell if there are wrong cells. Collective.

    ``wrong`` has a row of flags for each cell; flags with the same number in ``numbers`` count
    once.
    """
    count = len(np.unique(numbers[wrong])) if numbers is not None else int(wrong.sum())
    total, message = mesh.comm.allreduce(count), None
    if count:
        cell = x[np.argmax(wrong.any(axis=1))]
        place = place_of(cell.mean(axis=0))
        message = (
            f"the mesh is folded over itself: {total} {what}, one of them near "
            f"{place}; mesh the bodies again."
        )
    raise_together(mesh.comm, message)


def _inside_out(mesh: Mesh) -> npt.NDArray[np.bool_]:
    """Return which owned cells have a Jacobian determinant that vanishes or changes its sign."""
    cmap, tdim = coordinate_map(mesh), mesh.topology.dim
    owned = mesh.topology.index_map(tdim).size_local
    if cmap.degree == 1:
        return np.zeros(owned, dtype=np.bool_)
    kind = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[tdim]
    element = basix.create_element(
        basix.ElementFamily.P, kind, cmap.degree, basix.LagrangeVariant.equispaced
    )
    # the Jacobian is a polynomial of degree tdim (degree - 1), which these points determine
    points = basix.create_lattice(
        kind, tdim * (cmap.degree - 1), basix.LatticeType.equispaced, True
    )
    slopes = np.asarray(element.tabulate(1, np.asarray(points)))[1:, :, :, 0]
    x = np.asarray(mesh.geometry.x, dtype=np.float64)
    x = x[geometry_dofmap(mesh)[:owned], : mesh.geometry.dim]
    size = np.linalg.det(np.einsum("jpn,cni->cpij", slopes, x))
    size *= np.where(size.sum(axis=1) < 0, -1.0, 1.0)[:, None]
    # A curved cell counts as folded if its least Jacobian is below this fraction of the largest.
    folded = 1e-9
    return np.asarray(size.min(axis=1) <= folded * size.max(axis=1))
