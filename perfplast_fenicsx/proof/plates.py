"""Compute the residual of a stress on rigid plates, and the facets that transfer this residual.

The tractions of a plate on its surface are arbitrary, but their resultant must equal the resultant
of the plate's loads. Therefore the plate transfers the missing part of the resultant through one
facet, as a cell does (:mod:`balance`). A plate that is held along an axis exerts any additional
force along this axis, and any moment. A plate that is glued to several pieces transfers any force
and moment from one piece to another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum

import numpy as np

from perfplast_fenicsx.proof.balls import Balls, U, crossed, stacked, upwards
from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads

AROUND = Balls(np.asarray(1 / (2 * np.pi)), np.asarray(0.0), np.asarray(U))
"""The number 1/2π."""


@dataclass(frozen=True)
class Plates:
    """The forces and moments of plates.

    Attributes:
        centres: Points about which moments are taken, shape (num_rigid, d).
        extents: Largest distances of the surfaces from these points.
        missing: Differences between the resultants of the tractions and of the loads, as forces and
            moments over extents, shape (num_rigid, 3 or 6); zero along held components.
        errors: Errors of ``missing``.
        through: The facet through which each plate transfers the missing resultant.
        first: Facet on which an additional force of any size can act, shape (n,).
        second: Facet on which the opposite force acts; −1 if no facet carries it.
        plate: Index of each force's plate.
        component: Index of the component of force or moment.
        acts: Whether loads, a support or another piece act on each plate along each axis, shape
            (num_rigid, d).
    """

    centres: Floats
    extents: Floats
    missing: Floats
    errors: Floats
    through: Longs
    first: Longs
    second: Longs
    plate: Longs
    component: Longs
    acts: Flags

    def acts_on(self, body: Body, acts: Flags) -> Flags:
        """Return flags of facets on which anything outside their piece acts along each axis.

        Forces between a plate and a piece are internal forces of the plate and the piece together.

        Args:
            body: The bodies.
            acts: Whether there are any tractions, shape (num_facets, d).
        """
        found = acts & ~np.isin(body.surface, body.rigid)[:, None]
        for facets, of in (
            (self.through, self.acts),
            (self.first, self.acts[self.plate]),
            (self.second, self.acts[self.plate]),
        ):
            np.logical_or.at(found, facets[facets >= 0], of[facets >= 0])
        return found

    def wrenches(self) -> Floats:
        """Return the additional unit forces and moments, shape (n, 3 or 6)."""
        return np.asarray(np.eye(self.missing.shape[1])[self.component])


def plates_of(
    body: Body, rest: Balls, kinds: Sequence[tuple[float, Loads]], pieces: Longs
) -> Plates:
    """Return the missing resultants of plates, and the additional forces that plates can exert.

    Args:
        body: The bodies.
        rest: Tractions times areas at the vertices of facets, minus the loads, shape (num_facets,
            d, d), or coefficients of r times this difference, shape (num_facets, 3, 2).
        kinds: Loads of each kind, and their factors.
        pieces: Index of the piece of each cell.
    """
    d, count = body.dim, len(body.rigid)
    size = 3 * (d - 1)
    centres, extents = np.zeros((count, d)), np.ones(count)
    missing, errors = np.zeros((count, size)), np.zeros((count, size))
    through = np.zeros(count, dtype=np.int64)
    acts = np.zeros((count, d), dtype=bool)
    further: list[tuple[int, int, int, int]] = []
    for number, tag in enumerate(body.rigid):
        facets = body.on(tag)
        x = body.vertices[body.facets[facets]]
        centres[number] = x.mean(axis=(0, 1))
        extents[number] = np.linalg.norm(x - centres[number], axis=2).max()
        parts = [_of_tractions(body, rest[facets], x, centres[number])]
        for factor, loads in kinds:
            parts.append(_of_loads(body, loads, number, centres[number], factor))
        held = body.rigid_held[number]
        free = np.append(~held, np.full(size - d, not (held.any() or body.is_revolved)))
        scale = np.append(np.ones(d), np.full(size - d, extents[number]))
        for k in np.flatnonzero(free):
            terms = [of[:, k] for of in parts]
            total = fsum(value for of in terms for value in (*of.mid, *of.low))
            off = sum(float(upwards(of.rad.sum(), len(of.rad))) for of in terms)
            missing[number, k] = total / scale[k]
            errors[number, k] = (off + 4 * U * abs(total)) / scale[k] * (1 + 4 * U)
        through[number], joined = _through(body, facets, pieces)
        pushed = [of.rigid_force[number, None] for _, of in kinds]
        pushed += [of.traction[facets].reshape(-1, d) for _, of in kinds]
        acts[number] = np.concatenate(pushed).any(axis=0) | held | bool(joined)
        if held.any() and not body.is_revolved:
            every = np.append(np.flatnonzero(held), np.arange(d, size))
            for facet in (int(through[number]), *joined):
                further += [(facet, -1, number, k) for k in every]
        for facet in joined:
            further += [(facet, through[number], number, k) for k in np.flatnonzero(free)]
    first, second, plate, component = np.array(further, dtype=np.int64).reshape(-1, 4).T
    return Plates(
        *(centres, extents, missing, errors, through),
        *(first, second, plate, component, acts),
    )


def _of_tractions(body: Body, rest: Balls, x: Floats, centre: Floats) -> Balls:
    """Return the negative forces and moments of facet tractions, (n, 3 or 6)."""
    d = body.dim
    if body.is_revolved:
        force = -rest.sum(axis=1) * Balls.part(3)
        return stacked([force[:, 0], force[:, 1], force[:, 1] * Balls.exact(0.0)], 1)
    force = -rest.sum(axis=1) * Balls.part(d)
    arms = Balls.exact(x) - Balls.exact(centre)
    spread = (rest + rest.sum(axis=1)[:, None]) * Balls.part(d * (d + 1))
    turns = -crossed(arms, spread).sum(axis=1)
    return stacked([*_columns(force), *_columns(turns)], 1)


def _of_loads(body: Body, loads: Loads, number: int, centre: Floats, factor: float) -> Balls:
    """Return the force and moment of the loads on a plate, shape (1, 3 or 6)."""
    force = Balls.exact(loads.rigid_force[number, None])
    about = Balls.exact(loads.rigid_moment[number, None])
    about = about - crossed(Balls.exact(centre[None]), force)
    found = stacked([*_columns(force), *_columns(about)], 1) * Balls.exact(factor)
    return found * AROUND if body.is_revolved else found


def _columns(values: Balls) -> list[Balls]:
    return [values[:, k] for k in range(values.mid.shape[1])]


def _through(body: Body, facets: Longs, pieces: Longs) -> tuple[int, list[int]]:
    """Return a surface's largest facet, and its largest facet on each other piece."""
    of = pieces[body.outer[facets] // (body.dim + 1)]
    order = np.lexsort([facets, -body.areas[facets]])
    _, first = np.unique(of[order], return_index=True)
    every = [int(facets[order[at]]) for at in np.sort(first)]
    return every[0], every[1:]
