"""Check whether a velocity, continuous and quadratic in each cell, proves an upper bound.

(∫D(ε(v)) − L₀(v))/L(v) is an upper bound on the limit load if v = 0 at supports, ε(v) = 0 in
elastic bodies, and v causes no penetration. L₀(v) is the work of constant loads, and L(v) is the
work of the sought loads. D is the supremum of σ:ε over the cone of each cell (:mod:`cones`); ε is
admissible if D is finite (kinematic theorem, W. Prager, P. G. Hodge, Theory of Perfectly Plastic
Solids, 1951). The checker corrects the stored velocity until these conditions hold
(:mod:`mechanism`), except for volume changes, which another velocity undoes (:mod:`volume_change`).
The other velocity dissipates power (:mod:`dissipation`), and loads do work on it. Both terms
increase the bound, and no residual is neglected. For bodies of revolution, the velocity is v = ru
(:mod:`rings`), and works are divided by 2π.
"""

from dataclasses import dataclass
from itertools import combinations
from math import factorial, fsum

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, contracted, crossed, stacked, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.dissipation import Rates, dissipated, rates_of
from perfplast_fenicsx.proof.guided import left_free
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.mechanism import Mechanism, mechanism_of, resting_in
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.rigid import rigid_of
from perfplast_fenicsx.proof.rings import normals_of
from perfplast_fenicsx.proof.verdict import share_of
from perfplast_fenicsx.proof.volume_change import Undone, undone

FAST = 1000.0
"""Largest velocity that counts in the largest possible work of free loads, over the usual one."""


def usual_speed(body: Body, loads: Loads, work: float) -> float:
    """Return the mean velocity at which loads do their work; 0 without loads.

    The mean velocity depends only on the sought loads, so a single fast cell cannot hide the work
    of the free loads.

    Args:
        body: The bodies.
        loads: The sought loads, whose factor is bounded.
        work: Work of the sought loads.
    """
    free = left_free(loads.traction, body.held, body.guided)
    pushes = np.linalg.norm(free, axis=2).mean(axis=1)
    size = body.areas @ pushes + body.volumes @ np.linalg.norm(loads.body_force, axis=1)
    pores = np.abs(loads.pore_pressure).max(axis=1) / np.ptp(body.vertices, axis=0).max()
    size += body.volumes @ pores * np.sqrt(body.dim) + on_plates(body, loads)
    return float(abs(work) / size) if size > 0 else 0.0


def on_plates(body: Body, loads: Loads) -> float:
    """Return the largest work of forces and moments on rigid surfaces that move with speed 1."""
    d, wanted = body.dim, [surface.wanted(loads) for surface in rigid_of(body)]
    parts = [of[:d] for of in wanted]
    if not body.is_revolved:
        parts += [of[d:] for of in wanted]
    return float(sum(np.linalg.norm(part) for part in parts))


def most_work(
    body: Body, loads: Loads, v: Floats, at_facets: Floats, rates: Floats, usual: float
) -> float:
    """Return the largest possible work of loads for velocities of given size.

    Args:
        body: The bodies.
        loads: The free loads.
        v: Velocity at the nodes of each cell, shape (num_cells, nodes_per_cell, d).
        at_facets: Velocity at the nodes of each facet, shape (num_facets, nodes_per_facet, d).
        rates: Rates of strain at the vertices of each cell, shape (num_cells, d + 1, d, d).
        usual: The usual velocity (:func:`usual_speed`), a lower limit. The velocity of bodies at
            rest consists of rounding errors, and without this limit the reported factor would
            depend on these errors. Velocities above :data:`FAST` times the usual velocity do not
            count, so that one fast body cannot hide the work of the free loads.
    """
    fastest = FAST * usual if usual > 0 else np.inf
    free = left_free(loads.traction, body.held, body.guided)
    pushes = np.linalg.norm(free, axis=2).mean(axis=1)
    quick = np.linalg.norm(at_facets, axis=2).max(axis=1).clip(usual, fastest)
    total = float((body.areas * pushes) @ quick)
    quick = np.linalg.norm(v, axis=2).max(axis=1).clip(usual, fastest)
    total += float((body.volumes * np.linalg.norm(loads.body_force, axis=1)) @ quick)
    strains = np.linalg.norm(rates, axis=(2, 3)).max(axis=1)
    extent = np.ptp(body.vertices, axis=0).max()
    strains = strains.clip(usual / extent, FAST * fastest / extent)
    pressures = np.abs(loads.pore_pressure).max(axis=1)
    total += float((body.volumes * pressures) @ strains) * float(np.sqrt(body.dim))
    return total + on_plates(body, loads) * min(float(np.abs(v).max(initial=0.0)), fastest)


def check_nodes(body: Body, nodes: Longs, count: int) -> None:
    """Refuse velocities that are not continuous.

    Args:
        body: The bodies.
        nodes: Nodes of each cell: at its vertices, then at the middles of its edges 01, 02, ...,
            12, ...
        count: Number of nodes.

    Raises:
        ProofError: If a vertex or an edge has different nodes in two cells.
    """
    pairs = list(combinations(range(body.dim + 1), 2))
    if nodes.shape != (len(body.cells), body.dim + 1 + len(pairs)):
        raise ProofError("nodes do not fit the cells.")
    if nodes.size and not (nodes.min() >= 0 and nodes.max() < count):
        raise ProofError("some nodes have no velocity.")
    ends = np.sort(body.cells[:, pairs].reshape(-1, 2), axis=1)
    edges = ends[:, 0] * len(body.vertices) + ends[:, 1]
    for things, theirs in (
        (body.cells.ravel(), nodes[:, : body.dim + 1].ravel()),
        (edges, nodes[:, body.dim + 1 :].ravel()),
    ):
        _, first, inverse = np.unique(things, return_index=True, return_inverse=True)
        if (theirs[first][inverse.ravel()] != theirs).any():
            raise ProofError("the velocity is not continuous: a point has two nodes.")


@dataclass(frozen=True)
class Flow:
    """The bound that a velocity proves, and the parts of the bound.

    Attributes:
        measured: ``work_of_others``: work of the free loads relative to their largest possible
            work, for which each load has the largest velocity or strain rate of its facet or cell.
        bound: The upper bound; None if nothing is proven.
        reasons: Reasons why nothing is proven.
        cost: Part of the bound that is due to undone volume changes and rounding.
        power: The larger of the dissipation and |dissipation − work of the constant loads|,
            divided by ``work``.
        work: Lower bound on the work of the sought loads.
        others: Largest possible work of the free loads at factor 1.
    """

    measured: dict[str, float]
    bound: float | None
    reasons: tuple[str, ...]
    cost: float
    power: float
    work: float
    others: float


def measure_velocity(body: Body, v: Floats) -> Flow:
    """Return the bound that a velocity proves.

    Args:
        body: The bodies.
        v: Velocity at the nodes of each cell, shape (num_cells, nodes_per_cell, d).
    """
    resting = resting_in(body, v)
    found = _measured(body, v, mechanism_of(body, v, resting))
    if not resting:
        return found
    # A second mechanism without rigid sets of cells may prove a better bound.
    other = _measured(body, v, mechanism_of(body, v))
    known = [np.inf if of.bound is None else of.bound for of in (found, other)]
    return found if known[0] < known[1] else other


def _measured(body: Body, v: Floats, mechanism: Mechanism) -> Flow:
    """Return the bound that a mechanism near the stored velocity proves."""
    rates = rates_of(body, mechanism)
    of_cells = dissipated(body, rates)
    keeps, takes = (of & ~mechanism.rigid for of in _kinds(body))
    left = undone(body, mechanism, rates.change, (keeps, takes))
    more = left.gradients * rates.of_gradient
    some, alert = body.plastic, np.zeros(len(body.cells))
    alert[some] = body.cones.alertness[body.cone[some]]
    # In axisymmetry, rates are r²ε, and gradients of v are larger by a factor r.
    radius = body.vertices[body.cells][..., 0].max(axis=1) if body.is_revolved else 1.0
    short = of_cells.short + alert * more * radius
    reasons = [why for why in (mechanism.reason, left.reason) if why is not None]
    if not (short <= 0).all():
        reasons.append(_at(body, short, "dilating cells dilate too little for their strain"))
    known = ~some | mechanism.rigid | keeps | takes
    known[some] |= body.cones.grows[body.cone[some]]
    if not known.all():
        reasons.append("a cone does not bound a stress other than the mean stress")
    cost = float((body.steepness * more)[more != 0].sum() * (1 + 1e-9))
    dissipation = (of_cells.total + cost + mechanism.slip) * (1 + 64 * U)
    works = [_work(body, of, mechanism, rates) for of in _loads(body)]
    undoes = [_undone_work(body, of, left) for of in _loads(body)]
    work, work_off = works[0][0], works[0][1] + undoes[0]
    dead, dead_off = works[1][0], works[1][1] + undoes[1]
    excess = dissipation - dead + dead_off
    excess += 4 * U * (dissipation + abs(dead))
    least, most = work - work_off, work + work_off
    bound = None
    if not least > 0 or not np.isfinite(excess):
        reasons.append(
            "the loads do no work" if not work > 0 else "residuals exceed the work of the loads"
        )
    else:
        bound = excess / (least if excess > 0 else most)
        bound = float(np.nextafter(bound, np.inf)) if excess else 0.0
    measured = {}
    other = abs(works[2][0]) + works[2][1] + undoes[2]
    if body.others:
        measured["work_of_others"] = _share_of_others(body, v, other, work)
    scale = least if least > 0 else np.nan
    cost += dead_off + abs(excess) * work_off / scale
    return Flow(
        measured,
        None if reasons else bound,
        tuple(reasons),
        cost / scale,
        max(dissipation, abs(excess)) / scale,
        least,
        other,
    )


def _loads(body: Body) -> tuple[Loads, Loads, Loads]:
    return body.sought, body.constant, body.others


def _kinds(body: Body) -> tuple[Flags, Flags]:
    """Return flags of cells that preserve their volume, and of cells that admit any rate."""
    of_cones = (body.cones.keeps_volume(normals_of(body)), body.cones.takes_any)
    keeps, takes = (np.append(of, False)[body.cone] for of in of_cones)
    return keeps, takes


def _at(body: Body, values: Floats, words: str) -> str:
    where = body.vertices[body.cells[np.argmax(values)]].mean(axis=0)
    return f"{words}, as at ({', '.join(f'{x:.6g}' for x in where)})"


def _work(body: Body, loads: Loads, mechanism: Mechanism, rates: Rates) -> tuple[float, float]:
    """Return the work of loads, and its error.

    Args:
        body: The bodies.
        loads: Loads of one kind.
        mechanism: Velocity of the bodies.
        rates: Strain rates of the velocity.
    """
    if not loads:
        return 0.0, 0.0
    d, places, at = body.dim, mechanism.places, mechanism.at
    found = []
    some = np.flatnonzero(loads.traction.any(axis=(1, 2)))
    if len(some):
        vectors = body.shapes.areas.each(lambda part: part.reshape(-1, d)[body.outer[some]])
        sizes = (vectors * vectors).sum(axis=1).root()
        v = at[places.of_facets[some]]
        means = _means(d)
        weighted = [
            sum(
                (v[:, n] * Balls.exact(means[a, n]) for n in range(1, v.mid.shape[1])),
                start=v[:, 0] * Balls.exact(means[a, 0]),
            )
            for a in range(d)
        ]
        power = contracted(Balls.exact(loads.traction[some]), stacked(weighted, 1)).sum(axis=1)
        found.append(power * sizes * Balls.part(factorial(d + 2) // factorial(d - 1)))
    some = np.flatnonzero(loads.body_force.any(axis=1))
    if len(some):
        v = at[places.of_cells[some]].sum(axis=1)
        volumes = body.shapes.volumes[some] * Balls.part(places.of_cells.shape[1])
        found.append(contracted(Balls.exact(loads.body_force[some]), v) * volumes)
    some = np.flatnonzero(loads.pore_pressure.any(axis=1))
    if len(some):
        u, change = Balls.exact(loads.pore_pressure[some]), rates.change[some]
        power = u.sum(axis=1) * change.sum(axis=1) + contracted(u, change)
        found.append(power * Balls.part((d + 1) * (d + 2)))
    if len(body.rigid):
        force = Balls.exact(loads.rigid_force)
        centres = Balls.exact(mechanism.centres)
        turns = Balls.exact(mechanism.turns)
        about = Balls.exact(loads.rigid_moment) - crossed(centres, force)
        power = contracted(force, mechanism.motions)
        if not body.is_revolved:
            power = power + contracted(about, turns)
        else:
            around = Balls(np.asarray(1 / (2 * np.pi)), np.asarray(0.0), np.asarray(4 * U))
            power = power * around
        found.append(power)
    total = fsum(float(fsum(of.mid)) for of in found) + fsum(float(fsum(of.low)) for of in found)
    size = fsum(float(of.size.sum()) for of in found)
    off = fsum(float(upwards(of.rad.sum(), len(of.rad))) for of in found)
    return total, off + 4 * U * abs(total) + 1e-28 * size


def _undone_work(body: Body, loads: Loads, left: Undone) -> float:
    """Return the largest work of loads on the velocity that undoes volume changes."""
    if not loads:
        return 0.0
    x = body.vertices[body.cells]
    reach = np.linalg.norm(np.ptp(x, axis=1), axis=1)
    # w is zero at vertices, and each point lies within a cell's width of a vertex.
    forces = np.linalg.norm(loads.body_force, axis=1) * reach * left.gradients
    pores = np.abs(loads.pore_pressure).max(axis=1) * left.change
    pushes = np.linalg.norm(loads.traction, axis=2).max(axis=1) * left.through
    parts = [values[values != 0].sum() for values in (forces, pores, pushes)]
    return float(sum(parts) * (1 + 1e-9))


def _share_of_others(body: Body, v: Floats, other_work: float, work: float) -> float:
    """Return the work of the free loads, relative to their largest possible work."""
    d = body.dim
    at_facets = v[(body.outer // (d + 1))[:, None], _facet_nodes(body)]
    usual = usual_speed(body, body.sought, work)
    most = most_work(body, body.others, v, at_facets, strain_rates(body, v), usual)
    return share_of(other_work, most)


def strain_rates(body: Body, v: Floats) -> Floats:
    """Return ε(v) at the vertices of each cell, shape (num_cells, d + 1, d, d)."""
    g, d = body.gradients, body.dim
    gradient = np.einsum("cvi,cvj,kv->ckij", v[:, : d + 1], g, 4 * np.eye(d + 1) - 1)
    for node, (a, b) in enumerate(combinations(range(d + 1), 2), start=d + 1):
        gradient[:, a] += 4 * np.einsum("ci,cj->cij", v[:, node], g[:, b])
        gradient[:, b] += 4 * np.einsum("ci,cj->cij", v[:, node], g[:, a])
    rates: Floats = (gradient + gradient.transpose(0, 1, 3, 2)) / 2
    return rates


def _facet_nodes(body: Body) -> Longs:
    """Return the indices of each facet's vertices and edge middles in the facet's cell."""
    d = body.dim
    number = np.zeros((d + 1, d + 1), dtype=np.int64)
    for node, (a, b) in enumerate(combinations(range(d + 1), 2), start=d + 1):
        number[a, b] = number[b, a] = node
    places = body.places
    middles = [number[places[:, a], places[:, b]] for a, b in combinations(range(d), 2)]
    return np.concatenate([places, np.stack(middles, axis=1)], axis=1)


def _means(dim: int) -> Floats:
    """Return the means over a facet of linear functions times Bernstein polynomials.

    The values are integers, to be multiplied by (d − 1)!/((d + 2)!); shape (d, 3 or 6).
    """
    groups = [(a, a) for a in range(dim)] + list(combinations(range(dim), 2))
    found = np.zeros((dim, len(groups)))
    for a in range(dim):
        for column, group in enumerate(groups):
            factors = [a, *group]
            value = 1.0 if len(set(group)) == 1 else 2.0
            for factor in set(factors):
                value *= factorial(factors.count(factor))
            found[a, column] = value
    return found
