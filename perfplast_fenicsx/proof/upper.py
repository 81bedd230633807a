"""Does a velocity prove an upper bound? It is quadratic in each cell, and continuous.

(∫D(ε(v)) − L₀(v))/L(v), with the work L₀(v) of loads that stay, is an upper bound of the limit load
of the bodies where v = 0 at supports, ε(v) = 0 in elastic bodies, and v enters nothing. D is the
sup of σ:ε over the cone of each cell (:mod:`cones`), and where it is finite ε is admissible: if the
cone leaves a stress free, that does no work, and in cells that grow there is enough of that. Where
surfaces rub, ∫D has what slip dissipates (:mod:`entering`). ε(v) is linear in a cell, so that a
rate that vanishes at the vertices does so everywhere, and what growth lacks, which is convex, is
nowhere positive if it is not there. The integral of a convex D is at most that of its linear
interpolation on any subdivision, and that of a linear one is the mean of the vertices. A strength
that is linear in the cell multiplies that interpolation, and the product is integrated exactly
(kinematic theorem, W. Prager, P. G. Hodge, Theory of Perfectly Plastic Solids, 1951). Of bodies of
revolution the velocity is v = ru (:mod:`rings`), and works are over 2π.
"""

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.entering import entering_of
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.parts import halved, mean_shares
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.rigid import Rigid, rigid_of, sums_of
from perfplast_fenicsx.proof.rings import on_axis, ring_flow, speed_of
from perfplast_fenicsx.proof.rubbing import loose
from perfplast_fenicsx.proof.verdict import share_of
from perfplast_fenicsx.proof.work_of_others import most_work, usual_speed


def check_nodes(body: Body, nodes: Longs, count: int) -> None:
    """Make sure that the velocity is continuous.

    Args:
        body: The bodies.
        nodes: Nodes of each cell: those at its vertices and then those at the middles of its edges
            01, 02, ..., 12, ...
        count: How many there are.

    Raises:
        ProofError: If a vertex or an edge has another node in another cell.
    """
    pairs = list(combinations(range(body.dim + 1), 2))
    if nodes.shape != (len(body.cells), body.dim + 1 + len(pairs)):
        raise ProofError("nodes do not fit the cells.")
    if nodes.size and not (nodes.min() >= 0 and nodes.max() < count):
        raise ProofError("nodes without a velocity.")
    ends = np.sort(body.cells[:, pairs].reshape(-1, 2), axis=1)
    edges = ends[:, 0] * len(body.vertices) + ends[:, 1]
    for things, theirs in (
        (body.cells.ravel(), nodes[:, : body.dim + 1].ravel()),
        (edges, nodes[:, body.dim + 1 :].ravel()),
    ):
        _, first, inverse = np.unique(things, return_index=True, return_inverse=True)
        if (theirs[first][inverse.ravel()] != theirs).any():
            raise ProofError("the velocity is not continuous: a place has two nodes.")


@dataclass(frozen=True)
class Flow:
    """Residuals of the conditions of a velocity, and its work.

    Attributes:
        measured: ``volume_change`` (or the result of :meth:`cones.Cones.lacking` for other cones),
            ``elastic_strain`` and ``entering_work``: the work of a stress as large as the loads at
            the bound cause (:meth:`Loads.stress`) at what is left in each cell and facet, all added
            up, relative to what is dissipated. ``work_of_others``: the work of loads of any factor,
            relative to what they could do where they are, each with the largest velocity or strain
            of its own facet or cell. ``entering``: relative to the largest velocity on the same
            facets, or to a share of the largest of all (:data:`entering.SLOWEST`) if that is more.
            ``moved_supports``, and of bodies of revolution ``axis``: relative to the largest
            velocity.
        dissipation: From above.
        work: L(v).
        constant_work: Work of the loads that stay as they are.
        speed: The largest velocity.
        others: What loads of any factor 1 can do in all, by what is left of the conditions too.
        reason: Why the conditions of contact cannot be checked, or None.
        loose: Whether some cells, or joints, dissipate nothing whatever they do.
    """

    measured: dict[str, float]
    dissipation: float
    work: float
    constant_work: float
    speed: float
    others: float
    reason: str | None
    loose: bool

    @property
    def excess(self) -> float:
        """Return the least work of the loads whose factor is bounded."""
        return self.dissipation - self.constant_work

    @property
    def size(self) -> float:
        """Return the measure of residuals: where bodies part nothing is dissipated."""
        return size_of(self.dissipation, self.excess, self.loose)


def measure_velocity(body: Body, v: Floats, subdivisions: int) -> Flow:
    """Return the residuals of a velocity, its dissipation and work.

    Args:
        body: The bodies.
        v: Velocity at the nodes of each cell, shape (num_cells, nodes_per_cell, d).
        subdivisions: How often an edge is halved for the integral.
    """
    flow = ring_flow if body.is_revolved else _plain_flow
    volumes, strains, dissipation = flow(body, v, subdivisions)
    d, rates = body.dim, strain_rates(body, v)  # of v, around an axis too
    growth = np.einsum("cvii->cv", rates)
    at_facets = v[(body.outer // (d + 1))[:, None], _facet_nodes(body)]
    contact = entering_of(body, at_facets, float(np.abs(v).max(initial=0)))
    dissipation += contact.slip
    kinds, rigid = (body.sought, body.constant, body.others), rigid_of(body)
    motions, bent, of_plates = _motions(body, rigid, at_facets)
    work, constant_work, other_work = (
        _work(body, of, v, at_facets)
        + of.pore_work(body.volumes, growth)
        + float(sum(one.wanted(of) @ motion for one, motion in zip(rigid, motions, strict=True)))
        for of in kinds
    )
    moved = float(np.abs(at_facets * body.held[:, None]).max(initial=0))
    fastest = float(np.abs(v).max(initial=0))
    at_one, at_zero, of_others = (
        of.stress(body.vertices[body.cells]) + sums_of(rigid, of)[1] for of in kinds
    )
    factor = abs(dissipation - constant_work) / work if work > 0 else 0.0
    stress = factor * at_one + at_zero
    left = (volumes, strains, contact.volume, of_plates)
    names = ("volume_change", "elastic_strain", "entering_work", "bending_work")
    joints = (body.contact_adhesion, body.contact_friction)
    planes = (body.obstacle_adhesion, body.obstacle_friction)
    is_loose = body.loose or loose(*joints) or loose(*planes)
    size = size_of(dissipation, dissipation - constant_work, is_loose)
    # Nor may what a body at its limit under constant loads dissipates hide what others have left.
    least = factor + (at_zero / at_one if at_one > 0 else 0.0)
    size = min(size, 1e3 * work * least) if work > 0 else size
    # Of the loads whose factor is bounded, too: where nothing dissipates only this decides.
    measured = {
        name: max(share_of(stress * x, size), share_of(at_one * x, work))
        for name, x in zip(names, left, strict=True)
    }
    measured |= {"moved_supports": share_of(moved, fastest), "entering": contact.relative}
    if rigid:
        measured["bent"] = share_of(bent, fastest)
    if body.others:
        usual = usual_speed(body, body.sought, work)
        most = most_work(body, body.others, v, at_facets, rates, usual)
        plates = zip(rigid, motions, strict=True)
        most += sum(
            float(np.abs(one.wanted(body.others)) @ np.abs(motion)) for one, motion in plates
        )
        measured["work_of_others"] = share_of(abs(other_work), most)
    others = abs(other_work) + of_others * sum(left)
    speed = fastest
    if body.is_revolved:
        measured["axis"] = share_of(on_axis(body, v), fastest)
        speed = speed_of(body, v)
    end = (contact.reason, is_loose)
    return Flow(measured, dissipation, work, constant_work, speed, others, *end)


def _motions(
    body: Body, rigid: list[Rigid], at_facets: Floats
) -> tuple[list[Floats], float, float]:
    """Motions of rigid surfaces, and what velocities differ from them: the most, and times area."""
    every = np.append(body.vertices[body.facets], _middles(body), axis=1)
    motions, largest, volume = [], 0.0, 0.0
    for surface in rigid:
        x, v = every[surface.facets], at_facets[surface.facets]
        motion, off = surface.motion(x.reshape(-1, body.dim), v.reshape(-1, body.dim))
        motions.append(motion)
        largest = max(largest, off)
        volume += off * float(body.areas[surface.facets].sum())
    return motions, largest, volume


def _middles(body: Body) -> Floats:
    """Return the midpoints of the edges of facets, in the order of the nodes."""
    x = body.vertices[body.facets]
    return np.stack([x[:, pair].mean(axis=1) for pair in combinations(range(body.dim), 2)], axis=1)


def size_of(dissipation: float, excess: float, loose: bool) -> float:
    """Return the dissipation of a mechanism, or a share of the excess work, if more.

    It is all of that where cells of no cohesion, or joints of no adhesion, dissipate nothing.
    """
    # Least dissipation that is counted, over the work of the loads whose factor is bounded.
    least_share = 1.0 if loose else 1e-3
    return max(dissipation, least_share * abs(excess))


def _plain_flow(body: Body, v: Floats, subdivisions: int) -> tuple[float, float, float]:
    """Return inadmissible rates and strains of elastic cells, integrated, and ∫D from above."""
    rates, plastic = strain_rates(body, v), body.plastic
    wrong, dissipation = _dissipated(body, vectors(rates), subdivisions)
    strains = np.linalg.norm(rates[~plastic], axis=(2, 3)).max(axis=1) @ body.volumes[~plastic]
    return float((wrong.max(axis=1) * body.volumes).sum()), float(strains), dissipation


def _dissipated(body: Body, rates: Floats, subdivisions: int) -> tuple[Floats, float]:
    """Return the inadmissible rates at the vertices, zero in elastic cells, and ∫D from above."""
    cones, wrong = body.cones, np.zeros(rates.shape[:2])
    plastic, linear = body.plastic, np.zeros(len(rates), dtype=bool)
    wrong[plastic] = cones.lacking(body.cone[plastic], rates[plastic])
    linear[plastic] = cones.is_linear[body.cone[plastic]]
    powers = cones.linear_power(body.cone[linear], rates[linear])
    total = float(_means(powers, body.cell_strength[linear]) @ body.volumes[linear])
    principal = np.append(cones.is_principal, False)[body.cone]
    some = np.flatnonzero(plastic & ~linear & ~principal)
    points, shares = halved(body.dim, subdivisions)
    at_once = 10_000  # cells whose dissipation is found together, for the memory it takes
    for cells in np.array_split(some, len(some) // at_once + 1):
        sizes, along = cones.convex_power(body.cone[cells], rates[cells])
        squares = np.zeros((len(cells), len(points)))
        for component in sizes.transpose(2, 0, 1):
            squares += (component @ points.T) ** 2
        strength = body.cell_strength[cells]
        powers = np.einsum("cp,cp->c", np.sqrt(squares), strength @ shares.T)
        total += float(body.volumes[cells] @ (powers + _means(along, strength)))
    some = np.flatnonzero(plastic & ~linear & principal)
    parts = -(-len(some) * len(points) // (100 * at_once))
    for cells in np.array_split(some, parts) if parts else []:
        powers = cones.principal_power(body.cone[cells], points @ rates[cells])
        weights = body.cell_strength[cells] @ shares.T
        total += float(body.volumes[cells] @ np.einsum("cp,cp->c", powers, weights))
    return wrong, total


def _means(values: Floats, strength: Floats) -> Floats:
    """Return the means in cells of the products of two functions that are linear in them.

    Args:
        values: Values of the one at the vertices, shape (num_cells, d + 1).
        strength: Strength of the other.
    """
    return np.einsum("cv,cv->c", mean_shares(values[..., None])[..., 0], strength)


def strain_rates(body: Body, v: Floats) -> Floats:
    """ε(v) at the vertices of each cell, shape (num_cells, d + 1, d, d)."""
    g, d = body.gradients, body.dim
    gradient = np.einsum("cvi,cvj,kv->ckij", v[:, : d + 1], g, 4 * np.eye(d + 1) - 1)
    for node, (a, b) in enumerate(combinations(range(d + 1), 2), start=d + 1):
        gradient[:, a] += 4 * np.einsum("ci,cj->cij", v[:, node], g[:, b])
        gradient[:, b] += 4 * np.einsum("ci,cj->cij", v[:, node], g[:, a])
    rates: Floats = (gradient + gradient.transpose(0, 1, 3, 2)) / 2
    return rates


def _facet_nodes(body: Body) -> Longs:
    """Return places in the cell of each facet's vertices and of the middles of its edges."""
    d = body.dim
    number = np.zeros((d + 1, d + 1), dtype=np.int64)
    for node, (a, b) in enumerate(combinations(range(d + 1), 2), start=d + 1):
        number[a, b] = number[b, a] = node
    places = body.places
    middles = [number[places[:, a], places[:, b]] for a, b in combinations(range(d), 2)]
    return np.concatenate([places, np.stack(middles, axis=1)], axis=1)


def _work(body: Body, loads: Loads, v: Floats, at_facets: Floats) -> float:
    """L(v) of tractions and forces, exact."""
    d = body.dim
    moments = np.array([[_moment(d - 1, [a, *b]) for b in _quadratic(d)] for a in range(d)])
    work = np.einsum("f,fai,an,fni->", body.areas, loads.traction, _nodal(moments, d), at_facets)
    means = _nodal(np.array([[_moment(d, list(b)) for b in _quadratic(d + 1)]]), d + 1)[0]
    return float(work + np.einsum("c,ci,n,cni->", body.volumes, loads.body_force, means, v))


def _quadratic(count: int) -> list[tuple[int, int]]:
    """Return the products of barycentric coordinates: squares, then those of two."""
    return [(a, a) for a in range(count)] + list(combinations(range(count), 2))


def _moment(dim: int, factors: list[int]) -> float:
    """Mean over a simplex of a product of barycentric coordinates."""
    value = factorial(dim) / factorial(dim + len(factors))
    for factor in set(factors):
        value *= factorial(factors.count(factor))
    return value


def _nodal(moments: Floats, count: int) -> Floats:
    """Means against the quadratic shape functions, from those against squares and products."""
    # shape functions: λ_a(2λ_a − 1) = λ_a² − Σ_b≠a λ_a λ_b, and 4 λ_a λ_b
    found = moments.copy()
    for node, (a, b) in enumerate(combinations(range(count), 2), start=count):
        found[:, a] -= moments[:, node]
        found[:, b] -= moments[:, node]
        found[:, node] *= 4
    return found
