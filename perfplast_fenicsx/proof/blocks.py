"""Do forces on the joints of rigid blocks prove a lower bound? No cell of them can yield.

A block is what inner facets join, and bears any stress: only force and moment on it must balance.
Its outer facets have forces at their vertices, per thickness in the plane. Where surfaces adhere,
shear tractions act beside them, linear between vertices. λ is a lower bound of the limit load if

- the loads at λ, the forces and the tractions are in balance on each block;
- those of both sides of a contact are opposite;
- the forces of contact push with p ≥ 0, and have the shear ‖f_t‖ ≤ μp at most;
- the tractions lie in the facet and are at most c;
- all other forces are where supports hold.

For admissible rigid motions have jumps w with w_n + μ‖w_t‖ ≤ 0 in the joints. There the forces do
no negative work, and the tractions no less than −∫c‖w_t‖ (static theorem, D. C. Drucker, W. Prager,
H. J. Greenberg, doi:10.1090/qam/45573; of blocks, J. Heyman, doi:10.1016/0020-7683(66)90018-7).
"""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.guided import left_free
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.lower import Left
from perfplast_fenicsx.proof.pieces import pieces_of
from perfplast_fenicsx.proof.rigid import moments
from perfplast_fenicsx.proof.touching import obstacles_of, touching
from perfplast_fenicsx.proof.verdict import share_of


def measure_forces(body: Body, forces: Floats, tractions: Floats, kinds: Sequence[Loads]) -> Left:
    """Return what is left of each condition, and what forbids to judge it.

    Args:
        body: The bodies, none of which can yield.
        forces: On the cells at the vertices of outer facets, shape (num_facets, d, d).
        tractions: By adhesion, at the same places, linear between (stress).
        kinds: All loads at λ, each kind by itself.

    Returns:
        ``equilibrium``, force and moment over the extent of each block that nothing balances,
        relative to all forces on it; ``outer_tractions``, forces where nothing holds;
        ``tension``, ``shear`` and ``unequal_pressures`` of contact, relative to the forces on the
        block; ``left_of_load``, what no force balances in all, relative to the loads; and
        ``shear_ratio``, the largest adhesive traction over c.
    """
    loads = sum(kinds[1:], start=kinds[0])
    joints = _Joints(body, forces, tractions)
    blocks, count = _numbered(pieces_of(body))
    of_facets = blocks[body.outer // (body.dim + 1)]
    pulls, pushes = loads.sizes(body.volumes, body.areas)
    acting = np.linalg.norm(forces, axis=2).sum(axis=1)
    acting += body.areas * np.linalg.norm(tractions, axis=2).mean(axis=1) + pushes
    size = _summed(of_facets, acting, count) + _summed(blocks, pulls, count)
    off = _off_balance(body, forces, loads.traction + tractions, loads, blocks)
    lost = np.abs(off).sum(axis=1)
    on_facets = size[of_facets]
    measured = {"equilibrium": _largest(lost, size)}
    left = {
        "outer_tractions": joints.loose,
        "tension": joints.tension,
        "shear": joints.shear,
        "unequal_pressures": joints.unequal,
    }
    measured |= {name: _largest(values, on_facets) for name, values in left.items()}
    measured["shear_ratio"] = float(joints.ratio.max(initial=0.0))
    total = float(lost.sum() + sum(values.sum() for values in left.values()))
    sizes = [of.sizes(body.volumes, body.areas) for of in kinds]
    loaded = float(sum(pull.sum() + push.sum() for pull, push in sizes))
    measured["left_of_load"] = share_of(total, loaded) if loaded else 0.0
    return Left(measured, total, loaded, joints.reason)


class _Joints:
    """The rest that forces leave of the conditions of their facets.

    Attributes:
        loose: Forces, and tractions times areas, where nothing holds or touches, (num_facets,).
        tension: Forces of contact that pull.
        shear: Forces of contact along it, beyond μ times those across; tractions out of the facet.
        unequal: What forces of both sides differ by.
        ratio: Adhesive tractions over c.
        reason: Why the conditions cannot be judged, or None.
    """

    def __init__(self, body: Body, forces: Floats, tractions: Floats) -> None:
        count = len(body.facets)
        self._body, self._forces, self._tractions = body, forces, tractions
        self.loose, self.tension, self.shear, self.unequal, self.ratio = np.zeros((5, count))
        self._times = np.zeros(count, dtype=int)
        self.reason: str | None = None
        rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
        for one, other, (c, mu) in zip(*body.contacts.T, rubs, strict=True):
            pair = touching(body, one, other)
            if pair.apart:
                self.reason = f"{pair.apart} facets of contact or more match none opposite"
            opposite = [
                np.take_along_axis(of[pair.second], pair.order[..., None], axis=1)
                for of in (forces, tractions)
            ]
            apart = np.linalg.norm(forces[pair.first] + opposite[0], axis=2).sum(axis=1)
            unlike = np.linalg.norm(tractions[pair.first] + opposite[1], axis=2).sum(axis=1)
            self.unequal[pair.first] = apart + body.areas[pair.first] * unlike
            for facets in (pair.first, pair.second):
                self._judge(facets, body.normals[facets], c, mu)
        for tag, normal, c, mu in obstacles_of(body):
            facets = body.on(tag)
            self._judge(facets, np.tile(normal, (len(facets), 1)), c, mu)
        free = self._times == 0
        held = body.held.any(axis=1) | np.asarray(body.guided.any(axis=1))
        rest = left_free(forces, body.held, body.guided)
        self.loose[free] = np.linalg.norm(rest, axis=2).sum(axis=1)[free]
        pulled = body.areas * np.linalg.norm(tractions, axis=2).sum(axis=1)
        self.loose[free] += pulled[free]
        if (self._times > 1).any():
            self.reason = "a facet touches two others"
        if held[~free].any():
            self.reason = "supports hold facets in contact"
        if len(body.rigid) or body.is_revolved:
            self.reason = "blocks have rigid surfaces of plates, or are of revolution"

    def _judge(self, facets: Longs, into: Floats, c: float, mu: float) -> None:
        """Judge forces on facets that push along a unit normal into what they touch."""
        self._times[facets] += 1
        along = np.einsum("fvi,fi->fv", self._forces[facets], into)
        across = self._forces[facets] - along[..., None] * into[:, None]
        self.tension[facets] = np.maximum(along, 0.0).sum(axis=1)
        beyond = np.linalg.norm(across, axis=2) + mu * np.minimum(along, 0.0)
        self.shear[facets] = np.maximum(beyond, 0.0).sum(axis=1)
        traction = self._tractions[facets]
        out = np.abs(np.einsum("fvi,fi->fv", traction, into)).sum(axis=1)
        self.shear[facets] += self._body.areas[facets] * out
        sizes = np.linalg.norm(traction, axis=2).max(axis=1, initial=0.0)
        adheres = np.inf if c == 0 else 1 / c
        self.ratio[facets] = np.where(sizes == 0, 0.0, sizes * adheres)


def _off_balance(
    body: Body, forces: Floats, tractions: Floats, loads: Loads, blocks: Longs
) -> Floats:
    """Return forces and moments over the extent of each block, shape (num_blocks, 3 or 6)."""
    d, count = body.dim, int(blocks.max()) + 1
    x = body.vertices[body.cells]
    weights = _summed(blocks, body.volumes, count)
    sums = [_summed(blocks, body.volumes * x[..., i].mean(axis=1), count) for i in range(d)]
    middle = np.stack(sums, axis=1) / weights[:, None]
    extent = np.zeros(count)
    away = np.linalg.norm(x - middle[blocks][:, None], axis=2).max(axis=1)
    np.maximum.at(extent, blocks, away)
    of_facets = blocks[body.outer // (d + 1)]
    found = np.zeros((count, d + 2 * d - 3))

    def act(of: Longs, places: Floats, values: Floats) -> None:
        arms = (places - middle[of]) / extent[of][:, None]
        np.add.at(found, of, np.hstack([values, moments(arms, values)]))

    means = (np.eye(d) + 1) / (d * (d + 1))  # of products of barycentric coordinates
    spread = np.einsum("f,ab,fbi->fai", body.areas, means, tractions)
    at = body.vertices[body.facets]
    for vertex in range(d):
        act(of_facets, at[:, vertex], forces[:, vertex] + spread[:, vertex])
    act(blocks, x.mean(axis=1), body.volumes[:, None] * loads.body_force)
    return found


def _summed(of: Longs, values: Floats, count: int) -> Floats:
    """Return the sum of values of each block, shape (count,)."""
    return np.asarray(np.bincount(of, weights=values, minlength=count), dtype=np.float64)


def _numbered(pieces: Longs) -> tuple[Longs, int]:
    """Return the number of the block of each cell, from 0, and how many there are."""
    found, numbers = np.unique(pieces, return_inverse=True)
    return numbers.ravel(), len(found)


def _largest(values: Floats, sizes: Floats) -> float:
    """Return the largest share; ∞ where one is no number, or something of nothing."""
    shares = np.where(values == 0, 0.0, np.divide(values, sizes))
    largest = float(shares.max(initial=0.0))
    return largest if np.isfinite(largest) else np.inf
