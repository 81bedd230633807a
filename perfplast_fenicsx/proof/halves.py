"""Check whether both halves of a proof have the same bodies, even if their meshes differ.

The comparison is local: it compares facets and cells, not sums over the bodies. Outer facets of one
half must coincide with outer facets of the other half (:mod:`shared_facets`) and have the same
surface, supports and tractions. Cells with a common volume (:mod:`shared_cells`) must have the same
body forces and pore pressures, and the cone of the upper half must not be weaker.
"""

from collections.abc import Iterator, Sequence
from itertools import zip_longest

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.cone_shapes import Strengths, are_weaker, strengths_of
from perfplast_fenicsx.proof.crossed_facets import crossed
from perfplast_fenicsx.proof.guided import differ
from perfplast_fenicsx.proof.load_kinds import ALIKE, Loads
from perfplast_fenicsx.proof.reduction import Division
from perfplast_fenicsx.proof.rigid import moments, rigid_of
from perfplast_fenicsx.proof.shared_cells import overlap_ends, shared_cells
from perfplast_fenicsx.proof.shared_facets import shared_facets

SAME = 1e-9
"""Relative difference below which slopes of cones count as equal."""


def differences(lower: Body, upper: Body, divisions: Sequence[Division] = ()) -> list[str]:
    """Return the differences between the bodies of two halves, in words.

    The upper half may have stronger bodies and more friction: an upper bound for stronger bodies is
    also an upper bound for weaker bodies.

    Args:
        lower: The bodies of the lower half.
        upper: The bodies of the upper half.
        divisions: How a factor divides the strengths of both halves; then the undivided strengths
            are compared, and in each place the upper half must not be weaker for some match of its
            Drucker–Prager cones. By default, the strengths in both halves are compared.
    """
    if lower.dim != upper.dim:
        return ["one half has plane bodies, and the other has bodies in 3D"]
    if lower.is_revolved != upper.is_revolved:
        return ["only one half has bodies of revolution"]
    facets = shared_facets(lower, upper)
    a, b = facets.first, facets.second
    places = lower.vertices[lower.facets[a]].mean(axis=1)
    alone = np.concatenate([facets.alone, places[lower.on_axis[a] != upper.on_axis[b]]])
    loaded = places[_tractions_differ(lower, upper, a, b)]
    weaker = joined = loaded[:0]
    if not len(alone):
        joined = crossed(lower, upper)
        weaker, in_cells = _in_cells(lower, upper, divisions)
        loaded = np.concatenate([loaded, in_cells])
    held = (lower.held[a] != upper.held[b]).any(axis=1)
    far = np.maximum(
        far_off(lower.vertices[lower.facets[a]]), far_off(upper.vertices[upper.facets[b]])
    )
    held |= differ(lower.guided[a], upper.guided[b], lower.held[a], far)
    weak = "the upper half has weaker bodies than the lower one, or cones of other shapes"
    found = [
        *_told("the halves have bodies of different volume or position", alone),
        *_told("one half is connected where the other half has a surface", joined),
        *_told(weak, weaker),
        *_told("the halves have different surfaces", places[lower.surface[a] != upper.surface[b]]),
        *_told("the halves have different supports", places[held]),
        *_told("the halves have different loads", loaded),
    ]
    if not _same_plates(lower, upper):
        found.append("the halves have different rigid surfaces, or different loads on them")
    if not _same_contacts(lower, upper, divisions):
        found.append("the halves have different contacts, or the upper half has less friction")
    return found


def _told(what: str, places: Floats) -> list[str]:
    """Return a difference and its first place in words; an empty list without places."""
    if not len(places):
        return []
    first = ", ".join(f"{x:.6g}" for x in places[np.lexsort(places.T[::-1])[0]])
    return [f"{what}, as at ({first})"]


def _kinds(lower: Body, upper: Body) -> Iterator[tuple[Loads, Loads]]:
    """Yield the loads of each kind, for both halves."""
    yield lower.sought, upper.sought
    yield lower.constant, upper.constant
    yield lower.others, upper.others


def _differ(one: Floats, other: Floats, noise: Floats | float = 0.0) -> Flags:
    """Return flags of rows whose vectors differ by more than rounding (:data:`ALIKE`).

    Args:
        one: Vectors, shape (n, points, components).
        other: Vectors of the same shape.
        noise: Size of terms that cancel in these vectors (:func:`_noise`), shape (n,).
    """
    off = np.abs(one - other).max(axis=(1, 2), initial=0)
    size = np.maximum(np.abs(one), np.abs(other)).max(axis=(1, 2), initial=0)
    return np.asarray(~(off <= ALIKE * (size + noise)))


def _noise(vertices: Floats, values: Floats) -> Floats:
    """Return the size of terms that cancel in loads on simplices, shape (n,).

    Where a linear load is small, terms of the size of its gradient times the coordinates cancel.
    Coordinates are rounded, which changes the direction of a pressure by their size relative to
    that of the facet.

    Args:
        vertices: Vertices of simplices, shape (n, k, d).
        values: Values at the vertices, shape (n, k, components).
    """
    size = np.abs(values).max(axis=(1, 2), initial=0.0) + np.ptp(values, axis=1).max(axis=1)
    return np.asarray(size * far_off(vertices))


def far_off(vertices: Floats) -> Floats:
    """Return the largest coordinates of simplices over their extents, shape (n,)."""
    run = np.ptp(vertices, axis=1).max(axis=1, initial=0.0)
    return np.asarray(np.abs(vertices).max(axis=(1, 2), initial=0.0) / run)


def _tractions_differ(lower: Body, upper: Body, a: Longs, b: Longs) -> Flags:
    """Return flags of coinciding facets whose tractions differ at the smaller facet's vertices."""
    found = np.zeros(len(a), dtype=bool)
    places = lower.vertices[lower.facets[a]], upper.vertices[upper.facets[b]]
    smaller = lower.areas[a] <= upper.areas[b]
    for kinds in _kinds(lower, upper):
        on = kinds[0].traction[a], kinds[1].traction[b]
        for some, i, j in ((smaller, 0, 1), (~smaller, 1, 0)):
            there = _linear(places[i][some], places[j][some], on[j][some])
            noise = [_noise(places[k][some], on[k][some]) for k in (i, j)]
            found[some] |= _differ(on[i][some], there, np.maximum(*noise))
    return found


def _linear(places: Floats, vertices: Floats, values: Floats) -> Floats:
    """Return the values of linear functions on simplices, at points on or near the simplices.

    Args:
        places: Points, shape (n, points, d).
        vertices: Vertices of the simplices, of any dimension, shape (n, k, d).
        values: Values at the vertices, shape (n, k, components).
    """
    inverse = np.linalg.pinv(vertices[:, 1:] - vertices[:, :1])
    shares = (places - vertices[:, :1]) @ inverse
    return np.asarray(values[:, :1] + shares @ (values[:, 1:] - values[:, :1]))


def _in_cells(lower: Body, upper: Body, divisions: Sequence[Division]) -> tuple[Floats, Floats]:
    """Return centres of lower cells where the upper half is weaker, and where loads differ."""
    matches = range(max([1, *(len(of.tangents) for of in divisions)]))
    strong = [strengths_of(lower, upper, divisions=divisions, match=match) for match in matches]
    kinds = list(_kinds(lower, upper))
    pulling = [pair for pair in kinds if any(of.body_force.any() for of in pair)]
    wet = any(of.pore_pressure.any() for pair in kinds for of in pair)
    rows = np.concatenate(
        [
            np.column_stack(
                [
                    *(row for pair in strong for row in pair[k]),
                    *(pair[k].body_force for pair in kinds),
                ]
            )
            for k in (0, 1)
        ]
    )
    varies = lower.varies or upper.varies
    if not wet and not varies and (rows == rows[0]).all():
        return np.zeros((0, lower.dim)), np.zeros((0, lower.dim))

    def weaker(a: Longs, b: Longs) -> Flags:
        found = np.ones(len(a), dtype=bool)
        for one, other in strong:
            mine = one.of(a), other.of(b)
            found &= (
                _weaker_somewhere((lower, upper), mine, (a, b)) if varies else are_weaker(*mine)
            )
        return found

    def loaded(a: Longs, b: Longs) -> Flags:
        found = np.zeros(len(a), dtype=bool)
        for one, other in pulling:
            forces = one.body_force[a, None], other.body_force[b, None]
            found |= _differ(*forces)
        return found | _pores_differ(lower, upper, a, b) if wet else found

    a, b = shared_cells(lower, upper, lambda a, b: weaker(a, b) | loaded(a, b))
    centres = lower.vertices[lower.cells[a]].mean(axis=1)
    return centres[weaker(a, b)], centres[loaded(a, b)]


def _weaker_somewhere(
    bodies: tuple[Body, Body], strong: tuple[Strengths, Strengths], pairs: tuple[Longs, Longs]
) -> Flags:
    """Return flags of pairs of cells in whose overlap the upper strength may be smaller.

    Both strengths are linear in their cells, so a comparison at the vertices of the overlap
    suffices. The end points from :func:`overlap_ends` include these vertices.
    """
    found = np.zeros(len(pairs[0]), dtype=bool)
    at_once = 20_000  # number of pairs processed together, limited by memory
    for some in np.array_split(np.arange(len(found)), len(found) // at_once + 1):
        a, b = (of[some] for of in pairs)
        x = [body.vertices[body.cells[of]] for body, of in zip(bodies, (a, b), strict=True)]
        places, there = overlap_ends(*x)
        factors = [
            _linear(places, x[k], bodies[k].cell_strength[of][..., None])[..., 0]
            for k, of in enumerate((a, b))
        ]
        which, _ = np.nonzero(there)
        less, more = (
            one.of(some[which])._replace(bound=one.bound[some[which]] * factor[there])
            for one, factor in zip(strong, factors, strict=True)
        )
        np.logical_or.at(found, some[which], are_weaker(less, more))
    return found


def _pores_differ(lower: Body, upper: Body, a: Longs, b: Longs) -> Flags:
    """Return flags of pairs of cells whose pore pressures differ at the smaller cell's vertices."""
    found = np.zeros(len(a), dtype=bool)
    places = lower.vertices[lower.cells], upper.vertices[upper.cells]
    smaller = lower.volumes[a] <= upper.volumes[b]
    for kind in _kinds(lower, upper):
        u = [of.pore_pressure[..., None] for of in kind]
        wet_cells = [np.asarray(of.any(axis=(1, 2))) for of in u]
        wet = wet_cells[0][a] | wet_cells[1][b]
        slopes = [
            np.einsum("cv,cvi->ci", of.pore_pressure, body.gradients)
            for of, body in zip(kind, (lower, upper), strict=True)
        ]
        for of, small, large, i, j in ((smaller, a, b, 0, 1), (~smaller, b, a, 1, 0)):
            some = np.flatnonzero(of & wet)
            s, t = small[some], large[some]
            away = places[i][s] - places[j][t][:, :1]
            there = u[j][t][:, :1] + np.einsum("npi,ni->np", away, slopes[j][t])[..., None]
            found[some] |= _differ(u[i][s], there, _noise(places[j][t], u[j][t]))
    return found


def _same_plates(lower: Body, upper: Body) -> bool:
    """Return whether rigid surfaces, and the forces and moments on them, are the same."""
    orders = [np.argsort(body.rigid) for body in (lower, upper)]
    tags, held = (
        [getattr(body, name)[order] for body, order in zip((lower, upper), orders, strict=True)]
        for name in ("rigid", "rigid_held")
    )
    if not (np.array_equal(*tags) and np.array_equal(*held)):
        return False
    surfaces = rigid_of(lower)
    if not surfaces:
        return True
    centres, extents = (
        np.array([getattr(surfaces[k], name) for k in orders[0]]) for name in ("middle", "extent")
    )
    for kind in _kinds(lower, upper):
        forces, turns = (
            [getattr(of, name)[order] for of, order in zip(kind, orders, strict=True)]
            for name in ("rigid_force", "rigid_moment")
        )
        about = turns[0] - moments(centres, forces[0])
        off = turns[0] - turns[1] - moments(centres, forces[0] - forces[1])
        apart = _differ(*(of[:, None] for of in forces))
        sizes = np.linalg.norm(about, axis=1) + extents * np.linalg.norm(forces[0], axis=1)
        apart |= ~(np.abs(off).max(axis=1) <= ALIKE * sizes)
        if apart.any():
            return False
    return True


def _contacts(body: Body, division: Division | None) -> Floats:
    """Return a row for each contact: sorted tags, whether F keeps it, adhesion and friction."""
    kept, times = _kept(len(body.contacts), 0, division)
    rubs = np.column_stack([body.contact_adhesion, body.contact_friction]) * times
    rows = np.column_stack([np.sort(body.contacts, axis=1), kept, rubs])
    return np.asarray(rows[np.lexsort(rows.T[::-1])], dtype=np.float64)


def _obstacles(body: Body, division: Division | None) -> Floats:
    """Return a row for each obstacle: tag, whether F keeps it, normal, adhesion and friction."""
    kept, times = _kept(len(body.obstacles), 1, division)
    rubs = np.column_stack([body.obstacle_adhesion, body.obstacle_friction]) * times
    rows = np.column_stack([body.obstacles, kept, body.obstacle_normals, rubs])
    return np.asarray(rows[np.argsort(body.obstacles, kind="stable")], dtype=np.float64)


def _kept(count: int, of: int, division: Division | None) -> tuple[Flags, Floats]:
    """Return whether F keeps each friction, and the factors of the undivided friction."""
    kept = np.ones(count, dtype=bool) if division is None else division.kept[of]
    times = np.where(kept, 1.0, 1.0 if division is None else division.factor)
    return kept, times[:, None]


def _same_contacts(lower: Body, upper: Body, divisions: Sequence[Division]) -> bool:
    """Return whether both halves have equal contacts, with no less friction in the upper half."""
    rounding = 1e-12 if divisions else 0.0  # of the products with F
    for rows, tags in ((_contacts, 3), (_obstacles, 2)):
        one, other = (rows(*of) for of in zip_longest((lower, upper), divisions))
        if len(one) != len(other) or (one[:, :tags] != other[:, :tags]).any():
            return False
        if (one[:, tags:-2] != other[:, tags:-2]).any():  # normals of obstacles
            return False
        if not (one[:, -2:] <= other[:, -2:] * (1 + rounding)).all():
            return False
    return True


def pair_of_radenkovic(lower: Body, upper: Body) -> bool:
    """Return whether a lower cell has a smaller slope than an upper cell in a common volume."""
    less, more = strengths_of(lower, upper)

    def flatter(a: Longs, b: Longs) -> Flags:
        return np.asarray(less.slope[a] < (1 - SAME) * more.slope[b])

    cells, _ = shared_cells(lower, upper, flatter)
    return len(cells) > 0


def pair_of_drucker(lower: Body, upper: Body) -> bool:
    """Return whether the sum of all friction coefficients is smaller in the lower half."""
    sums = (body.contact_friction.sum() + body.obstacle_friction.sum() for body in (lower, upper))
    less, more = sums
    return bool(less < more)
