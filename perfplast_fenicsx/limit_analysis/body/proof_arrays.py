"""Write proofs of bounds as plain arrays: a stress, forces or a velocity, each with its bodies.

:class:`proof.body.Body` lists the arrays, and :mod:`proof.checker` checks them.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, matrices
from perfplast_fenicsx.contact.declared.obstacles import Plane
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, JointProof
from perfplast_fenicsx.limit_analysis.body.proof_cones import cones_on_file, table_of
from perfplast_fenicsx.limit_analysis.body.proof_loads import Places, loads_on_file
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import is_divided
from perfplast_fenicsx.limit_analysis.facets.bound_body import bound_body
from perfplast_fenicsx.limit_analysis.statements.limit_checks import collapses_by_loads
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.mesh.global_ordering import (
    Block,
    Ordering,
    block,
    cell_ordering,
    node_ordering,
    with_ghosts,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.problem.declared.loads import check_bounded
from perfplast_fenicsx.problem.problem import Problem

Blocks = dict[str, Block]
"""Arrays by name."""


@dataclass(frozen=True)
class StressProof:
    """A stress that proves a lower bound.

    Attributes:
        problem: The problem, on straight cells.
        bound: λ.
        stress: Mandel vectors at the vertices of this rank's cells, shape (num_cells, tdim + 1, m),
            or coefficients of rσ (:mod:`stress_cells`), shape (num_cells, 6, 4).
        question: The loads that λ multiplies.
        aside: Factor of the free loads.
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
        bound: λ.
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
        """Factor of the loads of any factor."""
        return self.joints.best.aside

    @property
    def factor(self) -> float:
        """That of the loads that the forces balance."""
        return self.joints.best.factor


@dataclass(frozen=True)
class VelocityProof:
    """A velocity that proves an upper bound.

    Attributes:
        problem: The problem, on straight cells.
        bound: λ.
        velocity: A function of its V, with up-to-date ghosts; in axisymmetry v = ru.
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
    """Return the proofs of a lower and an upper bound; None for bounds that cannot be strict.

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
"""Attributes of the halves, by name."""


def half_arrays(
    lower: LowerProof | None, upper: VelocityProof | None
) -> tuple[dict[str, Blocks], Numbers]:
    """Return the arrays and numbers of both halves of a proof. Collective.

    Args:
        lower: The lower half, if there is one.
        upper: The upper half; its bodies may be meshed differently.

    Returns:
        Arrays and numbers, by the kind of the half.

    Raises:
        InputError: If cells or obstacles are curved, or if no proof supports the kind of a load.
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
        raise InputError(
            "cells are curved, but strict bounds need straight cells; use first-order cells."
        )
    for obstacle in problem.given.obstacles:
        if not isinstance(obstacle, Plane):
            raise InputError(
                f"the obstacle at '{obstacle.on}' is curved, but a proof supports only planes."
            )
    for load in problem.given.loads:
        check_bounded(load)
    if not collapses_by_loads(problem):
        raise InputError("ζ moves supports, or no load grows; a proof needs loads that grow.")


def _stress(proof: StressProof) -> Blocks:
    """Return the stress as symmetric matrices. Collective."""
    mesh = proof.problem.tagged_mesh.mesh
    d = mesh.geometry.dim
    stress = matrices(proof.stress)[..., :d, :d]
    if proof.problem.tagged_mesh.axisymmetric:
        stress = stress[:, [0, 1, 2, 5, 4, 3]]  # numbered as the edges of velocities
    return {"stress": block(cell_ordering(mesh), stress.copy())}


def _forces(proof: ForceProof) -> Blocks:
    """The forces at the vertices of outer facets, and adhesive tractions if any. Collective."""
    places, found = _places(proof.problem), {}
    for prefix, of in (("joint", proof.joints.best), ("inner", proof.joints.inner)):
        if of is None:
            continue
        found[f"{prefix}_force"] = block(places.of_facets, of.forces)
        if proof.problem.comm.allreduce(bool(of.tractions.any())):
            found[f"{prefix}_traction"] = block(places.of_facets, of.tractions)
    return found


def _velocity(proof: VelocityProof) -> Blocks:
    """Return the velocity at its nodes, and the nodes of the cells. Collective.

    The file contains quadratic velocities; a linear velocity is also quadratic.
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
    """Return the bodies with loads, supports and contact. Collective.

    Args:
        proof: Proof with the bodies and loads.
        follows: Whether slip is associated. Otherwise only the adhesion counts where the friction
            itself is not associated.
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
    around = np.array([[j for j in range(d + 1) if j != i] for i in range(d + 1)])
    facets = np.take_along_axis(cells[of_cells], around[sides], axis=1)

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
    """Return which cells have a strength that F does not divide."""
    tagged_mesh = problem.tagged_mesh
    topology = tagged_mesh.mesh.topology
    flags = np.zeros(topology.index_map(topology.dim).size_local, dtype=np.uint8)
    for name, material in problem.given.materials.items():
        if not is_divided(material):
            cells = tagged_mesh.cells(name)
            flags[cells[cells < len(flags)]] = 1
    return block(of_cells, flags)
