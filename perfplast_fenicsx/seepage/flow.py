"""Compute steady flow with a free surface, as an obstacle problem for PETSc's SNES-VI.

The unknowns are the pressure head ψ ≥ 0 (pressure divided by unit weight) and the saturation χ of
the ground, 0 ≤ χ ≤ 1, which is 1 wherever ψ > 0 (H. W. Alt, Numer. Math. 36 (1980) 165):

    div v = 0,    v = −k (∇ψ + χ e),    ψ ≥ 0,  χ ≤ 1,  ψ (1 − χ) = 0,    e upwards

ψ is linear in each cell. The edges ij of the cells form a network with the conductances T_ij = −∫ k
∇φᵢ·∇φⱼ (φ the nodal basis). The water that leaves vertex i is

    F_i = Σ_j T_ij ((ψᵢ − ψⱼ) + χ_u (zᵢ − zⱼ)),    u the vertex from which gravity takes water.

The flow along an edge leaves one end and enters the other, so no water is lost or created. The sum
of F_i over all vertices is therefore zero for any ψ and χ. In saturated ground, the equations are
those of the finite element method with heads that are linear in the cells.

One unknown w represents both fields: χ = min(w, 1), ψ = L max(w − 1, 0), with the height L of the
ground. The obstacles are

    inside, at impervious boundaries   w ≥ 0                F = 0
    at seepage faces and drains        0 ≤ w ≤ 1            F = 0 where w < 1, F ≤ 0 where w = 1
    below the level of known water     w = 1 + ψ / L

By the second row, no water enters from the air, and water leaves only where the ground is
saturated. SNES-VI takes semismooth Newton steps for these conditions (``vinewtonrsls``).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.errors import InputError, nearest, on_rank0, place_of
from perfplast_fenicsx.mesh.linear_field import LinearField
from perfplast_fenicsx.mesh.refinement import refine
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.mesh.whole_mesh import whole_mesh
from perfplast_fenicsx.seepage.declared import Head, Seepage
from perfplast_fenicsx.solvers.linear.petsc_options import SEEPAGE, check_snes_vi, own_prefix

COINCIDE = 1e-9
"""Largest distance between two vertices that water connects, relative to the size of the ground.
"""

PASSES = 1e-6
"""Outflow at a point of an outlet that counts as zero, relative to the largest at any point."""

ROUNDING = 1e-9
"""Discharge of a surface that counts as zero, relative to the largest discharge."""

MOST_COMPARED = 50_000
"""Largest number of cells for which the flow is compared with the flow on a finer mesh."""

MOST_ITERATIONS = 100
"""Largest number of Newton steps; usually 5 to 20 suffice."""

PRESET = {
    "snes_type": "vinewtonrsls",
    "snes_linesearch_type": "basic",
    "snes_max_it": MOST_ITERATIONS,
    "snes_atol": 0.0,  # the iteration ends at rounding errors, unless the user gives tolerances
    "snes_rtol": 0.0,
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_zeropivot": 1e-300,  # columns of dry points are small, but the matrix is regular
}

DRY = 1e-9
"""Slope dψ/dw, relative to L, where the ground is not saturated. It keeps Newton's equation regular
if gravity cannot take water from a vertex."""


@dataclass(frozen=True, eq=False)
class SteadyFlow:
    """Steady flow in the ground, at the vertices of the bodies through which water flows.

    Attributes:
        points: Coordinates, shape (num_points, d).
        cells: Point numbers of each cell, shape (num_cells, d + 1).
        bodies: Cells of each body by name, as slices.
        pressure_heads: Pressure divided by unit weight (length), shape (num_points,); 0 in dry
            ground.
        saturation: 1 below the free surface, 0 above it, shape (num_points,).
        outflow: Water that leaves the ground at each point (volume per time), shape (num_points,).
        discharges: Water that enters (positive) or leaves the ground at each head and outlet, by
            its name (volume per time).
        iterations: Number of Newton steps of SNES-VI.
        axis: Index of the coordinate that points upwards.
        unit_weight: Unit weight of water.
        uncertainty: Largest difference from the pressure on a mesh with edges of half the length
            (stress); None if that mesh would be too large.
    """

    points: Floats
    cells: Longs
    bodies: dict[str, slice]
    pressure_heads: Floats
    saturation: Floats
    outflow: Floats
    discharges: dict[str, float]
    iterations: int
    axis: int
    unit_weight: float
    uncertainty: float | None = None

    @property
    def pressures(self) -> Floats:
        """Return the pressure of the water at the points (stress)."""
        return self.unit_weight * self.pressure_heads

    @property
    def heads(self) -> Floats:
        """Return the total head at the points (length): height plus pressure head."""
        return self.points[:, self.axis] + self.pressure_heads

    def pressure_in(self, body: str) -> "FlowPressure":
        """Return the pore pressure in a body (stress).

        Args:
            body: Name of the body.
        """
        cells = self.cells[self.bodies[body]]
        return FlowPressure(self, self.points[cells], self.pressures[cells])

    @property
    def imbalance(self) -> float:
        """Return the sum of all discharges relative to the largest one; it should be tiny."""
        each = np.array(list(self.discharges.values()))
        return float(abs(each.sum()) / np.abs(each).max(initial=np.finfo(float).tiny))

    def table(self) -> dict[str, Any]:
        """Return the data of the flow for ``summary.json``."""
        return {
            "discharges": self.discharges,
            "imbalance": self.imbalance,
            "iterations": self.iterations,
            "largest_pressure": float(self.pressures.max(initial=0.0)),
            "uncertainty": self.uncertainty,
        }


class FlowPressure(LinearField):
    """Pressure of flowing water in one body.

    Attributes:
        flow: The flow.
    """

    def __init__(self, flow: SteadyFlow, corners: Floats, values: Floats) -> None:
        """Store the flow and its pressure in the body.

        Args:
            flow: The flow.
            corners: Vertices of the cells, shape (num_cells, d + 1, d).
            values: Pressure at the vertices, shape (num_cells, d + 1).
        """
        super().__init__(corners, values)
        self.flow = flow


def flow_of(loads: Iterable[object]) -> SteadyFlow | None:
    """Return the flow whose pressure is one of the loads; None if no water flows.

    Args:
        loads: Loads of any kind.
    """
    fields = (getattr(load, "field", None) for load in loads)
    return next((field.flow for field in fields if isinstance(field, FlowPressure)), None)


def steady_flow(tagged_mesh: TaggedMesh, seepage: Seepage) -> SteadyFlow:
    """Return the steady flow of water through a mesh. Collective.

    Rank 0 computes the flow; all ranks receive the whole flow.

    Args:
        tagged_mesh: Mesh with straight cells.
        seepage: Conductivities, levels and outlets.

    Raises:
        InputError: On every rank, if names are unknown, numbers are invalid, or no flow is found.
            Also raised if two levels meet, or if a part of the ground has neither a level nor an
            outlet.
    """
    if tagged_mesh.axisymmetric or tagged_mesh.is_thin:
        raise InputError(
            "seepage is available only in plane strain and in 3D; remove [seepage], or remove "
            "kind from [model]."
        )
    if has_curved_cells(tagged_mesh.mesh):
        raise InputError("seepage needs straight cells; give the mesh order = 1.")
    if seepage.unit_weight is None:
        raise InputError(
            "unit_weight is missing; give the unit weight of water, such as 9.81 with kN and m."
        )
    dim = tagged_mesh.mesh.geometry.dim
    if seepage.axis >= dim:
        raise InputError(f"up = '{seepage.up}' is not a coordinate in {dim} dimensions; give 'y'.")
    copy, comm = whole_mesh(tagged_mesh), tagged_mesh.mesh.comm
    owner = _Options()
    prefix = own_prefix(owner, SEEPAGE, PRESET)  # collective, because it numbers prefixes
    check_snes_vi(PETSc.Options(prefix).getAll(), SEEPAGE)
    flow: SteadyFlow = comm.bcast(on_rank0(comm, lambda: _judged(copy, seepage, prefix)))
    return flow


class _Options:
    """Owner of the PETSc options of a flow."""


def _judged(mesh: TaggedMesh, seepage: Seepage, prefix: str) -> SteadyFlow:
    """Return the flow on a mesh of this rank alone, with its ``uncertainty``."""
    flow, cells = _flow(mesh, seepage, prefix), len(corners(mesh.mesh)[0])
    if cells > MOST_COMPARED:
        return flow
    finer = _flow(refine(mesh, np.ones(cells, dtype=bool)).tagged_mesh, seepage, prefix)
    apart = []
    for body, there in finer.bodies.items():
        cells_there = finer.cells[there]
        coarse = flow.pressure_in(body).at_corners(finer.points[cells_there])
        apart.append(np.abs(coarse - finer.pressures[cells_there]).max())
    return replace(flow, uncertainty=float(max(apart)))


def _flow(mesh: TaggedMesh, seepage: Seepage, prefix: str) -> SteadyFlow:
    """Return the flow on a mesh of this rank alone."""
    network = Network(mesh, seepage)
    lower, upper, start = network.obstacles(mesh, seepage)
    w, iterations = solve_flow(network, (lower, upper), start, prefix)
    outflow = -network.leaving(w)
    # The saturation at a lowest point of an outlet that no water reaches is arbitrary; it is set to
    # 0.
    through = np.abs(outflow)
    idle = (lower < upper) & (w >= upper) & (through <= PASSES * through.max(initial=0.0))
    saturation = np.where(idle, 0.0, np.minimum(w, 1.0))
    discharges: dict[str, float] = {}
    counted = np.zeros(len(w), dtype=bool)
    named = [(head.name or head.on, head.on) for head in seepage.head]
    for name, surface in [*named, *((outlet, outlet) for outlet in seepage.outlet)]:
        there = network.on(mesh, surface) & ~counted
        discharges[name] = discharges.get(name, 0.0) - float(outflow[there].sum())
        counted |= there
    most = max(map(abs, discharges.values()))
    discharges = {
        name: one if abs(one) > ROUNDING * most else 0.0 for name, one in discharges.items()
    }
    lost = np.zeros(len(w))
    for head in seepage.head:
        if head.drawdown is not None:
            above = network.surface_above(mesh, head.on)
            lost += np.maximum(head.level - np.fmax(above, head.drawdown), 0.0)
    return SteadyFlow(
        points=network.points,
        cells=network.cells,
        bodies=network.bodies,
        pressure_heads=np.maximum(network.height * np.maximum(w - 1.0, 0.0) - lost, 0.0),
        saturation=saturation,
        outflow=outflow,
        discharges=discharges,
        iterations=iterations,
        axis=seepage.axis,
        unit_weight=seepage.unit_weight or 0.0,
    )


class Network:
    """Edges, with conductances, of the cells through which water flows.

    Attributes:
        points: Vertices; coincident vertices of different bodies are one point, shape (num_points,
            d).
        cells: Point numbers of each cell, shape (num_cells, d + 1).
        bodies: Cells of each body by name, as slices.
        axis: Index of the coordinate that points upwards.
        height: Height of the ground (length).
        rounding: Norm of F that counts as a rounding error (volume per time).
    """

    def __init__(self, mesh: TaggedMesh, seepage: Seepage) -> None:
        """Collect the cells of bodies with a conductivity. Not collective.

        Raises:
            InputError: If a name is unknown, or if a conductivity is invalid.
        """
        vertices, x = corners(mesh.mesh)
        dim = x.shape[1]
        cells: list[Longs] = []
        conductivities: list[Floats] = []
        bodies = np.full(len(x), -1)
        begin = 0
        self.bodies: dict[str, slice] = {}
        for number, body in enumerate(seepage.conductivity):
            if body not in mesh.volumes:
                hint = nearest(body, list(mesh.volumes))
                raise InputError(
                    f"conductivity has an entry for '{body}', which is not a body; {hint}"
                )
            there = mesh.cells(body)
            self.bodies[body] = slice(begin, begin + len(there))
            begin += len(there)
            cells.append(vertices[there].astype(np.int64))
            k = seepage.conductivities(body, dim)
            conductivities.append(np.broadcast_to(k, (len(there), dim)))
            bodies[vertices[there]] = number
        own = np.concatenate(cells)
        numbers = _merged(x, bodies)
        self.numbers = numbers
        self.cells: Longs = numbers[own]
        self.points = np.zeros((int(numbers.max()) + 1, dim))
        self.points[numbers[numbers >= 0]] = x[numbers >= 0]
        self.axis = seepage.axis
        self.height = float(np.ptp(self.points[:, self.axis]))
        self._ends, self._conductances = _edges(
            self.points[self.cells], self.cells, np.concatenate(conductivities)
        )
        z, (i, j) = self.points[:, self.axis], self._ends.T
        each = np.bincount(self._ends.ravel(), np.repeat(np.abs(self._conductances), 2))
        several = 16  # factor on the rounding error of one sum of products
        unit = np.finfo(np.float64).eps * self.height
        self.rounding = several * unit * float(np.linalg.norm(each))
        self._falls = self._conductances * (z[i] - z[j])
        self._from = np.where(self._falls > 0, i, j)

    def on(self, mesh: TaggedMesh, surface: str) -> npt.NDArray[np.bool_]:
        """Return which points lie on a surface.

        Raises:
            InputError: If the surface does not exist, or is on no body with a conductivity.
        """
        found = np.zeros(len(self.points), dtype=bool)
        found[self._facets(mesh, surface).ravel()] = True
        if not found.any():
            raise InputError(
                f"the surface '{surface}' belongs to no body with a conductivity; give its body a "
                "conductivity, or name another surface."
            )
        return found

    def _facets(self, mesh: TaggedMesh, surface: str) -> Longs:
        """Return the point numbers of the facets of a surface, shape (num_facets, d)."""
        topology = mesh.mesh.topology
        topology.create_connectivity(topology.dim - 1, 0)
        vertices = topology.connectivity(topology.dim - 1, 0).array.reshape(-1, topology.dim)
        numbers = self.numbers[vertices[mesh.facets(surface)]]
        return numbers[(numbers >= 0).all(axis=1)]

    def surface_above(self, mesh: TaggedMesh, surface: str) -> Floats:
        """Return the height of a surface vertically above each point; ∞ if it is not above.

        Args:
            mesh: A plane mesh.
            surface: Name of the surface.

        Raises:
            InputError: If the mesh is three-dimensional.
        """
        if self.points.shape[1] != 2:
            raise InputError("drawdown is available only in plane strain; remove it.")
        along, up = 1 - self.axis, self.axis
        little = COINCIDE * self.height
        start, end = np.swapaxes(self.points[self._facets(mesh, surface)], 0, 1)
        x, z = self.points[:, along, None], self.points[:, up, None]
        width = end[:, along] - start[:, along]
        flat = np.where(np.abs(width) > little, width, np.inf)
        share = (x - start[:, along]) / flat
        there = (share >= -1e-9) & (share <= 1 + 1e-9) & (np.abs(width) > little)
        heights = start[:, up] + share * (end[:, up] - start[:, up])
        over = there & (heights >= z - little)
        return np.asarray(np.where(over, heights, np.inf).min(axis=1, initial=np.inf))

    def obstacles(self, mesh: TaggedMesh, seepage: Seepage) -> tuple[Floats, Floats, Floats]:
        """Return lower bounds, upper bounds and initial values of w, each of shape (num_points,).

        Raises:
            InputError: If two levels meet at a point, if a level lies below its surface, or if a
                part of the ground has no level and no outlet.
        """
        z, count = self.points[:, self.axis], len(self.points)
        lower, upper = np.zeros(count), np.full(count, PETSc.INFINITY)
        level, who = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
        rounding = COINCIDE * self.height
        for number, head in enumerate(seepage.head):
            there = self.on(mesh, head.on)
            upper[there] = np.minimum(upper[there], 1.0)
            self._check_level(mesh, head, there)
            wet = there & (z <= head.level + rounding)
            twice = wet & np.isfinite(level) & (np.abs(level - head.level) > rounding)
            if twice.any():
                other = seepage.head[who[np.argmax(twice)]]
                raise InputError(
                    f"the surfaces '{head.on}' (level {head.level:g}) and '{other.on}' (level "
                    f"{other.level:g}) meet at {place_of(self.points[np.argmax(twice)])}; leave an "
                    "impervious part of the boundary between them, or give both the same level."
                )
            level[wet], who[wet] = head.level, number
        for outlet in seepage.outlet:
            there = self.on(mesh, outlet)
            upper[there] = np.minimum(upper[there], 1.0)
        known = np.isfinite(level)
        self._check_parts(known, known | (upper <= 1.0))
        highest = max(head.level for head in seepage.head)
        start = np.minimum(1.0 + np.maximum(highest - z, 0.0) / self.height, upper)
        fixed = 1.0 + np.maximum(level[known] - z[known], 0.0) / self.height
        lower[known] = upper[known] = start[known] = fixed
        return lower, upper, start

    def _check_level(self, mesh: TaggedMesh, head: Head, there: npt.NDArray[np.bool_]) -> None:
        """Refuse a level below its surface, or inside a facet on which the water presses."""
        z, rounding = self.points[:, self.axis], COINCIDE * self.height
        lowest = float(z[there].min())
        if head.level < lowest - rounding:
            raise InputError(
                f"the level {head.level:g} of the water at '{head.on}' lies below this surface, "
                f"whose lowest point has the height {lowest:g}; give a higher level, or list the "
                "surface in outlet."
            )
        facets = self._facets(mesh, head.on)
        for level in dict.fromkeys((head.level, head.outside)):
            above = z[facets] - level
            cut = (above.min(axis=1) < -rounding) & (above.max(axis=1) > rounding)
            if head.presses and cut.any():
                at = self.points[facets[np.argmax(cut)]].mean(axis=0)
                raise InputError(
                    f"the level {level:g} of the water at '{head.on}' crosses a facet near "
                    f"{place_of(at)}; add a point at this height to the drawing, and the mesh will "
                    "have a vertex there."
                )

    def _check_parts(self, known: npt.NDArray[np.bool_], opened: npt.NDArray[np.bool_]) -> None:
        """Refuse parts of the ground that are connected to neither a level nor an outlet."""
        count = len(self.points)
        i, j = self._ends.T
        graph = sp.coo_matrix((np.ones(len(i)), (i, j)), shape=(count, count))
        parts, of_point = connected_components(graph, directed=False)
        open_ = np.zeros(parts, dtype=bool)
        open_[of_point[opened]] = True
        closed = ~open_[of_point]
        if closed.any():
            raise InputError(
                f"the ground at {place_of(self.points[np.argmax(closed)])} is connected to no "
                "surface with a level and to no outlet, so the pressure there is unknown; list "
                "one of its surfaces in [[seepage.head]] or outlet, or remove its conductivity."
            )

    def leaving(self, w: Floats) -> Floats:
        """Return F, the water that leaves each point along the edges, shape (num_points,)."""
        heads = self.height * (np.maximum(w - 1.0, 0.0) + DRY * np.minimum(w, 1.0))
        i, j = self._ends.T
        flow = self._conductances * (heads[i] - heads[j])
        flow += self._falls * np.minimum(w, 1.0)[self._from]
        count = len(w)
        return np.asarray(
            np.bincount(i, flow, count) - np.bincount(j, flow, count), dtype=np.float64
        )

    def slopes(self, w: Floats) -> sp.csr_matrix:
        """Return the derivative of F with respect to w."""
        i, j = self._ends.T
        saturated = w >= 1.0
        of_heads = self.height * np.where(saturated, 1.0, DRY)
        of_falls = np.where(saturated[self._from], 0.0, self._falls)
        at_i = self._conductances * of_heads[i] + of_falls * (self._from == i)
        at_j = -self._conductances * of_heads[j] + of_falls * (self._from == j)
        values = np.concatenate([at_i, at_j, -at_i, -at_j])
        rows, columns = np.concatenate([i, i, j, j]), np.concatenate([i, j, i, j])
        return sp.csr_matrix((values, (rows, columns)), shape=(len(w), len(w)))


def solve_flow(
    network: Network, obstacles: tuple[Floats, Floats], start: Floats, prefix: str
) -> tuple[Floats, int]:
    """Return w and the number of Newton steps. Not collective.

    Args:
        network: The network of the ground.
        obstacles: Lower and upper bounds on w, each of shape (num_points,).
        start: Initial values of w, within the bounds.
        prefix: Prefix of the options for SNES-VI.

    Raises:
        InputError: If SNES-VI does not converge.
    """
    alone = PETSc.COMM_SELF
    first = network.slopes(start)
    jacobian = PETSc.Mat().createAIJ(first.shape, csr=_rows(first), comm=alone)
    snes = PETSc.SNES().create(alone)
    snes.setOptionsPrefix(prefix)
    norms = [np.inf]

    def ended(snes: PETSc.SNES, step: int, sizes: Sequence[float]) -> int | None:
        """Return a reason to stop if F is below a tolerance or a rounding error; otherwise None."""
        before, now = norms[-1], sizes[-1]
        norms.append(now)
        gains = 0.5  # a step that leaves a larger fraction of the norm makes no progress
        least = max(snes.atol, snes.rtol * norms[1])
        if (now <= network.rounding and now >= gains * before) or now <= least:
            return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS)
        return None

    def fill(snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, other: PETSc.Mat) -> None:
        other.setValuesCSR(*_rows(network.slopes(x.array_r)))
        other.assemble()

    snes.setFunction(
        lambda snes, x, f: f.setArray(network.leaving(x.array_r)), jacobian.createVecLeft()
    )
    snes.setJacobian(fill, jacobian, jacobian)
    snes.setFromOptions()
    snes.setConvergenceTest(ended)
    bounds = [PETSc.Vec().createWithArray(side, comm=alone) for side in obstacles]
    snes.setVariableBounds(*bounds)
    w = PETSc.Vec().createWithArray(start.copy(), comm=alone)
    snes.solve(None, w)
    found, steps, reason = w.array.copy(), snes.its, snes.reason
    for used in (snes, jacobian, w, *bounds):
        used.destroy()
    if reason < 0 or not np.isfinite(found).all():
        raise InputError(
            f"SNES-VI did not find the flow of water in {steps} steps (reason {reason}); use a"
            f" finer mesh, or examine the steps with -{SEEPAGE}snes_monitor."
        )
    return found, steps


def _rows(matrix: sp.csr_matrix) -> tuple[npt.NDArray[Any], npt.NDArray[Any], Floats]:
    """Return the row pointers, columns and values of a matrix, in PETSc's types."""
    of_petsc = PETSc.IntType
    values = np.asarray(matrix.data, dtype=np.float64)
    return matrix.indptr.astype(of_petsc), matrix.indices.astype(of_petsc), values


def _edges(x: Floats, cells: Longs, conductivities: Floats) -> tuple[Longs, Floats]:
    """Return the edges of cells and their conductances T_ij = −∫ k ∇φᵢ·∇φⱼ.

    Args:
        x: Vertices of the cells, shape (n, d + 1, d).
        cells: Numbers of these vertices, shape (n, d + 1).
        conductivities: Conductivities in each direction, shape (n, d).

    Returns:
        Ends, shape (num_edges, 2), and conductances, shape (num_edges,).
    """
    slopes, volumes = gradients(x)
    matrices = np.einsum("c,cai,ci,cbi->cab", volumes, slopes, conductivities, slopes)
    pairs = list(combinations(range(cells.shape[1]), 2))
    ends = np.concatenate([np.sort(cells[:, pair], axis=1) for pair in pairs])
    values = np.concatenate([-matrices[:, a, b] for a, b in pairs])
    edges, which = np.unique(ends, axis=0, return_inverse=True)
    return edges, np.bincount(which.ravel(), values, len(edges)).astype(np.float64)


def _merged(x: Floats, bodies: Ints) -> Longs:
    """Return a number for each vertex, equal for coincident vertices of different bodies.

    Vertices of one body remain separate, as on the two sides of a cut.

    Args:
        x: Coordinates, shape (num_vertices, d).
        bodies: Number of the body of each vertex. Vertices with −1 get the number −1.
    """
    used = np.flatnonzero(bodies >= 0)
    tree = cKDTree(x[used])
    size = float(np.ptp(x[used], axis=0).max())
    pairs = tree.query_pairs(COINCIDE * size, output_type="ndarray")
    apart = bodies[used][pairs[:, 0]] != bodies[used][pairs[:, 1]]
    pairs = pairs[apart]
    count = len(used)
    graph = sp.coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    _, merged = connected_components(graph, directed=False)
    numbers = np.full(len(x), -1, dtype=np.int64)
    numbers[used] = merged
    return numbers
