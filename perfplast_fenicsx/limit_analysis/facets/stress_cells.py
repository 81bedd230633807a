"""Formulate cells with a linear stress, and evaluate material laws at the vertices of cells.

The values at the vertices determine the stress of a cell. The multipliers are a velocity y of the
cell, for div σ + b = 0, and velocities w at the vertices of each facet, for the tractions. Each
vertex v has the share 1/(d + 1) of the volume and the strain rate

    e_v = (d + 1) Σ_{facets f at v} sym(∇φ_f ⊗ (y − w_fv)),

with the gradients ∇φ of barycentric coordinates, where facet f is opposite vertex f. In 3D, a cell
is split into four parts from its barycentre. A linear stress in a single tetrahedron cannot balance
all self-equilibrated linear tractions, but stresses in the four parts can (C. Johnson, B. Mercier,
Numer. Math. 30 (1978), 103; M. Křížek, Apl. Mat. 27 (1982), 46).

In axisymmetry, the equilibrium of S = rσ is formulated with S quadratic in a cell of the section.
The axisymmetric equations of equilibrium with a force b per volume, multiplied by r, are

    σ_θ = ∂_r S_rr + ∂_z S_rz + r b_r,   ∂_r S_rz + ∂_z S_zz + r b_z = 0.

Let the components of S, except S_θ, be quadratic in a cell with the Bernstein coefficients S_a at
vertices and S_ab at edges. Their derivatives are linear, with the value 2 Σ_b ∇φ_b S_ab at the
vertex a (S_aa = S_a). The second equation therefore holds everywhere if it holds at the vertices,
and σ_θ is linear. With a linear σ_θ, S_θ = rσ_θ is quadratic with the coefficients r_a σ_θa and
(r_a σ_θb + r_b σ_θa)/2. Bernstein polynomials are not negative. Therefore S satisfies the yield
condition ‖dev S‖ ≤ γr if its coefficients satisfy it with the coefficients of r: r_a and
(r_a + r_b)/2. The traction S·n on a facet is continuous if its three coefficients are continuous.
On the axis, where a coefficient of r is zero, the coefficient of S is zero too.

Each coefficient is a point of the cell, with the unknown σ: the coefficient of S divided by the
coefficient of r. The multipliers of a cell are six y_r for the definitions of S_θ, three y_z at its
vertices, and three velocities on each facet. The formulas use only NumPy.

:func:`with_points_at_vertices` evaluates laws at the vertices of cells, for strict bounds of bodies
that dilate. The strain rates of a quadratic velocity are linear in a straight cell, and the
admissible strain rates of a yield set form a convex cone. Strain rates that are admissible at the
vertices are therefore admissible everywhere. A body that dilates, with tr ε ≥ α‖dev ε‖, dissipates
(γ/α) tr ε, and the mean over the vertices integrates this linear function exactly.

In axisymmetry, r²ε is quadratic. The points are then at vertices and edges, one for each Bernstein
coefficient of r²ε (:mod:`~perfplast_fenicsx.limit_analysis.discrete.point_strains`).
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

from perfplast_fenicsx.arrays import SHEARS, Floats, Longs
from perfplast_fenicsx.materials.mandel import mandel_size
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import COEFFICIENTS, EDGES, coefficients_of_radius
from perfplast_fenicsx.mesh.straight_geometry import gradients
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.problem import Problem, variant


@dataclass(frozen=True)
class CellLayout:
    """Parts, vertices and multipliers of a cell; the multipliers of its facets come first.

    Attributes:
        corners: Index of the cell's vertex at each vertex of each part, shape (num_parts, d + 1);
            the barycentre has index d + 1. In part a, the barycentre replaces vertex a.
        rows: Index of the multiplier of each component at each vertex of each part, shape
            (num_parts, d + 1, d + 1, d). Multipliers of the part come first, then multipliers of
            the facets at the vertex.
        outer: Number of multipliers of the cell's facets: d² for each facet, in the order of the
            facet's vertices in the cell.
        inner: Number of all other multipliers.
    """

    corners: Longs
    rows: Longs
    outer: int
    inner: int


@lru_cache
def cell_layout(tdim: int) -> CellLayout:
    """Return the layout of a triangle (one part) or a tetrahedron (four parts)."""
    places = range(tdim + 1)
    centre, outer = tdim + 1, (tdim + 1) * tdim**2
    corners = np.array([list(places)])
    if tdim == 3:
        corners = np.array([[centre if v == a else v for v in places] for a in places])
    opposite = [*itertools.combinations(places, tdim)][::-1]
    first: dict[tuple[int, ...], int] = {facet: tdim**2 * a for a, facet in enumerate(opposite)}
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


@lru_cache
def tensors(gdim: int) -> Floats:
    """Return the unit tensor and orthonormal deviators; in-plane tensors for gdim = 2.

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
    """Return the Mandel components of :func:`tensors` that the equations contain, (1 + m, 3 or 6).

    In plane strain, no equation contains σ_zz.
    """
    E = tensors(gdim)
    shears = [math.sqrt(2) * E[:, i, j] for i, j in SHEARS[mandel_size(gdim)]]
    return np.stack([E[:, i, i] for i in range(gdim)] + shears, axis=1)


def strain_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return matrices that map multipliers to strain rates, and the volume of each point.

    Args:
        x: Vertices of cells, shape (num_cells, d + 1, d).
        axes: Directions of the components of w on the cell's facets, shape (num_cells, d + 1, d,
            d); zero for components that supports hold.

    Returns:
        Coefficients of the trace and the deviator (:func:`tensors`), shape (num_cells, num_points,
        (d + 1) d, 1 + m). The points are all vertices of all parts, in the order of ``rows``.
        Volumes, shape (num_cells, num_points).
    """
    tdim = x.shape[2]
    layout, E = cell_layout(tdim), tensors(tdim)
    places = np.concatenate([x, x.mean(axis=1, keepdims=True)], axis=1)
    slopes, volume = gradients(places[:, layout.corners])
    # E_j ∇φ_f in each part: the traction of the stress E_j on facet f, up to a factor
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
"""Number of coefficients of a traction on a facet: two at the ends, in the order of the vertices,
and one between the ends.
"""


@lru_cache
def ring_layout() -> CellLayout:
    """Return the layout of an axisymmetric cell: six y_r, three y_z and the facets' multipliers."""
    outer = 3 * NODES * 2
    of_facet = np.arange(outer).reshape(3, NODES, 2)
    rows = np.empty((1, 6, 13), dtype=np.int64)
    rows[:, :, :9] = outer + np.arange(9)
    for v in range(3):
        rows[0, v, 9:] = np.concatenate([of_facet[f, k] for f, k in _ends_at(v)])
        # an edge point lies on one facet; multipliers of the second facet do not act at this point
        rows[0, 3 + v, 9:] = np.concatenate([of_facet[v, 2], of_facet[(v + 1) % 3, 2]])
    return CellLayout(np.array([[0, 1, 2]]), rows, outer, 9)


def ring_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return matrices that map multipliers to strain rates, and the full-turn volume of each point.

    Args:
        x: Vertices of cells, r and z, shape (num_cells, 3, 2).
        axes: Directions of the components of velocities on the cell's facets, shape (num_cells, 3,
            2, 2); zero for components that supports hold.

    Returns:
        Coefficients of the Mandel components, shape (num_cells, 6, 13, 4), with multipliers in the
        order of :func:`ring_layout`; volumes, shape (num_cells, 6). At a point on the axis, only
        the multiplier of σ_θ acts, which keeps this unused unknown at zero.
    """
    slopes, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    off = rho > 0
    rings = np.where(off, rho, radii.max(axis=1, keepdims=True))
    tensors = np.zeros((4, 2, 2))  # in the section, for the Mandel components (rr, zz, θθ, √2 rz)
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
    """Return the loads on the cells' multipliers from forces per volume, shape (num_cells, 9)."""
    _, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    ends = np.array(EDGES)
    outward = np.concatenate([radii, radii[:, ends].prod(axis=2)], axis=1)
    np.divide(outward[:, 3:], rho[:, 3:], out=outward[:, 3:], where=rho[:, 3:] > 0)
    share = math.pi / 3 * areas[:, None]
    return share * np.hstack([outward * forces[:, :1], radii * forces[:, 1:]])


def on_facets(values: Floats, radii: Floats) -> Floats:
    """Return the Bernstein coefficients of r times a linear function on facets.

    Args:
        values: Values of the function at the ends, shape (..., 2, k).
        radii: Radii r of the ends, shape (..., 2).

    Returns:
        Coefficients at both ends and between the ends, shape (..., 3, k).
    """
    first, last = values[..., 0, :], values[..., 1, :]
    r, s = radii[..., :1], radii[..., 1:]
    return np.stack([r * first, s * last, (r * last + s * first) / 2], axis=-2)


def _ends_at(vertex: int) -> list[tuple[int, int]]:
    """Return the facets at a vertex, each with the vertex's index among the facet's ends."""
    return [(f, EDGES[f].index(vertex)) for f in range(3) if f != vertex]


def with_points_at_vertices(problem: Problem) -> Problem:
    """Return the problem with quadrature points at the vertices of each cell. Collective.

    In axisymmetry, the midpoints of edges are points too. The new problem shares everything with
    the given problem except the spaces and the laws at the points.

    Args:
        problem: Problem with quadratic elements on straight cells and with laws that have no
            history, in 2D, in 3D, or in axisymmetry for v = ru (:mod:`ring_flux`).
    """
    places = np.asarray(basix.geometry(problem.tagged_mesh.mesh.basix_cell()), dtype=np.float64)
    if isinstance(problem.kinematics, RingFlux):
        # with Bernstein coefficients this is not a quadrature rule, and no form uses it
        places = np.concatenate([places, places[np.array(EDGES)].mean(axis=1)])
    return with_points(problem, places)


def with_points(problem: Problem, places: Floats) -> Problem:
    """Return the problem with a quadrature rule with equal weights in each cell. Collective.

    Args:
        problem: The problem.
        places: Points of the rule in the reference cell, shape (num, gdim).
    """
    mesh = problem.tagged_mesh.mesh
    cell, gdim = mesh.basix_cell(), mesh.geometry.dim
    shares = np.full(len(places), basix.cell.volume(cell) / len(places))

    def space(shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            cell, value_shape=shape, points=places, weights=shares
        )
        return fem.functionspace(mesh, element)

    metadata = {
        "quadrature_rule": "custom",
        "quadrature_points": tuple(tuple(row) for row in places),
        "quadrature_weights": tuple(shares),
    }
    dx = ufl.Measure("dx", domain=mesh, metadata=metadata)
    spaces = Spaces(problem.degree, problem.V, space((mandel_size(gdim),)), space(()), dx)
    return variant(problem, points=spaces)
