"""Formulate cells with linear stress, and evaluate laws at their vertices.

The stress of a cell is given at its vertices. Its multipliers are a velocity y of the cell, for
div σ + b = 0, and velocities w of each facet's vertices, for the tractions there. A vertex v has a
share 1/(d + 1) of the volume, and the strain rate

    e_v = (d + 1) Σ_{facets f at v} sym(∇φ_f ⊗ (y − w_fv)),

with the gradients ∇φ of barycentric coordinates, where facet f is opposite to vertex f. In space a
cell is split at its barycentre into four. A single tetrahedron does not carry all balanced linear
tractions, but the split one does (C. Johnson, B. Mercier, Numer. Math. 30 (1978), 103; M. Křížek,
Apl. Mat. 27 (1982), 46).

Formulate cells of bodies of revolution: equilibrium of S = rσ, quadratic in the section. The
axisymmetric equations of equilibrium with a force b per volume, multiplied by r, are

    σ_θ = ∂_r S_rr + ∂_z S_rz + r b_r,   ∂_r S_rz + ∂_z S_zz + r b_z = 0.

Let the components of S, except S_θ, be quadratic in a cell with the Bernstein coefficients S_a at
vertices and S_ab at edges. Derivatives are linear, with the value 2 Σ_b ∇φ_b S_ab at the vertex a
(S_aa = S_a). So the second equation holds everywhere if it does at vertices, and σ_θ is linear.
Then S_θ = rσ_θ is quadratic with the coefficients r_a σ_θa and (r_a σ_θb + r_b σ_θa)/2. Bernstein's
polynomials are not negative. So S is within yield, ‖dev S‖ ≤ γr, if its coefficients are with those
of r: r_a and (r_a + r_b)/2. Tractions S·n on a facet are continuous if their three coefficients
are. Where a coefficient of r is zero, on the axis, that of S is zero too.

The unknowns of a coefficient are σ = S/r, and each is a point of the cell. The multipliers of a
cell are y_r for the six definitions of S_θ, y_z for its vertices, and the velocities of the facets,
three each. NumPy only.

Evaluate laws at the vertices of cells, for strict bounds of bodies that dilate.
Strain rates of a quadratic velocity are linear in a straight cell, and the admissible rates of a
yield set are a convex cone. So rates that are admissible at the vertices are admissible everywhere.
Where a body dilates, tr ε ≥ α‖dev ε‖, it dissipates (γ/α) tr ε, which the mean of the vertices
integrates exactly.

In axisymmetry r²ε is quadratic. There the points are at vertices and edges, one for each of its
Bernstein coefficients (:mod:`~perfplast_fenicsx.limit_analysis.discrete.point_strains`).
"""

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import COEFFICIENTS, EDGES, coefficients_of_radius
from perfplast_fenicsx.mesh.straight_geometry import gradients
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


@dataclass(frozen=True)
class CellLayout:
    """Parts, vertices and multipliers of a cell; the multipliers of its own facets come first.

    Attributes:
        corners: Vertex of the cell at each vertex of each part, d + 1 for the barycentre, shape
            (num_parts, d + 1); in part a the barycentre replaces vertex a.
        rows: Multiplier of each component at each vertex of each part: of the part, then of the
            facets at the vertex, shape (num_parts, d + 1, d + 1, d).
        outer: Number of multipliers of the cell's own facets, d² per facet, in the order of the
            facet's vertices in the cell.
        inner: Number of all other multipliers.
    """

    corners: Longs
    rows: Longs
    outer: int
    inner: int


@lru_cache
def cell_layout(tdim: int) -> CellLayout:
    """Return the layout of a triangle (one part) or a tetrahedron (four)."""
    places = range(tdim + 1)
    centre, outer = tdim + 1, (tdim + 1) * tdim**2
    corners = np.array([list(places)])
    if tdim == 3:
        corners = np.array([[centre if v == a else v for v in places] for a in places])
    first: dict[tuple[int, ...], int] = {
        facet: tdim**2 * a for a, facet in enumerate(facets_of(tuple(places)))
    }
    count = outer
    for s in range(len(corners)):
        first[(s,)] = count  # multipliers of the part
        count += tdim
    rows = np.zeros((len(corners), tdim + 1, tdim + 1, tdim), dtype=np.int64)
    for s, v in itertools.product(range(len(corners)), places):
        rows[s, v, 0] = first[(s,)] + np.arange(tdim)
        for k, f in enumerate((f for f in places if f != v), start=1):
            facet = tuple(sorted(corners[s][[p for p in places if p != f]]))
            if facet not in first:
                first[facet] = count
                count += tdim**2
            rows[s, v, k] = first[facet] + tdim * facet.index(corners[s, v]) + np.arange(tdim)
    return CellLayout(corners, rows, outer, count - outer)


def facets_of(simplex: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the vertices of the facet opposite each vertex."""
    return [tuple(b for b in simplex if b != a) for a in simplex]


@lru_cache
def tensors(gdim: int) -> Floats:
    """Return the unit tensor and orthonormal deviators, in plane strain the in-plane ones.

    Returns:
        Shape (1 + m, gdim, gdim), m = 2 or 5.
    """
    found = [np.eye(gdim)]
    for i in range(1, gdim):
        diagonal = np.diag([1.0] * i + [-float(i)] + [0.0] * (gdim - i - 1))
        found.append(diagonal / math.sqrt(i * (i + 1)))
    for i, j in itertools.combinations(range(gdim), 2):
        shear = np.zeros((gdim, gdim))
        shear[i, j] = shear[j, i] = 1 / math.sqrt(2)
        found.append(shear)
    return np.array(found)


@lru_cache
def components(gdim: int) -> Floats:
    """Return the Mandel components of :func:`tensors` in equations, shape (1 + m, 3 or 6).

    In the plane σ_zz is in no equation.
    """
    E = tensors(gdim)
    # Components that follow the diagonal ones in a Mandel vector, by dimension.
    off_diagonal = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}
    return np.stack(
        [E[:, i, i] for i in range(gdim)]
        + [math.sqrt(2) * E[:, i, j] for i, j in off_diagonal[gdim]],
        axis=1,
    )


def strain_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return strain rates of multipliers, and the volumes of vertices.

    Args:
        x: Vertices of cells, shape (num_cells, d + 1, d).
        axes: Directions of the components of w on the cell's facets, shape (num_cells, d + 1, d,
            d); zero where a support holds one.

    Returns:
        Coefficients of trace and deviator (:func:`tensors`), shape (num_cells, num_points, (d + 1)
        d, 1 + m); points are all vertices of all parts in the order of ``rows``. Volumes, shape
        (num_cells, num_points).
    """
    tdim = x.shape[2]
    layout, E = cell_layout(tdim), tensors(tdim)
    places = np.concatenate([x, x.mean(axis=1, keepdims=True)], axis=1)
    slopes, volume = gradients(places[:, layout.corners])
    # E_j ∇φ_f of each part: the traction of E_j on its facet f, up to a factor
    pushes = -(tdim + 1) * np.einsum("jik,csfk->csfij", E, slopes)
    num_parts = len(layout.corners)
    matrices = np.empty((len(x), num_parts, tdim + 1, tdim + 1, tdim, len(E)))
    for s, v in itertools.product(range(num_parts), range(tdim + 1)):
        matrices[:, s, v, 0] = pushes[:, s, v]
        for k, f in enumerate((f for f in range(tdim + 1) if f != v), start=1):
            on_outside = layout.rows[s, v, k, 0] < layout.outer
            matrices[:, s, v, k] = axes[:, f] @ pushes[:, s, f] if on_outside else pushes[:, s, f]
    points = num_parts * (tdim + 1)
    shares = np.repeat(volume / (tdim + 1), tdim + 1, axis=1)
    return matrices.reshape(len(x), points, (tdim + 1) * tdim, len(E)), shares


NODES = 3
"""Number of coefficients of a traction on a facet: at its ends in the order of the vertices, and
between them.
"""


@lru_cache
def ring_layout() -> CellLayout:
    """Return the layout of a section; each point has six y_r, three y_z and those of its facets."""
    outer = 3 * NODES * 2
    of_facet = np.arange(outer).reshape(3, NODES, 2)
    rows = np.empty((1, 6, 13), dtype=np.int64)
    rows[:, :, :9] = outer + np.arange(9)
    for v in range(3):
        rows[0, v, 9:] = np.concatenate([of_facet[f, k] for f, k in _ends_at(v)])
        # an edge belongs to one facet; the multipliers of the other facet do not act there
        rows[0, 3 + v, 9:] = np.concatenate([of_facet[v, 2], of_facet[(v + 1) % 3, 2]])
    return CellLayout(np.array([[0, 1, 2]]), rows, outer, 9)


def ring_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return strain rates of multipliers, and the volumes of points for the full turn.

    Args:
        x: Vertices of cells, r and z, shape (num_cells, 3, 2).
        axes: Directions of the components of velocities on the cell's facets, shape (num_cells, 3,
            2, 2); zero where a support holds one.

    Returns:
        Coefficients of Mandel's components, shape (num_cells, 6, 13, 4), multipliers in the order
        of :func:`ring_layout`; volumes, shape (num_cells, 6). A point on the axis has only the
        multiplier that keeps its own σ_θ, which has no meaning, at zero.
    """
    slopes, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    off = rho > 0
    rings = np.where(off, rho, radii.max(axis=1, keepdims=True))
    tensors = np.zeros((4, 2, 2))  # in the section, for Mandel's components (rr, zz, θθ, √2 rz)
    tensors[[0, 1], [0, 1], [0, 1]] = 1.0
    tensors[3, [0, 1], [1, 0]] = math.sqrt(0.5)
    hoop = 2
    pushes = np.einsum("jik,cfk->cfij", tensors, slopes)  # E_j ∇φ_f
    found = np.zeros((len(x), 6, 13, len(tensors)))
    for a in range(3):
        for b in range(3):
            point = COEFFICIENTS[a, b]
            found[:, point, 6 + a] -= 2 * pushes[:, b, 1]
            of_hoop = -2 * pushes[:, b, 0]  # part of σ_θ at the vertex a
            found[:, point, a] += of_hoop * off[:, a, None]
            for c in (c for c in range(3) if c != a):
                edge = COEFFICIENTS[a, c]
                share = np.where(off[:, edge], radii[:, c] / (2 * rings[:, edge]), 0.0)
                found[:, point, edge] += share[:, None] * of_hoop
    for v in range(3):
        for k, (f, _) in enumerate(_ends_at(v)):
            found[:, v, 9 + 2 * k : 11 + 2 * k] = -4 * axes[:, f] @ pushes[:, f]
        found[:, 3 + v, 9:11] = -4 * axes[:, v] @ pushes[:, v]
    found *= off[:, :, None, None]
    for i in range(6):
        found[:, i, i, hoop] = 1 / rings[:, i]
    return found, 2 * math.pi * rings * areas[:, None] / 6


def ring_forces(x: Floats, forces: Floats) -> Floats:
    """Return the loads of the cells' multipliers by forces per volume, shape (num_cells, 9)."""
    _, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    ends = np.array(EDGES)
    outward = np.concatenate([radii, radii[:, ends].prod(axis=2)], axis=1)
    np.divide(outward[:, 3:], rho[:, 3:], out=outward[:, 3:], where=rho[:, 3:] > 0)
    share = math.pi / 3 * areas[:, None]
    return share * np.hstack([outward * forces[:, :1], radii * forces[:, 1:]])


def on_facets(values: Floats, radii: Floats) -> Floats:
    """Return coefficients of r times a linear function on facets; the third is between the ends.

    Args:
        values: Values of the function at the ends, shape (..., 2, k).
        radii: Radii r of the ends, shape (..., 2).

    Returns:
        Shape (..., 3, k).
    """
    first, last = values[..., 0, :], values[..., 1, :]
    r, s = radii[..., :1], radii[..., 1:]
    return np.stack([r * first, s * last, (r * last + s * first) / 2], axis=-2)


def _ends_at(vertex: int) -> list[tuple[int, int]]:
    """Return the facets at a vertex, and its index among the ends of each."""
    return [(f, EDGES[f].index(vertex)) for f in range(3) if f != vertex]


def with_points_at_vertices(problem: Problem) -> Problem:
    """Return the problem with the vertices of each cell as its points. Collective.

    In axisymmetry the midpoints of edges are points, too. The new problem shares everything but the
    spaces and laws at the points with the given one.

    Args:
        problem: Problem with quadratic elements on straight cells, in the plane, in space, or in
            axisymmetry for v = ru (:mod:`ring_flux`), and laws without a history.
    """
    mesh = problem.tagged_mesh.mesh
    cell, gdim = mesh.basix_cell(), mesh.geometry.dim
    places: Floats = np.asarray(basix.geometry(cell), dtype=np.float64)
    if isinstance(problem.kinematics, RingFlux):
        places = np.concatenate([places, places[np.array(EDGES)].mean(axis=1)])
    shares = np.full(len(places), basix.cell.volume(cell) / len(places))

    def space(shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            cell, value_shape=shape, points=places, weights=shares
        )
        return fem.functionspace(mesh, element)

    # not a rule for Bernstein coefficients; no form is assembled with them
    metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    return variant(problem, points=spaces)
