"""Check whether a stress proves a lower bound.

The stress is linear in each cell, and the file contains it at the cells' vertices. λ is a lower
bound on the limit load of the bodies under the following conditions (static theorem, W. Prager, P.
G. Hodge, Theory of Perfectly Plastic Solids, 1951). In each cell div σ + b = 0, where b is the
force per volume of all loads at λ. Tractions are equal on both sides of inner facets, and equal to
the loads on outer facets. Contact has a pressure q ≥ 0 and no shear; with friction, it has a shear
traction ‖τ‖ ≤ c + μq. At each vertex ‖Mσ‖ ≤ c − q·σ with the cone of the cell (:mod:`cones`). The
condition then holds in the whole cell, because these stresses form a convex set. With a pore
pressure u, the cones bound effective stresses σ′, and σ = σ′ − uI. If c varies, it is linear in the
cell, so a check at the vertices suffices. Another stress balances the residual of equilibrium, and
its size reduces the bound (:mod:`balance`). For cones with c = 0, the distance of the stress at
each vertex from the boundary of the cone must be at least this size. In 2D, both stresses of such
cells are zero at vertices of free surfaces. For bodies of revolution, the same conditions apply to
S = rσ, which is quadratic (:mod:`rings`, :mod:`ring_balance`), and works are divided by 2π.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balance import cost_of
from perfplast_fenicsx.proof.balls import U
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.least_radii import BARE, finite, least_of, least_radii
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.outer_tractions import outer_tractions, tractions_on
from perfplast_fenicsx.proof.pieces import largest_share
from perfplast_fenicsx.proof.remainder import remainder_of
from perfplast_fenicsx.proof.rigid import rigid_of, sums_of
from perfplast_fenicsx.proof.ring_balance import ring_stress
from perfplast_fenicsx.proof.rings import (
    applied,
    coefficients_of_radius,
    facet_coefficients,
    on_axis,
    radii_of,
    whole_stress,
)
from perfplast_fenicsx.proof.verdict import share_of


@dataclass(frozen=True)
class Left:
    """Residuals of the conditions that a stress must satisfy.

    Attributes:
        measured: Relative residuals by name. ``equilibrium``, ``inner_tractions``,
            ``outer_tractions``, ``tension`` and ``unequal_pressures`` are stresses relative to the
            least finite yield radius of the cells that a row touches (a cell and its neighbours;
            both sides of a facet, also in contact), or to the least radius of all cells if the
            touched cells are elastic. ``asymmetry`` is relative to the least radius of all cells.
            ``left_of_load`` is the sum of all unbalanced forces relative to the sum of the loads at
            λ. ``left_of_piece`` is the same ratio for each piece, and ``left_of_strength`` is
            relative to the least γV^((d − 1)/d) of a cell with yield radius γ and volume V.
            ``yield_ratio`` is the largest (‖Mσ‖ + q·σ)/c; the stress divided by this ratio lies in
            the cone, because the cone contains 0. With rigid surfaces there is also
            ``rigid_forces``, the force and moment over the area. With friction there are also
            ``unequal_shears``, ``shear`` (beyond μq without adhesion) and ``shear_ratio``, the
            largest (‖τ‖ − μq)/c with adhesion. For bodies of revolution there is also ``axis``, the
            largest S on the axis.
        forces: The sum of the magnitudes of all unbalanced forces.
        loads: Sum of the loads' magnitudes at λ.
        reason: Reason why the contact conditions cannot be checked, or None.
    """

    measured: dict[str, float]
    forces: float
    loads: float
    reason: str | None


def measure_stress(body: Body, stress: Floats, kinds: Sequence[Loads]) -> Left:
    """Return the residuals of a stress, and the reason if contact cannot be checked.

    Args:
        body: The bodies.
        stress: σ (effective stress with a pore pressure) at the vertices of each cell, shape
            (num_cells, d + 1, d, d), or coefficients of S, shape (num_cells, 6, 2, 2).
        kinds: All loads at λ, by kind.
    """
    loads = sum(kinds[1:], start=kinds[0])
    rigid = rigid_of(body)
    d, radii, effective = body.dim, least_radii(body, stress), stress
    stress = stress if body.is_revolved else loads.total(effective)
    weakest = least_of(radii)
    section = body.volumes ** ((d - 1) / d)  # for rings the radii contain the factor r
    vector, divergence = _balance(body, stress, loads)
    left_in = np.linalg.norm(divergence, axis=2)
    in_cells = left_in.mean(axis=1) * body.volumes
    inner = body.sides[0]
    jumps = sum(
        tractions_on(body, stress, side, _places(body, side), body.normals_of(side))
        for side in inner.T
    )
    on_facets = np.linalg.norm(jumps, axis=2)
    between = radii[inner // (d + 1)].min(axis=1)
    around = radii.copy()
    for side in (0, 1):
        np.minimum.at(around, inner[:, side] // (d + 1), between)
    around[radii == BARE] = BARE
    outer = outer_tractions(body, stress, loads, rigid, radii)
    size = np.ptp(body.vertices[body.cells], axis=1).max(axis=1)
    ratios = {
        "equilibrium": left_in.max(axis=1) * size / finite(around, weakest),
        "inner_tractions": on_facets / finite(between, weakest)[:, None],
        **outer.ratios,
    }
    measured = {"asymmetry": _largest(stress - stress.transpose(0, 1, 3, 2)) / weakest}
    measured |= {name: _largest(values) for name, values in ratios.items()}
    jumped = body.areas_of(inner[:, 0]) * on_facets.mean(axis=1)
    forces = float(in_cells.sum() + jumped.sum() + outer.lost.sum() + outer.of_plates.sum())
    sizes = [_sizes(body, kind) for kind in kinds]
    pulls, pushes = (np.sum(each, axis=0) for each in zip(*sizes, strict=True))
    loaded = float(pulls.sum() + pushes.sum()) + sum(sums_of(rigid, kind)[0] for kind in kinds)
    lost = (in_cells, jumped, outer.lost)
    loads_of = (pulls, pushes + outer.reacts)
    of_pieces = largest_share(body, lost, loads_of, radii * section)
    of_plates = []
    for plate, off in zip(rigid, outer.of_plates, strict=True):
        wanted = sum(sums_of([plate], kind)[0] for kind in kinds)
        of_plates.append(share_of(off, wanted + float(outer.reacts[plate.facets].sum())))
    measured["left_of_piece"] = max(of_pieces, *of_plates, 0.0)
    measured["left_of_load"] = share_of(forces, loaded)
    measured["left_of_strength"] = share_of(forces, float((radii * section).min()))
    plastic = body.plastic
    bounded = vector if body.is_revolved else vectors(effective)
    ratios_of_yield = body.cones.ratios(body.cone[plastic], bounded[plastic])
    if body.varies:
        ratios_of_yield = ratios_of_yield / body.cell_strength[plastic]
    if body.is_revolved:
        rho = coefficients_of_radius(radii_of(body))[plastic]
        ratios_of_yield = np.where(rho > 0, ratios_of_yield / np.where(rho > 0, rho, 1.0), 0.0)
        measured["axis"] = on_axis(body, stress) / weakest
    measured["yield_ratio"] = _largest(np.where(ratios_of_yield < 0, 0.0, ratios_of_yield))
    return Left(measured, forces, loaded, outer.reason)


@dataclass(frozen=True)
class Overstress:
    """Factor by which an equilibrated stress near a given stress may exceed the strength.

    Attributes:
        factor: The largest (f(σ) + f(τ))/c of cones with c > 0. After division by this factor, σ +
            τ lies in these cones. ∞ if no τ is known.
        has_room: Whether σ + τ lies in the cones with c = 0; True if there are no such cones.
        lacks: Value that c (a stress) of these cones needs for σ + τ to lie inside; ∞ if no τ is
            known.
        pressure: Pressure on all surfaces that has the same effect as c = ``lacks``.
        reason: Reason why no τ is known, or None.
    """

    factor: float
    has_room: bool
    lacks: float
    pressure: float
    reason: str | None

    def words(self) -> list[str]:
        """Return the reasons why ground with c = 0 prevents a proof; empty without such reasons."""
        if self.has_room:
            return []
        why = "ground with c = 0 has no strength left for rounding; give it a small cohesion"
        if not np.isfinite(self.lacks):
            return [why]
        digits = f"c = {self.lacks:.1e}, or a pressure of {self.pressure:.1e} on all surfaces"
        return [why, f"exact equilibrium needs {digits}"]


def overstress(body: Body, stress: Floats, kinds: Sequence[tuple[float, Loads]]) -> Overstress:
    """Return the factor by which an equilibrated stress near a stress may exceed the strength.

    A stress τ balances the residual of σ. At each vertex f(σ + τ) is at most f(σ) + f(τ). At
    vertices of free surfaces with c = 0, both stresses are zero.

    Args:
        body: The bodies.
        stress: In the form of :func:`measure_stress`.
        kinds: Loads of each kind, and their factors.
    """
    plastic = body.plastic
    cones, at = body.cones, body.cone[plastic]
    bare = np.zeros(stress.shape[:2], dtype=bool)
    if body.is_revolved:
        found = ring_stress(body, stress, kinds)
        cost, off = found.cost, found.errors
        rho = coefficients_of_radius(radii_of(body))[plastic, :, None]
        bounded = np.divide(
            found.vectors[plastic], rho, out=np.zeros_like(found.vectors[plastic]), where=rho > 0
        )
    else:
        bare = bare_vertices(body, kinds)
        stress = np.where(bare[..., None, None], 0.0, stress)
        left = remainder_of(body, stress, kinds, bare)
        cost = cost_of(body, left, kinds, bare if bare.any() else None)
        bounded, off = vectors(stress[plastic]), np.zeros(len(stress))
    rounding = 128 * U * np.linalg.norm(bounded, axis=2) + off[plastic, None]
    sizes = cost.size[plastic, None]
    firm = cones.bound[at] > 0
    size = sizes[firm] + rounding[firm]
    shares = cones.ratios(at[firm], bounded[firm]) + size * cones.weakness[at[firm], None]
    shares = shares / body.cell_strength[plastic][firm] if body.varies else shares
    over = float(shares.max(initial=0.0))
    growth = cones.growth[at[~firm], None]
    used = cones.excess(at[~firm], bounded[~firm]) + rounding[~firm] * growth
    room = _room(used, growth * sizes[~firm], bare[plastic][~firm])
    lacks = used + growth * sizes[~firm]
    relief = cones.relief[at[~firm], None]
    pressures = np.divide(lacks, relief, out=np.full_like(lacks, np.inf), where=relief > 0)
    return Overstress(
        over if np.isfinite(over) else np.inf,
        bool((room >= 0).all()),
        float(lacks.max(initial=0.0)),
        float(pressures.max(initial=0.0)),
        cost.reason,
    )


def bare_vertices(body: Body, kinds: Sequence[tuple[float, Loads]]) -> Flags:
    """Return flags of cell vertices at which only zero stress is admissible, (num_cells, d + 1).

    On a free surface, one principal stress is zero. In 2D with c = 0 and without a pore pressure,
    the other principal stress is zero too. Therefore the stress at a vertex of a free surface is
    zero in all cells with c = 0 around this vertex.

    Args:
        body: The bodies.
        kinds: Loads of each kind, and their factors.
    """
    found = np.zeros(body.cells.shape, dtype=bool)
    loose = np.append(body.cones.bound == 0, False)[body.cone]
    if body.dim != 2 or body.is_revolved or not loose.any():
        return found
    touched = np.concatenate([body.contacts.ravel(), body.obstacles, body.rigid])
    free = ~(body.held | (body.guided != 0)).any(axis=1) & ~np.isin(body.surface, touched)
    free &= loose[body.outer // 3]
    loads = sum(np.abs(factor * of.traction).sum(axis=2) for factor, of in kinds)
    pores = sum(np.abs(factor * of.pore_pressure) for factor, of in kinds)
    bare = np.zeros(len(body.vertices), dtype=bool)
    bare[body.facets[free[:, None] & (loads == 0)]] = True
    bare[body.cells[loose[:, None] & (pores > 0)]] = False
    return bare[body.cells] & loose[:, None]


def _room(used: Floats, size: Floats, bare: Flags) -> Floats:
    """Return the distance of σ + τ from the boundaries of cones with c = 0; < 0 outside.

    −f(σ) is at least the linear function with the values −``used`` at vertices and 0 at bare
    vertices. In a cell with bare vertices, τ is quadratic in each of three parts. The Bernstein
    coefficients of τ are at most its size, and zero where the linear function is zero. Therefore τ
    is at most twice its size times this function divided by the function's least positive value at
    vertices and at the centre.

    Args:
        used: f(σ) at vertices, shape (num_cells, values).
        size: f(τ) in each cell, shape (num_cells, 1).
        bare: Flags of vertices at which σ and τ are zero, shape (num_cells, values).
    """
    some = bare.any(axis=1)
    room = -used - size
    centre = -np.where(bare[some], 0.0, used[some]).mean(axis=1, keepdims=True)
    near = np.where(bare[some], centre, np.minimum(-used[some], centre))
    room[some] = near - 2 * size[some]
    return room


def _largest(values: Floats) -> float:
    """Return the largest magnitude; ∞ if any value is not a number."""
    largest = float(np.abs(values).max(initial=0))
    return largest if np.isfinite(largest) else np.inf


def _balance(body: Body, stress: Floats, loads: Loads) -> tuple[Floats, Floats]:
    """Return the stress as vectors, and the residual of equilibrium at points of each cell."""
    if body.is_revolved:
        vector, rest = whole_stress(body, stress, loads.body_force)
        return vector, rest[..., None]
    divergence = np.einsum("cvij,cvj->ci", stress, body.gradients) + loads.body_force
    return vectors(stress), divergence[:, None]


def _sizes(body: Body, loads: Loads) -> tuple[Floats, Floats]:
    """Return magnitudes of forces in cells and on facets; for rings, divided by 2π."""
    if not body.is_revolved:
        return loads.sizes(body.volumes, body.areas)
    pushes = np.linalg.norm(applied(body, loads), axis=2).mean(axis=1)
    weights = body.volumes * radii_of(body).mean(axis=1)
    return weights * np.linalg.norm(loads.body_force, axis=1), body.areas * pushes


def _places(body: Body, sides: Longs) -> Longs:
    """Return indices in the cells of the stresses on sides, in the same order for both cells."""
    d = body.dim
    if body.is_revolved:
        return facet_coefficients(body, sides)
    cells, places = sides // (d + 1), body.corners[sides % (d + 1)]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    return np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)
