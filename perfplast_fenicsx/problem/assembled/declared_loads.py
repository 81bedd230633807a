"""Assemble the declared loads into the vectors L₀, which acts at any ζ, and L₁, which ζ multiplies.

The energy of (P)_ζ is J_ζ(v) = Ψ(ε(v)) − L₀(v) − ζL₁(v). Only this module evaluates the last two
terms of J_ζ.

The module also evaluates tractions that are linear on facets and pore pressures that are linear in
cells. Stresses that are linear in the cells can balance such loads.

The module replaces a formula by the quadratic function with the same values at vertices and
midside nodes (:mod:`perfplast_fenicsx.problem.declared.loads`). In straight cells this is exact for
formulas of degree 2. In curved cells it is exact only for formulas of degree 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.compat import create_vector
from perfplast_fenicsx.errors import InputError, on_all_ranks, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.rigid_rows import find_leaders
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.declared.loads import (
    CosinePressure,
    EnclosedPores,
    FieldPores,
    Force,
    ForceBelow,
    Formula,
    Load,
    PorePressure,
    Pressure,
    SpreadLoad,
    Traction,
    kind_of,
)
from perfplast_fenicsx.problem.declared.supports import RigidSurface


@dataclass(frozen=True)
class LoadCase:
    """Constant (dead) and live loads; all methods are collective.

    Attributes:
        dead: L₀ as a vector in the dual space of V, zero at supported unknowns (ghosts summed).
        live: L₁, the growing loads at ζ = 1, in the same form.
        held: The parts of both vectors at supported unknowns; None if there are none. These parts
            do no work on displacements; the supports bear them directly.
    """

    dead: PETSc.Vec
    live: PETSc.Vec
    held: "LoadCase | None" = None

    @staticmethod
    def of(dead: PETSc.Vec, live: PETSc.Vec, bcs: list[fem.DirichletBC]) -> "LoadCase":
        """Return a load case from vectors with entries at supported unknowns.

        The entries at supported unknowns are moved to ``held``.
        """
        held = LoadCase(dead.copy(), live.copy())
        for all_of_it, rest in ((dead, held.dead), (live, held.live)):
            fem_petsc.set_bc(all_of_it, bcs)
            rest.axpy(-1.0, all_of_it)
        return LoadCase(dead, live, held)

    def total(self, zeta: float, out: PETSc.Vec) -> PETSc.Vec:
        """Set ``out`` to L₀ + ζL₁ and return it."""
        self.dead.copy(out)
        out.axpy(zeta, self.live)
        return out

    def subtract_from(self, force: PETSc.Vec, zeta: float, times: float = 1.0) -> None:
        """Subtract L₀ + ζL₁ from the internal forces, to get the gradient of J_ζ.

        Args:
            force: The internal forces.
            zeta: Load factor ζ.
            times: Factor of L₀.
        """
        force.axpy(-zeta, self.live)
        force.axpy(-times, self.dead)

    def norm(self, zeta: float) -> float:
        """Return the Euclidean norm of L₀ + ζL₁ (force)."""
        total = self.total(zeta, self.live.duplicate())
        norm = float(total.norm())
        total.destroy()
        return norm

    def alpha(self, u: PETSc.Vec) -> float:
        """Return the work of the live loads α = L₁(u), which work control prescribes."""
        return float(self.live.dot(u))

    def dead_work(self, u: PETSc.Vec) -> float:
        """Return the work of the constant loads L₀(u)."""
        return float(self.dead.dot(u))

    def work(self, u: PETSc.Vec, zeta: float) -> float:
        """Return the work of all loads L₀(u) + ζL₁(u)."""
        return self.dead_work(u) + zeta * self.alpha(u)

    def add_all_to(self, force: PETSc.Vec, zeta: float) -> None:
        """Add L₀ + ζL₁ to ``force``, including the parts at supported unknowns."""
        for loads in (self, self.held):
            if loads is not None:
                force.axpy(zeta, loads.live)
                force.axpy(1.0, loads.dead)

    def has_dead(self) -> bool:
        """Return whether any load acts at ζ = 0. Collective."""
        return float(self.dead.norm()) > 0

    def grows(self) -> bool:
        """Return whether ζ multiplies any load."""
        return float(self.live.norm()) > 0


ROUNDING = 1e-12
"""Largest difference, relative to the largest value, of a linear traction at a midside from the
mean of its values at the ends. Formulas whose terms cancel lose some digits."""


def linear_tractions(load: Load, corners: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return tractions at the vertices of straight facets at ζ = 1, and errors of linearity.

    Not collective.

    Args:
        load: A traction, a pressure, or the cosine pressure of a bearing.
        corners: Vertices of the facets, shape (n, d, d).
        normals: Outward unit normals, shape (n, d).

    Returns:
        The tractions at the vertices, shape (n, d, d); and the largest difference between the
        quadratic and the linear traction at midsides (stress), shape (n,).

    Raises:
        InputError: If the formula is not finite on these facets.
        TypeError: If the load is of another kind.
    """
    at_ends = _values(load, corners, normals)
    return at_ends, _off(at_ends, _values(load, _middles(corners), normals))


def linear_pores(load: PorePressure, corners: Floats) -> tuple[Floats, Floats]:
    """Return pore pressures at the vertices of straight cells at ζ = 1, and errors of linearity.

    Not collective.

    Args:
        load: The pore pressure.
        corners: Vertices of the cells, shape (n, d + 1, d).

    Returns:
        The pressures at the vertices, shape (n, d + 1); and the largest difference between the
        quadratic and the linear pressure at midsides (stress), shape (n,).

    Raises:
        InputError: If the formula is not finite in these cells.
        TypeError: If no linear function can enclose the pressure.
    """
    place = f"the load on '{load.on}'"
    values = load.at_corners(corners)
    if values is not None:
        return values, np.zeros(len(corners))
    if isinstance(load, EnclosedPores):
        raise TypeError(f"{place} has no linear functions around it")
    at_ends, at_middles = (
        evaluate(load.value, _points(x), place).reshape(x.shape[:2])
        for x in (corners, _middles(corners))
    )
    return at_ends, _off(at_ends[..., None], at_middles[..., None])


def _edges(count: int) -> list[tuple[int, int]]:
    """Return the vertex numbers at the ends of the edges of a simplex with ``count`` vertices."""
    return list(combinations(range(count), 2))


def _middles(corners: Floats) -> Floats:
    """Return the midpoints of the edges of each simplex, shape (n, num_edges, d)."""
    edges = _edges(corners.shape[1])
    return np.stack([corners[:, edge].mean(axis=1) for edge in edges], axis=1)


def _off(at_ends: Floats, at_middles: Floats) -> Floats:
    """Return the largest difference of a midside value from the mean of its ends, by simplex."""
    off: Floats = np.abs(at_middles - _middles(at_ends)).max(axis=(1, 2), initial=0.0)
    return off


def _points(x: Floats) -> Floats:
    """Return the points of all simplices as one list, with three coordinates each."""
    points = np.zeros((x.shape[0] * x.shape[1], 3))
    points[:, : x.shape[2]] = x.reshape(-1, x.shape[2])
    return points


def _values(load: Load, x: Floats, normals: Floats) -> Floats:
    """Return the tractions at points of each facet, shape (n, k, d) like the points."""
    count, of_each, d = x.shape
    points, place = _points(x), f"the load on '{load.on}'"
    if isinstance(load, Pressure):
        pressures = evaluate(load.value, points, place).reshape(count, of_each, 1)
        return -pressures * normals[:, None]
    if isinstance(load, CosinePressure):
        pressure = np.maximum(-(normals @ np.asarray(load.value, dtype=np.float64)), 0.0)
        return np.repeat((-pressure[:, None] * normals)[:, None], of_each, axis=1)
    if isinstance(load, Traction):
        each = [evaluate(value, points, place) for value in load.value]
        return np.stack(each, axis=1).reshape(count, of_each, d)
    raise TypeError(f"a {type(load).__name__} has no tractions")


def work_form(tagged_mesh: TaggedMesh, loads: Sequence[SpreadLoad], v: ufl.Argument) -> ufl.Form:
    """Return the linear form L(v) of ``loads``, which must contain at least one load.

    Collective.

    Raises:
        InputError: For an unknown name, a value that is not finite, or an invalid formula.
    """
    mesh = tagged_mesh.mesh
    kinematics = tagged_mesh.kinematics
    ds, dx = (
        kinematics.measure(ufl.Measure(kind, domain=mesh, subdomain_data=tags))
        for kind, tags in (("ds", tagged_mesh.facet_tags), ("dx", tagged_mesh.cell_tags))
    )
    terms = []
    for load in loads:
        value = _value(tagged_mesh, load)
        tag = (tagged_mesh.volumes if load.in_volume else tagged_mesh.surfaces)[load.on]
        terms.append(load.work(value, v, tagged_mesh) * (dx if load.in_volume else ds)(tag))
    return sum(terms[1:], start=terms[0])


def _value(tagged_mesh: TaggedMesh, load: SpreadLoad) -> Expr:
    """Return the value of a load in UFL: a scalar, or a vector with an entry for each direction."""
    mesh = tagged_mesh.mesh
    in_volume, scalar = load.in_volume, load.scalar
    entities = tagged_mesh.cells(load.on) if in_volume else tagged_mesh.facets(load.on)
    values: list[Formula] = [load.value] if scalar else list(load.value)  # type: ignore[list-item, arg-type]
    expected = 1 if scalar else mesh.geometry.dim
    numbers = [value for value in values if not isinstance(value, str)]
    if len(values) != expected or not np.isfinite(np.asarray(numbers, dtype=float)).all():
        raise InputError(
            f"the {_kind(load)} on '{load.on}' is {load.value}; give {expected} finite "
            f"number{'s' if expected > 1 else ''}."
        )
    if isinstance(load, ForceBelow):
        return ufl.as_vector(values) * _below(tagged_mesh, load)
    if len(numbers) == len(values):
        constant = fem.Constant(mesh, np.asarray(values, dtype=default_scalar_type))
        return constant[0] if scalar else constant
    tdim = mesh.topology.dim
    found = [_field(tagged_mesh, load, value, tdim - (not in_volume), entities) for value in values]
    return found[0] if scalar else ufl.as_vector(found)


def _below(tagged_mesh: TaggedMesh, load: ForceBelow) -> fem.Function:
    """Return the function that is 1 in the cells below the line of the load, and 0 elsewhere.

    Collective.

    Raises:
        InputError: If the line divides a cell.
    """
    field = fem.Function(fem.functionspace(tagged_mesh.mesh, ("Discontinuous Lagrange", 0)))
    vertices, points = corners(tagged_mesh.mesh)
    cells = tagged_mesh.cells(load.on)
    owned = cells[cells < len(vertices)]

    def below() -> Ints:
        return owned[load.cells_below(points[vertices[owned]])]

    dofs = field.function_space.dofmap.list[on_all_ranks(tagged_mesh.mesh.comm, below)]
    field.x.array[dofs] = 1.0
    field.x.scatter_forward()
    return field


def _field(
    tagged_mesh: TaggedMesh, load: SpreadLoad, value: Formula, dim: int, entities: Ints
) -> fem.Function | fem.Constant:
    """Return ``value`` as a constant if it is a number, or else as a function on ``entities``."""
    mesh = tagged_mesh.mesh
    if not isinstance(value, str):
        return fem.Constant(mesh, default_scalar_type(value))
    if isinstance(load, EnclosedPores | FieldPores):
        linear = fem.Function(fem.functionspace(mesh, ("Discontinuous Lagrange", 1)))
        vertices, points = corners(mesh)
        owned = entities[entities < len(vertices)]
        values, _ = on_all_ranks(mesh.comm, lambda: linear_pores(load, points[vertices[owned]]))
        linear.x.array[linear.function_space.dofmap.list[owned]] = values
        linear.x.scatter_forward()
        return linear
    W = fem.functionspace(mesh, ("Lagrange", 2))
    field, message = fem.Function(W), None
    if dim == mesh.topology.dim:
        nodes = np.unique(W.dofmap.list[entities])
    else:
        nodes = fem.locate_dofs_topological(W, dim, entities)
    try:
        x = W.tabulate_dof_coordinates()[nodes]
        field.x.array[nodes] = evaluate(value, x, f"the {_kind(load)} on '{load.on}'")
    except InputError as error:
        message = str(error)
    raise_together(mesh.comm, message)
    return field


def _kind(load: SpreadLoad) -> str:
    """Return the kind and name of a load for messages."""
    kind = kind_of(load).replace("_", " ")
    return f"{kind} '{load.name}'" if load.name else kind


def declared_loads(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    loads: Sequence[Load],
    bcs: list[fem.DirichletBC],
    rigid: Sequence[RigidSurface],
    driven: bool,
    strained: bool,
) -> LoadCase:
    """Return the assembled loads of a problem. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        loads: The declared loads.
        bcs: Homogeneous conditions at the supports.
        rigid: Rigid surfaces, on which forces may act.
        driven: Whether ζ moves supports, obstacles or overlaps; the list of loads may then be
            empty.
        strained: Whether initial strains, overlaps or constant displacements load the bodies; the
            list of loads may then be empty.

    Raises:
        InputError: If a load does not fit the mesh, or if no load can do work.
    """
    growing = [load for load in loads if not load.constant]
    constant = [load for load in loads if load.constant]
    if not (driven or strained or loads):
        raise InputError("no load is given; give at least one load.")
    free = [surface.on for surface in rigid if surface.free]
    straight = {surface.on: surface for surface in rigid if surface.held}
    for load in loads:
        if isinstance(load, Force) and load.on not in free:
            raise InputError(
                f"the force on '{load.on}' acts on a rigid surface whose motion is prescribed; "
                "remove the motion or the force."
            )
        if not isinstance(load, Force) or load.on not in straight:
            continue
        surface = straight[load.on]
        if np.any(load.moment):
            raise InputError(
                f"the force on '{load.on}' has a moment, but held prevents this surface from "
                "rotating; remove the moment or held."
            )
        gdim = V.mesh.geometry.dim
        if not np.delete(load.vectors(gdim)[0], surface.axes(gdim)).any():
            raise InputError(
                f"the force on '{load.on}' has only components in directions in which held = "
                f"'{surface.held}' fixes the surface; give the force a component in another "
                "direction, or remove it."
            )
    dead, live = (work_vector(V, tagged_mesh, part) for part in (constant, growing))
    case = LoadCase.of(dead, live, bcs)
    still = bool(loads) and not case.grows()
    if not driven and still and (growing or not case.has_dead()):
        raise InputError(
            f"{'the growing' if growing else 'the'} loads do no work on any admissible "
            "displacement; give a load that is not zero on a surface that is free to move."
        )
    return case


def work_vector(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, loads: Sequence[Load]) -> PETSc.Vec:
    """Return the work L(v) of ``loads`` as a vector, with entries also at supported unknowns.

    Collective.
    """
    spread = [load for load in loads if isinstance(load, SpreadLoad)]
    work = create_vector(V)
    if spread:
        form = fem.form(work_form(tagged_mesh, spread, ufl.TestFunction(V)))
        assemble_force(work, form, [])
    for load in loads:
        if isinstance(load, Force):
            _add(V, tagged_mesh, load, work)
    return work


def _add(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, load: Force, work: PETSc.Vec) -> None:
    """Add the force on a rigid surface to ``work``, as forces on its leading nodes. Collective."""
    gdim, (first, last) = V.mesh.geometry.dim, V.dofmap.index_map.local_range
    leaders = find_leaders(V, tagged_mesh, load.on)
    forces = leaders.forces(*load.vectors(gdim))
    forces = forces / tagged_mesh.kinematics.carried(leaders.x)[:, None]
    at_nodes = work.array.reshape(-1, gdim)
    mine = (leaders.number >= first) & (leaders.number < last)
    at_nodes[leaders.number[mine] - first] += forces[mine]
