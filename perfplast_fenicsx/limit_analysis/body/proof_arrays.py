"""Write proofs of bounds as plain arrays, and mark as strict the bounds that the checker proves.

:class:`proof.body.Body` lists the arrays, and :mod:`proof.checker` checks them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs, matrices
from perfplast_fenicsx.contact.declared.obstacles import Plane
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, JointProof
from perfplast_fenicsx.limit_analysis.conic.cone import Provable
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import (
    Side,
    profiles_of_cells,
    steepness_of_cells,
)
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import is_divided
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, FacetLoads, bound_body
from perfplast_fenicsx.limit_analysis.statements.limit_checks import collapses_by_loads
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Question, Scope
from perfplast_fenicsx.mesh.global_ordering import (
    Block,
    Ordering,
    block,
    cell_ordering,
    node_ordering,
    with_ghosts,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, facets_of, has_curved_cells
from perfplast_fenicsx.problem.declared.loads import check_bounded
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.proof.checker import check_halves
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.verdict import Checked


def cones_on_file(problem: Problem, of_cells: Ordering, side: Side) -> dict[str, Block]:
    """Return the cones of the bodies, each cell's cone, and its strength if strengths vary.

    Collective. If the friction angle varies, cells with different angles have different cones.

    Args:
        problem: The bodies.
        of_cells: Order of the cells in the file.
        side: Side on which linear functions bound the profiles of varying strengths.
    """
    found = body_cones(problem)
    tagged_mesh = problem.tagged_mesh
    d = tagged_mesh.mesh.topology.dim
    m = 4 if tagged_mesh.axisymmetric else d * (d + 1) // 2
    numbers = np.full(len(found.cones), -1)
    rows: list[tuple[Any, ...]] = []
    none = (np.zeros(m), np.zeros((m, m)))
    for number, cone in enumerate(found.cones):
        if (principal := cone.principal) is not None:
            cut = principal.tension if np.isfinite(principal.tension) else np.nan
            rows.append((principal.bound, *none, principal.sine, cut, np.nan))
        elif (plain := cone.plain) is not None:
            matrix = np.pad(plain.matrix, ((0, m - len(plain.matrix)), (0, 0)))
            rows.append((plain.bound, plain.slope, matrix, np.nan, np.nan, np.nan))
        elif isinstance(cone.other, Provable):
            told = cone.other.on_file()
            rest = [told.get(f"cone_{name}", np.nan) for name in ("sine", "tension", "curvature")]
            rows.append((told["cone_bound"], *none, *rest))
        else:
            continue
        numbers[number] = len(rows) - 1
    columns = zip(*rows, strict=True) if rows else ((),) * 6
    bounds, slopes, forms, sines, cuts, bends = map(np.array, columns)
    of_each = numbers[found.of_cells]
    if (steepness := steepness_of_cells(problem, side)) is not None:
        of_each, kinds, steep = _unlike(problem, of_each, steepness)
        bounds, slopes, forms, sines, cuts, bends = (
            it[kinds] for it in (bounds, slopes, forms, sines, cuts, bends)
        )
        slopes *= steep[:, None]
    profile = profiles_of_cells(problem, side)
    some = {} if profile is None else {"cell_strength": block(of_cells, profile)}
    if not np.isnan(bends).all():
        some["cone_curvature"] = table_of(problem, bends, (), np.float64)
    return {
        **some,
        "cone": block(of_cells, of_each),
        "cone_bound": table_of(problem, bounds, (), np.float64),
        "cone_slope": table_of(problem, slopes, (m,), np.float64),
        "cone_matrix": table_of(problem, forms, (m, m), np.float64),
        "cone_sine": table_of(problem, sines, (), np.float64),
        "cone_tension": table_of(problem, cuts, (), np.float64),
    }


def _unlike(problem: Problem, kinds: Longs, steepness: Floats) -> tuple[Longs, Longs, Floats]:
    """Number the distinct pairs of a kind of cone and a factor for its slope. Collective.

    Args:
        problem: Problem with the ranks.
        kinds: Kind of cone of each cell of this rank, -1 for elastic cells, shape (num_cells,).
        steepness: Factor for the slope of each cell's cone, shape (num_cells,).

    Returns:
        The number of each cell, -1 for elastic cells; then the kind and the factor of each number,
        the same on all ranks.
    """
    plastic = kinds >= 0
    own = np.column_stack([kinds, steepness])[plastic]
    every = np.unique(np.concatenate(problem.comm.allgather(np.unique(own, axis=0))), axis=0)
    found = np.full(len(kinds), -1)
    _, numbers = np.unique(np.concatenate([every, own]), axis=0, return_inverse=True)
    found[plastic] = numbers.ravel()[len(every) :]
    return found, every[:, 0].astype(np.int64), every[:, 1]


def table_of(
    problem: Problem, rows: Sequence | npt.NDArray, shape: tuple[int, ...], kind: npt.DTypeLike
) -> Block:
    """Return an array that rank 0 writes, from rows that every rank has.

    Args:
        problem: Problem with the ranks.
        rows: The rows, the same on all ranks.
        shape: Shape of a row.
        kind: Data type of the numbers.
    """
    values = np.asarray(rows, dtype=kind).reshape(len(rows), *shape)
    return Block(values if problem.comm.rank == 0 else values[:0], 0, len(rows))


@dataclass(frozen=True, eq=False)
class Places:
    """Positions of a rank's rows in the file.

    Attributes:
        of_cells: Order of the owned cells.
        of_facets: Order of the outer facets.
    """

    of_cells: Ordering
    of_facets: Ordering


def loads_on_file(
    problem: Problem, body: BoundBody, question: Question, places: Places
) -> dict[str, Block]:
    """Return the arrays of all loads. Collective.

    Args:
        problem: The bodies.
        body: The discrete data of both bound theorems.
        question: The loads that λ multiplies.
        places: Positions of the cells and facets of this rank in the file.
    """
    d, outer = body.vertices.shape[2], body.geometry.exterior
    found: dict[str, Block] = {}
    for prefix, loads in _kinds(problem, body, question).items():
        pushes = body.geometry.at_corners(outer, loads.tractions[outer])
        found[f"{prefix}body_force"] = block(places.of_cells, loads.forces)
        found[f"{prefix}traction"] = block(places.of_facets, pushes)
        if loads.wet:
            found[f"{prefix}pore_pressure"] = block(places.of_cells, loads.pores)
        if body.rigid.names:
            forces, moments = list(loads.rigid_forces), list(loads.rigid_moments)
            found[f"{prefix}rigid_force"] = table_of(problem, forces, (d,), np.float64)
            found[f"{prefix}rigid_moment"] = table_of(problem, moments, (2 * d - 3,), np.float64)
    return found


def _kinds(problem: Problem, body: BoundBody, question: Question) -> dict[str, FacetLoads]:
    """Return the loads by the prefix that their arrays have in the file."""
    if question is Question.STANDS:
        return {"": body.dead, "any_": body.live}
    if any(load.constant for load in problem.given.loads):
        return {"": body.live, "constant_": body.dead}
    return {"": body.live}


Blocks = dict[str, Block]
"""Arrays by name."""


@dataclass(frozen=True)
class StressProof:
    """A stress that proves a lower bound.

    Attributes:
        problem: The problem, on straight cells.
        bound: The lower bound λ.
        stress: Mandel vectors at the vertices of this rank's cells, shape (num_cells, tdim + 1, m),
            or coefficients of rσ (:mod:`stress_cells`), shape (num_cells, 6, 4).
        question: The loads that λ multiplies.
        aside: Factor of the live loads if λ multiplies the constant loads.
        factor: Factor of the loads that the stress balances; None for λ.
        divisor: F that divides strengths; None without such a factor.
    """

    problem: Problem
    bound: float
    stress: Floats
    question: Question = Question.LIMIT
    aside: float = 0.0
    factor: float | None = None
    divisor: float | None = None


@dataclass(frozen=True)
class ForceProof:
    """Forces on the joints of rigid blocks that prove a lower bound.

    Attributes:
        problem: The problem, on straight cells of bodies that cannot yield.
        bound: The lower bound λ.
        joints: The forces.
        question: The loads that λ multiplies.
        divisor: F that divides strengths; None without such a factor.
    """

    problem: Problem
    bound: float
    joints: JointProof
    question: Question = Question.LIMIT
    divisor: float | None = None

    @property
    def aside(self) -> float:
        """Return the factor of the free loads."""
        return self.joints.best.aside

    @property
    def factor(self) -> float:
        """Return the factor of the loads that the forces balance."""
        return self.joints.best.factor


@dataclass(frozen=True)
class VelocityProof:
    """A velocity that proves an upper bound.

    Attributes:
        problem: The problem, on straight cells.
        bound: The upper bound λ.
        velocity: A function in the problem's V, with up-to-date ghosts; in axisymmetry v = ru.
        question: The loads that λ multiplies.
        divisor: F that divides strengths; None without such a factor.
    """

    problem: Problem
    bound: float
    velocity: fem.Function
    question: Question = Question.LIMIT
    divisor: float | None = None


LowerProof = StressProof | ForceProof
"""The proof of a lower bound."""


def proofs(
    low: BodyBounds, high: BodyBounds, divisor: float | None = None
) -> tuple[LowerProof | None, VelocityProof | None]:
    """Return the proofs of a lower and an upper bound; None for a bound that cannot be strict.

    Args:
        low: Bounds on the mesh of the lower bound.
        high: Bounds on the mesh of the upper bound.
        divisor: F that divides the strengths of the bodies; None without such a factor.
    """
    stress: LowerProof | None = None
    velocity = None
    if low.lower.can_be_strict and low.lower.value is not None and low.joints is not None:
        stress = ForceProof(low.problem, low.lower.value, low.joints, low.question, divisor)
    elif low.lower.can_be_strict and low.lower.value is not None and low.stress is not None:
        aside = 0.0 if low.static is None else low.static.aside
        of = low.weaker or low.problem
        value, question = low.lower.value, low.question
        factor = None if low.static is None else low.static.bound.value
        stress = StressProof(of, value, low.stress, question, aside, factor, divisor)
    if high.upper.can_be_strict and high.upper.value is not None:
        flow = high.flow
        value, question = high.upper.value, high.question
        velocity = VelocityProof(flow.problem, value, flow.velocity, question, divisor)
    return stress, velocity


Numbers = dict[str, dict[str, float | int]]
"""Attributes of each half of a proof (lower, upper), by name."""


def half_arrays(
    lower: LowerProof | None, upper: VelocityProof | None
) -> tuple[dict[str, Blocks], Numbers]:
    """Return the arrays and numbers of both halves of a proof. Collective.

    Args:
        lower: The lower half, if there is one.
        upper: The upper half, if there is one; its mesh may differ from the lower half's mesh.

    Returns:
        Arrays and numbers, by half ("lower", "upper").

    Raises:
        InputError: If cells or obstacles are curved, or if proofs do not support the loads.
    """
    blocks: dict[str, Blocks] = {}
    numbers: Numbers = {}
    for half in (lower, upper):
        if half is not None:
            _check(half.problem)
    if lower is not None:
        proof = _stress(lower) if isinstance(lower, StressProof) else _forces(lower)
        blocks["lower"] = _body(lower, False) | proof
        numbers["lower"] = {"bound": lower.bound}
        if lower.factor is not None and lower.factor != lower.bound:
            numbers["lower"]["factor"] = lower.factor
        if lower.question is Question.STANDS:
            numbers["lower"]["any_factor"] = lower.aside
        inner = lower.joints.inner if isinstance(lower, ForceProof) else None
        if inner is not None:
            numbers["lower"]["inner_factor"] = inner.factor
            if lower.question is Question.STANDS:
                numbers["lower"]["inner_any_factor"] = inner.aside
    if upper is not None:
        blocks["upper"] = _body(upper, True) | _velocity(upper)
        numbers["upper"] = {"bound": upper.bound}

    for kind, one in (("lower", lower), ("upper", upper)):
        if one is not None and one.problem.tagged_mesh.axisymmetric:
            numbers[kind]["revolved"] = 1
        if one is not None and one.divisor is not None:
            numbers[kind]["strength_factor"] = one.divisor

    return blocks, numbers


def _check(problem: Problem) -> None:
    """Refuse problems that the file format cannot describe. Collective."""
    if has_curved_cells(problem.tagged_mesh.mesh):
        raise InputError("curved cells have no strict bounds; use first-order cells.")
    for obstacle in problem.given.obstacles:
        if not isinstance(obstacle, Plane):
            raise InputError(
                f"the obstacle at '{obstacle.on}' is curved, but proofs need planes; give a plane."
            )
    for load in problem.given.loads:
        check_bounded(load)
    if not collapses_by_loads(problem):
        raise InputError(
            "a proof needs a load and no motion that grows with ζ; add a load or remove the motion."
        )


def _stress(proof: StressProof) -> Blocks:
    """Return the stress as symmetric matrices. Collective."""
    mesh = proof.problem.tagged_mesh.mesh
    d = mesh.geometry.dim
    stress = matrices(proof.stress)[..., :d, :d]
    if proof.problem.tagged_mesh.axisymmetric:
        stress = stress[:, [0, 1, 2, 5, 4, 3]]  # in the order of the velocity's nodes
    return {"stress": block(cell_ordering(mesh), stress.copy())}


def _forces(proof: ForceProof) -> Blocks:
    """Return forces at the vertices of outer facets, and any adhesive tractions. Collective."""
    places, found = _places(proof.problem), {}
    for prefix, of in (("joint", proof.joints.best), ("inner", proof.joints.inner)):
        if of is None:
            continue
        found[f"{prefix}_force"] = block(places.of_facets, of.forces)
        if proof.problem.comm.allreduce(bool(of.tractions.any())):
            found[f"{prefix}_traction"] = block(places.of_facets, of.tractions)
    return found


def _velocity(proof: VelocityProof) -> Blocks:
    """Return the velocity at the nodes, and the nodes of each cell. Collective.

    The file contains quadratic velocities; the function interpolates a linear velocity.
    """
    velocity, mesh = proof.velocity, proof.problem.tagged_mesh.mesh
    d = mesh.topology.dim
    if proof.problem.degree == 1:
        velocity = fem.Function(fem.functionspace(mesh, ("P", 2, (d,))))
        velocity.interpolate(proof.velocity)
        velocity.x.scatter_forward()
    V = velocity.function_space
    index_map = V.dofmap.index_map
    nodes = node_ordering(mesh, V.dofmap.list, index_map)
    layout = V.dofmap.dof_layout
    columns = [layout.entity_dofs(0, i)[0] for i in range(d + 1)]
    edges = {}
    for edge in range(d * (d + 1) // 2):
        middle = layout.entity_dofs(1, edge)
        ends = [columns.index(n) for n in layout.entity_closure_dofs(1, edge) if n not in middle]
        edges[tuple(sorted(ends))] = middle[0]
    columns += [edges[pair] for pair in combinations(range(d + 1), 2)]
    numbers = with_ghosts(index_map, nodes.numbers())
    owned = mesh.topology.index_map(d).size_local
    values = velocity.x.array.reshape(-1, d)[: index_map.size_local]
    return {
        "velocity": block(nodes, values),
        "nodes": block(cell_ordering(mesh), numbers[V.dofmap.list[:owned][:, columns]]),
    }


def _places(problem: Problem) -> Places:
    """Return the positions of cells and outer facets in the file. Collective."""
    mesh, geometry = problem.tagged_mesh.mesh, bound_body(problem).geometry
    topology, outer = mesh.topology, geometry.exterior
    keys = np.asarray(topology.original_cell_index, dtype=np.int64)[geometry.cell[outer]]
    keys = (topology.dim + 1) * keys + geometry.side[outer]
    return Places(cell_ordering(mesh), Ordering(problem.comm, keys))


def _body(proof: LowerProof | VelocityProof, follows: bool) -> Blocks:
    """Return the arrays of the bodies, their loads, supports and contact. Collective.

    Args:
        proof: Proof with the bodies and loads.
        follows: Whether all slip is treated as associated. If false, contacts whose friction is not
            associated keep only their adhesion.
    """
    problem, question = proof.problem, proof.question
    tagged_mesh, body = problem.tagged_mesh, bound_body(problem)
    mesh = tagged_mesh.mesh
    d, topology = mesh.topology.dim, mesh.topology
    cells, points = corners(mesh)
    vertices = node_ordering(mesh, cells, topology.index_map(0))
    numbers = with_ghosts(topology.index_map(0), vertices.numbers())
    outer = body.geometry.exterior
    of_cells, sides = body.geometry.cell[outer], body.geometry.side[outer]
    places = _places(problem)
    facets = np.take_along_axis(cells[of_cells], facets_of(d)[sides], axis=1)

    named = {name for it in body.interfaces for name in it.surfaces} | {*body.rigid.names}
    tags = {name: number for number, name in enumerate(sorted(named), start=1)}
    surface = np.zeros(len(outer), dtype=np.int64)
    for name, number in tags.items():
        surface[np.isin(outer, tagged_mesh.facets(name))] = number
    rubbing = {}
    kinds = {
        "contact": [it for it in body.interfaces if it.obstacle is None],
        "obstacle": [it for it in body.interfaces if it.obstacle is not None],
    }
    for kind, shape in (("contact", (2,)), ("obstacle", ())):
        met = [[tags[name] for name in it.surfaces] for it in kinds[kind]]
        rubbing[f"{kind}s"] = table_of(problem, met, shape, np.int64)
        for name in ("adhesion", "friction"):
            known = [follows or name == "adhesion" or it.strength.associated for it in kinds[kind]]
            values = [
                getattr(it.strength, name) if there else 0.0
                for it, there in zip(kinds[kind], known, strict=True)
            ]
            rubbing[f"{kind}_{name}"] = table_of(problem, values, (), np.float64)
        if proof.divisor is not None:
            kept = [not it.strength.reduced for it in kinds[kind]]
            rubbing[f"{kind}_kept"] = table_of(problem, kept, (), np.uint8)
    guided = {"guided": block(places.of_facets, body.guided[outer])}
    into = [it.into for it in body.interfaces if it.into is not None]
    return {
        **loads_on_file(problem, body, question, places),
        **rubbing,
        **(guided if problem.guides.surfaces else {}),
        **({} if proof.divisor is None else {"cell_kept": _kept(problem, places.of_cells)}),
        "vertices": block(vertices, points[: topology.index_map(0).size_local]),
        "cells": block(places.of_cells, numbers[cells]),
        **cones_on_file(problem, places.of_cells, "above" if follows else "below"),
        "facets": block(places.of_facets, numbers[facets]),
        "surface": block(places.of_facets, surface),
        "held": block(places.of_facets, body.supported[outer].astype(np.uint8)),
        "rigid": table_of(problem, [tags[name] for name in body.rigid.names], (), np.int64),
        "rigid_held": table_of(problem, list(body.rigid.free[:, :d] == 0), (d,), np.uint8),
        "obstacle_normals": table_of(problem, into, (d,), np.float64),
    }


def _kept(problem: Problem, of_cells: Ordering) -> Block:
    """Return a flag for each cell, 1 where F does not divide the strength."""
    topology = problem.tagged_mesh.mesh.topology
    flags = np.zeros(topology.index_map(topology.dim).size_local, dtype=np.uint8)
    for name, material in problem.given.materials.items():
        if not is_divided(material):
            cells = problem.tagged_mesh.cells(name)
            flags[cells[cells < len(flags)]] = 1
    return block(of_cells, flags)


Ask = Callable[[LowerProof | None, VelocityProof | None], Mapping[str, Checked]]
"""A function that runs the checker. Collective; rank 0 returns the result."""

Refusal = tuple[tuple[str, ...], float]
"""The faults of a half of a proof, and the factor by which its stresses may exceed the strength."""


def proven(bounds: BodyBounds) -> BodyBounds:
    """Return bounds that are strict where the checker proves them. Collective.

    Args:
        bounds: The bounds that the solvers found.
    """
    comm = bounds.problem.comm

    def ask(lower: LowerProof | None, upper: VelocityProof | None) -> dict[str, Checked]:
        blocks, numbers = half_arrays(lower, upper)
        halves = {}
        for kind, half in blocks.items():
            whole = {name: comm.gather(rows.values, root=0) for name, rows in half.items()}
            halves[kind] = {name: np.concatenate(of) for name, of in whole.items() if of}
            halves[kind] |= {name: np.asarray(of) for name, of in numbers[kind].items()}
        return check_halves(halves) if comm.rank == 0 else {}

    low, high = proven_part(bounds, bounds, ask)
    if bounds.weaker is not None and not (low.lower.strict and high.upper.strict):
        # The halves use different substitutes for pore pressures with kinks: one above, one below.
        # Therefore the checker receives each half separately.
        lower, upper = (
            replace(of, value=None, of=Scope.MESH) for of in (bounds.lower, bounds.upper)
        )
        low, high = replace(bounds, upper=upper), replace(bounds, lower=lower)
        low = proven_part(low, low, ask)[0]
        high = proven_part(high, high, ask)[1]
    return replace(bounds, lower=low.lower, upper=high.upper)


def proven_part(
    low: BodyBounds, high: BodyBounds, ask: Ask, divisor: float | None = None
) -> tuple[BodyBounds, BodyBounds]:
    """Return bounds that are strict where a checker proves them. Collective.

    A bound gets the value that the checker proves, if this value is worse than the computed one, or
    better by more than rounding. Other bounds that the checker refuses become bounds of the mesh.

    Args:
        low: Result with the lower bound.
        high: Result with the upper bound.
        ask: Function that runs the checker.
        divisor: F that divides the strengths of the bodies; None without such a factor.
    """
    comm, claimed = low.problem.comm, (low.lower.value, high.upper.value)
    while (halves := proofs(low, high, divisor)) != (None, None):
        refused, reached = comm.bcast(_answered(ask, *halves))
        both = (low.lower, high.upper)
        worse = {
            bound.kind: bound.proven(reached[bound.kind])
            for bound, before in zip(both, claimed, strict=True)
            if bound.kind in refused
            and reached.get(bound.kind) not in (None, before)
            and bound.value == before
        }
        lower, upper = (_judged(bound, worse, refused, reached) for bound in both)
        low = low if lower is low.lower else replace(low, lower=lower)
        high = high if upper is high.upper else replace(high, upper=upper)
        if not refused:
            break
    return low, high


def _judged(
    bound: Bound,
    worse: Mapping[str, Bound],
    refused: Mapping[str, Refusal],
    reached: Mapping[str, float | None],
) -> Bound:
    """Return a bound after the check.

    Args:
        bound: A bound.
        worse: Bounds for which the checker proves only a worse value, which it must check again.
        refused: The reason for each refusal, by kind of bound.
        reached: The value that the checker proves, by kind of bound; None if it proves no value.
    """
    if bound.kind in worse:
        return worse[bound.kind]
    if not bound.can_be_strict:
        return bound
    if not refused:
        found = reached.get(bound.kind)
        if bound.is_improved_by(found):
            return bound.proven(found)
        return bound.proven() if bound.doubts else bound
    return bound if worse or bound.kind not in refused else bound.refused(*refused[bound.kind])


def _answered(
    ask: Ask, lower: LowerProof | None, upper: VelocityProof | None
) -> tuple[dict[str, Refusal], dict[str, float | None]]:
    """Return the refusals of halves, and the bounds that the halves prove, both by kind."""
    try:
        found = ask(lower, upper)
    except ProofError as error:
        return dict.fromkeys(("lower", "upper"), ((str(error),), 1.0)), {}
    refused = {kind: (half.faults, half.over) for kind, half in found.items() if half.faults}
    return refused, {kind: half.reached for kind, half in found.items()}
