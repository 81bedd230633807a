"""Compute an upper bound of a mechanism's plastic work, for any strain rates between the points.

In a straight cell the strain rate of a quadratic velocity is linear, and ‖·‖ is convex. So its
integral is at most that of its linear interpolation on any subdivision of the cell (the composite
vertex rule). Where volume changes vanish at the points, they vanish everywhere. The rates
tr ε ≥ α‖dev ε‖ of a dilating body are a convex cone. If they are admissible at the vertices, they
are admissible everywhere, and they dissipate (γ/α) tr ε, which is linear. Without penetration of
contact, the result is an upper bound for the body that the mesh fills, and not just for the mesh.
:mod:`slip_work` computes the dissipation of slip.

Strains of strong bodies that rest or move as rigid ones are rounding; they count with their true
strength. Remaining volume changes count as work that the loads do not do, with mean stresses as
large as tractions. Otherwise 1e-12 of them could give a wrong bound where loads nearly balance each
other.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import any_loose
from perfplast_fenicsx.limit_analysis.facets.bound_body import TWICE, FacetLoads, bound_body
from perfplast_fenicsx.limit_analysis.facets.entering import ENTERS, entering_between_nodes
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope, measure_of
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_loads
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.velocity.cell_dissipation import (
    SUBDIVISIONS,
    at_vertices,
    dissipation_of_cells,
    missing_growth,
    points_of_cells,
)
from perfplast_fenicsx.limit_analysis.velocity.mechanism_rates import (
    MechanismRates,
    mechanism_rates,
)
from perfplast_fenicsx.limit_analysis.velocity.ring_dissipation import dissipation_of_rings
from perfplast_fenicsx.limit_analysis.velocity.slip_work import slip_work
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

ADMISSIBLE = 1e-9
"""Share of ‖ε(v)‖ that is rounding: of volume changes in plastic bodies, of missing growth in
dilating ones, and of strains in elastic ones.
"""

GROWS_TOO_LITTLE = (
    "dilating bodies dilate enough only at the points of the mesh; control = 'bounds' looks"
    " for a mechanism in which they do everywhere"
)


def strict_upper_bound(
    problem: Problem,
    mechanism: fem.Function,
    subdivisions: int = SUBDIVISIONS,
    question: Question = Question.LIMIT,
    rates: MechanismRates | None = None,
) -> Bound:
    """Return the upper bound (dissipation less work of permanent loads) / L₁(v). Collective.

    Args:
        problem: The bodies and their loads.
        mechanism: Velocity with updated ghosts that is admissible at the points, such as that of
            :func:`discrete_limit.interior_point`.
        subdivisions: Parts of a cell's edge; with more parts the result falls towards the true
            work.
        question: The loads whose factor is sought.
        rates: Rates of the mechanism; evaluated by default.

    Returns:
        The bound. It has no value if the mechanism is not admissible at the points or does no work.
        It holds only for the mesh if there are reasons.

    Raises:
        InputError: If ζ moves supports or obstacles, or there is no load.
    """
    check_loads(problem)
    if problem.tagged_mesh.axisymmetric and not isinstance(problem.kinematics, RingFlux):
        why = (
            "only quadratic velocities on straight cells keep the volume of rings everywhere;"
            " use degree = 2 and first-order cells"
        )
        return Bound(None, "upper", Scope.MESH, (why,))
    flow = _Flow(
        problem, mechanism, mechanism_rates(problem, mechanism) if rates is None else rates
    )
    velocity, slip = mechanism.x.petsc_vec, slip_work(problem, mechanism)
    work, dead, aside = question.of(
        problem.loads.alpha(velocity), problem.loads.dead_work(velocity)
    )
    whole = flow.whole + slip.squares
    if problem.loads.has_dead():  # bodies may separate as rigid ones, without any strain
        whole = max(whole, flow.slowest)
    moves = _ends(problem, velocity, question, work, aside) and flow.is_held
    if not (moves and whole > 0 and flow.part <= ADMISSIBLE**2 * whole and work > 0):
        return Bound(None, "upper", Scope.MESH, ("the mechanism is not admissible",))
    if not flow.lacking <= ADMISSIBLE**2 * whole:
        return Bound(None, "upper", Scope.MESH, (GROWS_TOO_LITTLE,))
    cost = _cost(flow, whole, subdivisions)
    body = bound_body(problem)
    loose = cost.loose + any_loose(problem)
    dissipation = cost.dissipation + slip.power
    at_one, at_zero, _ = question.of(
        *(_largest_load(problem, of, cost.volume) for of in (body.live, body.dead))
    )
    excess = dissipation - dead
    stress = abs(excess / work) * at_one + at_zero
    # Work of the loads' own stress on volume changes, relative to that of the loads, up to which a
    # mechanism counts as a proof: half of the limit of a checker that works cell by cell.
    least_charge = 5e-10
    provable = cost.most * stress <= least_charge * measure_of(dissipation, excess, bool(loose))
    # Mean stresses, in multiples of the largest load, with which remaining volume changes and
    # strains of elastic bodies count as work. If pressures nearly balance each other, a strain of
    # 1e-12 is 1e-6 of the work.
    mean_stresses = 10.0
    excess += mean_stresses * cost.lost * at_zero
    work -= np.copysign(mean_stresses * cost.lost * at_one, excess)
    if not work > 0:
        return Bound(None, "upper", Scope.MESH, ("the mechanism is not admissible",))
    doubts = [] if provable else ["volume changes of the mechanism are more than rounding"]
    why_not, doubts = _reasons(problem, mechanism, [*doubts, *slip.why_not])
    of = Scope.MESH if why_not else Scope.BODY
    share = float(cost.allowed / dissipation) if dissipation > 0 else 0.0
    return Bound(float(excess / work), "upper", of, tuple(why_not), share, tuple(doubts))


def _reasons(
    problem: Problem, mechanism: fem.Function, doubts: list[str]
) -> tuple[list[str], list[str]]:
    """Return why a bound does not hold for the body, and why it may not. Collective.

    Args:
        problem: The bodies.
        mechanism: The velocity.
        doubts: Other reasons why it may not hold.
    """
    why_not = ["cells are curved"] if has_curved_cells(problem.tagged_mesh.mesh) else []
    for why in entering_between_nodes(problem, mechanism):
        (doubts if why == ENTERS else why_not).append(why)
    unknown = bound_body(problem).prevents
    if unknown is not None and unknown not in (TWICE, *why_not, *doubts):
        why_not.append(unknown)
    return ([*doubts, *why_not], []) if why_not else ([], doubts)


class _Flow:
    """The strain rates of a mechanism, and their inadmissible part.

    Attributes:
        problem: The bodies.
        mechanism: The velocity.
        rates: Strain rates at the points.
        plastic: Flags of points that can yield, shape (count,).
        dilating: Flags of points that dilate as they flow, shape (count,).
        squares: ‖dev ε‖² at the points, shape (count,).
        volumes: Volumes of the cells that this rank owns, shape (num_cells,).
        short: Missing part of tr ε for flow at the vertices of cells (:func:`missing_growth`).
        total: Volume of all bodies.
        part: Weighted sum of squares that must vanish: of volume changes and elastic strains.
        whole: Σ w‖ε‖².
        lacking: Sum of squares of ``short``.
        is_held: Whether the velocity vanishes where supports hold the bodies.
        slowest: Least ``whole`` that counts as strain, in bodies that separate.
    """

    def __init__(self, problem: Problem, mechanism: fem.Function, rates: MechanismRates) -> None:
        """Compute the sums over all ranks. Collective."""
        self.problem, self.mechanism, self.rates = problem, mechanism, rates
        trace, deviator, weights = rates.trace, rates.deviator, rates.weights
        comm = problem.comm
        self.plastic, self.dilating = np.isfinite(rates.radii), rates.slopes > 0
        self.squares: Floats = np.einsum("ni,ni->n", deviator, deviator)
        volume = trace**2 / rates.gdim
        wrong = np.where(self.dilating, 0.0, volume) + np.where(self.plastic, 0.0, self.squares)
        self.volumes: Floats = weights[points_of_cells(problem)].sum(axis=1)
        self.short = missing_growth(problem, rates)
        lacking = self.volumes @ (self.short**2).mean(axis=1)
        self.part, self.whole, self.lacking, self.total = comm.allreduce(
            np.array([weights @ wrong, weights @ (volume + self.squares), lacking, weights.sum()])
        )
        v = np.abs(mechanism.x.array.reshape(problem.fixed.shape))
        largest = np.array([v[problem.fixed].max(initial=0), v.max(initial=0)])
        comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
        through = problem.guides.through(problem.ties, mechanism.x.petsc_vec)
        self.is_held = max(largest[0], through) <= ADMISSIBLE * largest[1]
        slowest = 1e-5  # strain rates, relative to velocities over the size of the bodies
        usual = largest[1] / self.total ** (1 / rates.gdim)
        self.slowest = (slowest * usual) ** 2 * self.total


def _ends(
    problem: Problem, velocity: PETSc.Vec, question: Question, work: float, aside: float
) -> bool:
    """Return whether live loads do no work on a mechanism of permanent ones. Collective.

    Where live loads act on bodies at rest, all motion is rounding. Therefore velocities count at
    least as the mean velocity with which the permanent loads do their work.
    """
    # Work that counts as zero, relative to the sum of the absolute works of live loads at all
    # nodes: half of a checker's limit. It would matter at load factors some million times as large
    # as those that bodies carry.
    least_parting = 5e-7
    comm = problem.comm
    sought = problem.loads.live if question is Question.LIMIT else problem.loads.dead
    size = comm.allreduce(float(np.abs(sought.array_r).sum()))
    speeds = np.maximum(np.abs(velocity.array_r), abs(work) / size if size else 0.0)
    at_nodes = float(np.abs(problem.loads.live.array_r) @ speeds)
    return bool(abs(aside) <= least_parting * comm.allreduce(at_nodes))


@dataclass(frozen=True)
class _Cost:
    """Sums over the cells of all ranks.

    Attributes:
        dissipation: Upper bound of the bodies' dissipation.
        allowed: Part of it that rounding may add, and that of points at rest.
        lost: Mean sizes of rates that must vanish, times volumes.
        volume: Volume of the bodies.
        most: Largest sizes in each cell, times volumes.
        loose: Number of points without cohesion.
    """

    dissipation: float
    allowed: float
    lost: float
    volume: float
    most: float
    loose: float


def _cost(flow: _Flow, whole: float, subdivisions: int) -> _Cost:
    """Return the dissipation of a mechanism, and the sizes of rates that must vanish. Collective.

    Args:
        flow: Strain rates of the mechanism.
        whole: Sum of the squares of rates, including slip.
        subdivisions: Parts of a cell's edge.
    """
    problem, mechanism, rates = flow.problem, flow.mechanism, flow.rates
    weights, volumes = rates.weights, flow.volumes
    if isinstance(problem.kinematics, RingFlux):
        mine = dissipation_of_rings(problem, mechanism, subdivisions).sum()
    else:
        mine = dissipation_of_cells(problem, rates, subdivisions).sum()
    radii = np.where(flow.plastic, rates.radii, 0.0)
    steepness = np.divide(radii, rates.slopes, out=radii.copy(), where=flow.dilating)
    strengths = volumes * steepness[points_of_cells(problem)].min(axis=1)
    added = _of_rounding(problem, mechanism, strengths).sum()
    norms = np.sqrt(flow.squares)
    rest = norms <= ADMISSIBLE * np.sqrt(whole / flow.total)
    at_rest = (weights * radii)[rest] @ norms[rest]
    kept = np.where(flow.dilating, 0.0, rates.trace)
    wrongly = np.column_stack([kept, np.where(flow.plastic[:, None], 0.0, rates.deviator)])
    sizes = np.linalg.norm(at_vertices(problem, wrongly), axis=2) + flow.short
    sums = [mine + added, added + at_rest, volumes @ sizes.mean(axis=1), volumes.sum()]
    sums += [volumes @ sizes.max(axis=1), (rates.radii == 0).sum()]
    return _Cost(*map(float, problem.comm.allreduce(np.array(sums))))


def _largest_load(problem: Problem, loads: FacetLoads, volume: float) -> float:
    """Return the order of stress that loads cause (:meth:`FacetLoads.largest`). Collective."""
    mine = loads.largest(volume ** (1 / problem.bodies.gdim))
    return float(problem.comm.allreduce(mine, MPI.MAX))


def _of_rounding(problem: Problem, mechanism: fem.Function, strengths: Floats) -> Floats:
    """Return the part of each cell's plastic work that rounding may add in any evaluation.

    In a cell that moves and does not strain, differences of velocities are rounding. A body of 1e15
    times the strength of others would dissipate as much by them as those bodies that flow.

    Args:
        problem: The bodies.
        mechanism: Velocity with updated ghosts.
        strengths: Dissipation at a strain rate of 1, for the cells that this rank owns.
    """
    V, tdim = problem.V, problem.tagged_mesh.mesh.topology.dim
    vertices, points = corners(problem.tagged_mesh.mesh)
    slopes, _ = gradients(points[vertices][..., :tdim])
    values = mechanism.x.array.reshape(-1, tdim)[V.dofmap.list[: len(vertices)]]
    fastest = np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
    steepest = np.linalg.norm(slopes, axis=2).max(axis=1, initial=0.0)
    # Rounding units in a strain rate: the number of products in the gradient of a quadratic.
    roundings = 32.0
    added: Floats = roundings * np.finfo(np.float64).eps * strengths * fastest * steepest
    return added
