"""Compute the upper bound from a mechanism, and each cell's share of the gap between the bounds.

In a straight cell, the strain rate of a quadratic velocity is linear. If volume changes vanish at
the quadrature points, they vanish everywhere. The strain rates tr ε ≥ α‖dev ε‖ of a dilating body
form a convex cone. If they are admissible at the vertices, they are admissible everywhere. If
bodies do not penetrate each other at contacts, the result is an upper bound for the body that the
mesh fills, not only for the mesh. :mod:`cell_dissipation` computes the dissipation of cells and of
slip.

If strong bodies rest or move rigidly, their strain rates are rounding errors; the module computes
their dissipation with the true strength. The module reduces the work of the loads by the work of
mean stresses on the remaining volume changes. These mean stresses have ten times the magnitude of
the loads. Without this reduction, relative volume changes of 1e-12 could make a bound wrong where
loads nearly balance each other.

:func:`gap_shares` computes the share of each cell in the gap between both bounds, for refinement.
For an admissible mechanism with L(v) = 1 and a stress in equilibrium with λ⁻,

    λ⁺ − λ⁻ = Σ_T η_T + W,   η_T = ∫_T D(ε(v)) − σ:ε(v) ≥ 0,

where D is the dissipation: γ‖dev ε‖ or, in dilating bodies, (γ/α) tr ε. W ≥ 0 is the work of
contact pressures on gaps that open. On surfaces with friction, the cells on both sides share the
dissipation minus the work of the tractions (:mod:`cell_dissipation`).
"""

from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.discrete.point_strains import has_coefficients
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import any_loose
from perfplast_fenicsx.limit_analysis.facets.bound_body import TWICE, bound_body
from perfplast_fenicsx.limit_analysis.facets.contact_facets import UNSEEN
from perfplast_fenicsx.limit_analysis.facets.entering import (
    ENTERS,
    entered_share,
    entering_between_nodes,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_loads
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    GROWS_TOO_LITTLE,
    NOT_ADMISSIBLE,
    Bound,
    Question,
    Scope,
    measure_of,
)
from perfplast_fenicsx.limit_analysis.velocity.cell_dissipation import (
    SUBDIVISIONS,
    MechanismRates,
    at_vertices,
    dissipation_of_cells,
    dissipation_of_rings,
    mean_of,
    mechanism_rates,
    missing_growth,
    points_of_cells,
    slip_work,
)
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import coefficients_of_radius, polynomials
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem

ADMISSIBLE = 1e-9
"""Fraction of ‖ε(v)‖ up to which a mechanism counts as admissible on its mesh. It limits volume
changes in plastic bodies, the lack of dilation in dilating bodies, and strain rates in elastic
bodies. This limit does not make a bound strict: the proof checker corrects the mechanism and raises
the bound accordingly.
"""


def strict_upper_bound(
    problem: Problem,
    mechanism: fem.Function,
    subdivisions: int = SUBDIVISIONS,
    question: Question = Question.LIMIT,
    rates: MechanismRates | None = None,
) -> Bound:
    """Return the upper bound (dissipation − work of constant loads)/L₁(v). Collective.

    Args:
        problem: The bodies and their loads.
        mechanism: Velocity that is admissible at the quadrature points, such as the mechanism of
            :func:`discrete_limit.interior_point`. Its ghosts are up to date.
        subdivisions: Number of parts of a cell's edge. With more parts, the result decreases
            towards the exact value.
        question: The loads whose factor is sought.
        rates: Rates of the mechanism; evaluated by default.

    Returns:
        The bound. It has no value if the loads do no positive work on the mechanism, or in
        axisymmetry if the unknown is not v = ru. It is in doubt if the mechanism is not admissible
        at the quadrature points. It holds only for the mesh if ``why_not`` contains reasons; in
        this case it has no value for an inadmissible mechanism.

    Raises:
        InputError: If ζ moves supports or obstacles, or if there is no load.
    """
    check_loads(problem)
    if problem.tagged_mesh.axisymmetric and not isinstance(problem.kinematics, RingFlux):
        why = (
            "only quadratic velocities on straight cells preserve the volume of rings everywhere;"
            " use degree = 2 and first-order cells"
        )
        return Bound(None, "upper", Scope.MESH, (why,))
    flow = _Flow(problem, mechanism, rates)
    velocity, slip = mechanism.x.petsc_vec, slip_work(problem, mechanism)
    work, dead, aside = question.of(
        problem.loads.alpha(velocity), problem.loads.dead_work(velocity)
    )
    whole = flow.whole + slip.squares
    if problem.loads.has_dead():  # bodies may separate rigidly, without any strain
        whole = max(whole, flow.slowest)
    none = Bound(None, "upper", Scope.MESH, (NOT_ADMISSIBLE,))
    if not (whole > 0 and work > 0):
        return none
    moves = _ends(problem, velocity, question, work, aside) and flow.is_held
    unfit = [] if moves and flow.part <= ADMISSIBLE**2 * whole else [NOT_ADMISSIBLE]
    unfit += [] if flow.lacking <= ADMISSIBLE**2 * whole else [GROWS_TOO_LITTLE]
    cost = _cost(flow, whole, subdivisions)
    body = bound_body(problem)
    loose = cost.loose + any_loose(problem)
    dissipation = cost.dissipation + slip.power
    comm, extent = problem.comm, cost.volume ** (1 / problem.bodies.gdim)
    at_one, at_zero, _ = question.of(
        *(comm.allreduce(of.largest(extent), MPI.MAX) for of in (body.live, body.dead))
    )
    excess = dissipation - dead
    stress = abs(excess / work) * at_one + at_zero
    # Largest allowed work of a stress as large as the loads on volume changes, relative to the work
    # of the loads: half of the limit of a checker that works cell by cell.
    least_charge = 5e-10
    provable = cost.most * stress <= least_charge * measure_of(dissipation, excess, bool(loose))
    # Mean stress, in multiples of the largest load, for the work on remaining volume changes and
    # elastic strain rates. If pressures nearly balance each other, the work on a strain rate of
    # 1e-12 may be 1e-6 of the total work.
    mean_stresses = 10.0
    lost = 0.0 if unfit else mean_stresses * cost.lost  # the checker corrects mechanisms in doubt
    excess += lost * at_zero
    work -= np.copysign(lost * at_one, excess)
    if not work > 0:
        return none
    doubts = [] if provable else ["the volume changes of the mechanism are more than rounding"]
    why_not, doubts = _reasons(problem, mechanism, [*unfit, *doubts, *slip.why_not])
    if why_not and unfit:
        return replace(none, why_not=tuple(why_not))
    of = Scope.MESH if why_not else Scope.BODY
    share = float(cost.allowed / dissipation) if dissipation > 0 else 0.0
    return Bound(float(excess / work), "upper", of, tuple(why_not), share, tuple(doubts))


def _reasons(
    problem: Problem, mechanism: fem.Function, doubts: list[str]
) -> tuple[list[str], list[str]]:
    """Return reasons why a bound does not hold for the body, and doubts whether it holds.

    Collective.

    Args:
        problem: The bodies.
        mechanism: The velocity.
        doubts: Other reasons why the bound may not hold.
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
        dilating: Flags of points that dilate in plastic flow, shape (count,).
        squares: Values ‖dev ε‖² at the points, shape (count,).
        volumes: Volumes of the cells that this rank owns, shape (num_cells,).
        short: Amount by which tr ε is too small at the vertices of cells (:func:`missing_growth`).
        total: Volume of all bodies.
        part: Weighted sum of the squares of volume changes and elastic strain rates, which must
            vanish.
        whole: The sum Σ w‖ε‖² over all points.
        lacking: Volume-weighted sum of the squares of ``short``.
        is_held: Whether the velocity is zero where supports hold the bodies.
        slowest: Least value for ``whole`` if bodies can separate without strain.
    """

    def __init__(
        self, problem: Problem, mechanism: fem.Function, rates: MechanismRates | None = None
    ) -> None:
        """Compute the sums over all ranks, and the rates unless they are given. Collective."""
        rates = rates or mechanism_rates(problem, mechanism)
        self.problem, self.mechanism, self.rates = problem, mechanism, rates
        trace, deviator, weights = rates.trace, rates.deviator, rates.strains.weights
        comm = problem.comm
        self.plastic, self.dilating = np.isfinite(rates.strains.radii), rates.strains.slopes > 0
        self.squares: Floats = np.einsum("ni,ni->n", deviator, deviator)
        volume = trace**2 / rates.strains.gdim
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
        slowest = 1e-5  # strain rate, relative to the velocity divided by the size of the bodies
        usual = largest[1] / self.total ** (1 / rates.strains.gdim)
        self.slowest = (slowest * usual) ** 2 * self.total


def _ends(
    problem: Problem, velocity: PETSc.Vec, question: Question, work: float, aside: float
) -> bool:
    """Return whether the loads with a free factor do no work on a mechanism. Collective.

    If the free loads act on bodies at rest, all velocities of these bodies are rounding errors. The
    comparison therefore uses at least the mean velocity at which the bounded loads do their work.
    """
    # Largest work that counts as zero, relative to the sum of the absolute works of live loads at
    # all nodes: half of the checker's limit. A smaller work affects only load factors some million
    # times as large as the limit load.
    least_parting = 5e-7
    comm = problem.comm
    sought = problem.loads.live if question is Question.LIMIT else problem.loads.dead
    size = comm.allreduce(float(np.abs(sought.array_r).sum()))
    speeds = np.maximum(np.abs(velocity.array_r), abs(work) / size if size else 0.0)
    at_nodes = float(np.abs(problem.loads.live.array_r) @ speeds)
    return bool(abs(aside) <= least_parting * comm.allreduce(at_nodes))


@dataclass(frozen=True)
class _Cost:
    """Sums over the cells of all ranks that determine an upper bound.

    Attributes:
        dissipation: Upper bound on the bodies' dissipation.
        allowed: Part of the dissipation that rounding may add, including the dissipation of points
            at rest.
        lost: Sum over cells of the volume times the mean size of rates that must vanish.
        volume: Volume of the bodies.
        most: Sum over cells of the volume times the largest size of rates that must vanish.
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
        whole: Sum of the squares of strain rates, including slip.
        subdivisions: Parts of a cell's edge.
    """
    problem, mechanism, rates = flow.problem, flow.mechanism, flow.rates
    weights, volumes = rates.strains.weights, flow.volumes
    if isinstance(problem.kinematics, RingFlux):
        mine = dissipation_of_rings(problem, mechanism, subdivisions).sum()
    else:
        mine = dissipation_of_cells(problem, rates, subdivisions).sum()
    radii = np.where(flow.plastic, rates.strains.radii, 0.0)
    steepness = np.divide(radii, rates.strains.slopes, out=radii.copy(), where=flow.dilating)
    strengths = volumes * steepness[points_of_cells(problem)].min(axis=1)
    added = _of_rounding(problem, mechanism, strengths).sum()
    norms = np.sqrt(flow.squares)
    rest = norms <= ADMISSIBLE * np.sqrt(whole / flow.total)
    at_rest = (weights * radii)[rest] @ norms[rest]
    kept = np.where(flow.dilating, 0.0, rates.trace)
    wrongly = np.column_stack([kept, np.where(flow.plastic[:, None], 0.0, rates.deviator)])
    sizes = np.linalg.norm(at_vertices(problem, wrongly), axis=2) + flow.short
    sums = [mine + added, added + at_rest, volumes @ sizes.mean(axis=1), volumes.sum()]
    sums += [volumes @ sizes.max(axis=1), (rates.strains.radii == 0).sum()]
    return _Cost(*map(float, problem.comm.allreduce(np.array(sums))))


def _of_rounding(problem: Problem, mechanism: fem.Function, strengths: Floats) -> Floats:
    """Return the part of each cell's dissipation that rounding may add.

    In a cell that moves rigidly, computed strain rates are rounding errors. Because of these
    errors, a body with 1e15 times the strength of other bodies would dissipate as much as the
    bodies that flow.

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
    # Number of rounding units in a strain rate: the number of products in the gradient of a
    # quadratic velocity.
    roundings = 32.0
    added: Floats = roundings * np.finfo(np.float64).eps * strengths * fastest * steepest
    return added


def gap_shares(
    problem: Problem,
    mechanism: fem.Function,
    stress: Floats,
    rates: MechanismRates | None = None,
) -> Floats:
    """Return upper bounds on the shares η_T of the cells that this rank owns. Collective.

    Except in axisymmetry, the share of a cell includes half of the slip at its facets.

    Args:
        problem: The bodies and their loads, on straight cells.
        mechanism: Admissible mechanism with L(v) = 1 and updated ghosts.
        stress: Mandel vectors at the vertices of the owned cells, for a stress that is linear in
            each cell, shape (num_cells, d + 1, 4 or 6). In axisymmetry, coefficients of rσ
            (:mod:`stress_cells`), shape (num_cells, 6, 4).
        rates: Rates of the mechanism; evaluated by default.

    Returns:
        Shape (num_cells,).
    """
    rates = rates or mechanism_rates(problem, mechanism)
    if problem.tagged_mesh.axisymmetric:
        return _of_rings(problem, rates, mechanism, stress)
    most = dissipation_of_cells(problem, rates)
    there = at_vertices(problem, rates.powers)
    volumes = rates.strains.weights[points_of_cells(problem)].sum(axis=1)
    shares: Floats = most - volumes * mean_of(there, stress).sum(axis=1)
    shares += slip_work(problem, mechanism, stress).shares
    return shares


def _of_rings(
    problem: Problem, rates: MechanismRates, mechanism: fem.Function, stress: Floats
) -> Floats:
    """Return the shares of cells in axisymmetry; a quadrature rule gives the work of the stress."""
    points = points_of_cells(problem)
    vertices, places = corners(problem.tagged_mesh.mesh)
    x = places[vertices]
    if has_coefficients(problem):
        shares = np.full((3, 3), 1 / 6) + np.eye(3) / 2
        rho = coefficients_of_radius(x)[..., None]
        powers = np.einsum("pi,cim->cpm", polynomials(shares), rho * rates.powers[points])
        powers /= (x[..., 0] @ shares.T)[..., None]
        _, areas = gradients(x)
        weights = np.repeat(2 * np.pi / 3 * areas[:, None], 3, axis=1)
    else:
        at = interpolation_points(problem.S.element)
        shares = np.hstack([1 - at.sum(axis=1, keepdims=True), at])
        powers, weights = rates.powers[points], rates.strains.weights[points]
    radii = x[..., 0] @ shares.T
    work = np.einsum("pi,cim,cpm->cp", polynomials(shares), stress, powers) / radii
    power = np.einsum("cp,cp->c", weights, work)
    return np.asarray(dissipation_of_rings(problem, mechanism, SUBDIVISIONS) - power)


def let_dilate(problem: Problem, mechanism: fem.Function, rates: MechanismRates) -> MechanismRates:
    """Add a slow motion that dilates everywhere, if cells dilate too little because of rounding.

    Under pressures of 1e5 times the strength, a dilatancy that is too small by only 1e-11 can cost
    more work than the bodies dissipate. The work on the added motion is small. The motion is x − a
    along the axes in which supports allow it, with a at the supports. The function adds the motion
    only if it is admissible and adds no penetration. It adds no motion in axisymmetry, and with
    roller supports or rigid surfaces. Collective.

    Args:
        problem: The bodies.
        mechanism: Velocity with updated ghosts; the function changes it.
        rates: Rates of the mechanism.

    Returns:
        The rates of the mechanism, whether it was changed or not.
    """

    def missing(of: MechanismRates) -> float:
        return float(problem.comm.allreduce(missing_growth(problem, of).max(initial=0.0), MPI.MAX))

    if isinstance(problem.kinematics, RingFlux) or problem.guides.surfaces or problem.given.rigid:
        return rates
    lacking, before = missing(rates), mechanism.x.array.copy()
    if not lacking > 0:
        return rates
    entered, motion = _entered(problem, mechanism), _stretch(problem)
    mechanism.x.array[:] = motion
    flow = _Flow(problem, mechanism)
    steps = 12  # doublings, up to some thousand times the missing dilatancy
    if max(flow.part, flow.lacking) > ADMISSIBLE**2 * flow.whole:
        steps = 0
    for step in range(steps):
        mechanism.x.array[:] = before + 2**step * lacking * motion
        if missing(mechanism_rates(problem, mechanism)) > 0:
            continue
        mechanism.x.array[:] += 2**step * lacking * motion  # reserve for the checker's rounding
        if _entered(problem, mechanism) <= max(entered, UNSEEN):
            return mechanism_rates(problem, mechanism)
        break
    mechanism.x.array[:] = before
    return rates


def _stretch(problem: Problem) -> Floats:
    """Return the motion x − a along the axes in which supports allow it, zero along other axes.

    If all supports along an axis have the same coordinate, a is this coordinate. Without supports
    along an axis, a is the least coordinate of the bodies. Plane obstacles count as supports.
    Collective.

    Returns:
        A value for each local degree of freedom.
    """
    gdim = problem.fixed.shape[1]
    x = problem.V.tabulate_dof_coordinates()[:, :gdim]
    stays, host = problem.fixed.copy(), problem.constraints.host
    outer = [not source.inner for source in problem.constraints.sources]
    if any(outer):
        rows = np.array(outer)[problem.constraints.surface]
        stays[host[rows]] |= np.abs(problem.constraints.normal[rows]) > ADMISSIBLE
    inside = np.where(stays, x, np.inf), np.where(stays, -x, np.inf)
    low, negative = (np.min(of, axis=0, initial=np.inf) for of in inside)
    ends = np.concatenate([low, negative, x.min(axis=0, initial=np.inf)])
    problem.comm.Allreduce(MPI.IN_PLACE, ends, MPI.MIN)
    first, last, least = ends[:gdim], -ends[gdim : 2 * gdim], ends[2 * gdim :]
    held = np.isfinite(first)
    size = problem.comm.allreduce(float(np.abs(x - least).max(initial=0.0)), MPI.MAX)
    free = ~held | (last - first <= ADMISSIBLE * size)
    motion = np.where(stays | ~free, 0.0, x - np.where(held, first, least))
    return np.asarray(motion.ravel())


def _entered(problem: Problem, velocity: fem.Function) -> float:
    """Return the largest relative penetration at a facet; 0 if it is unknown. Collective."""
    if problem.constraints.in_mean or problem.given.ties:
        return 0.0
    return entered_share(problem, velocity, rubbing=True) or 0.0
