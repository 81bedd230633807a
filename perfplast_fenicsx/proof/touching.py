"""Find opposite facets of two surfaces from their coordinates."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs

AT_ONCE = 2_000_000
"""Number of pairs of facets that are processed together, limited by memory."""


@dataclass(frozen=True)
class Touching:
    """Pairs of facets on two surfaces that differ only by a shift along the normal n.

    For bodies of revolution, the shift preserves radii.

    Attributes:
        first: Indices of facets on the first surface, shape (num_pairs,).
        second: Indices of the opposite facets.
        order: Index in the opposite facet of the vertex opposite each vertex of the first facet,
            shape (num_pairs, d).
        apart: 0 if all facets that face another facet match it; otherwise a positive number that is
            at most the number of facets without such a match.
    """

    first: Longs
    second: Longs
    order: Longs
    apart: int


def touching(body: Body, one: np.int64, other: np.int64) -> Touching:
    """Return the matching facets of two surfaces.

    Args:
        body: The bodies.
        one: Tag of the first surface.
        other: Tag of the second surface.
    """
    firsts, seconds = body.on(one), body.on(other)
    a, b = _each_other(body, *_candidates(body, firsts, seconds))
    normal = body.normals[a][:, None, None]
    x = body.vertices[body.facets]
    away = x[b][:, None] - x[a][:, :, None]
    away = away - np.sum(away * normal, axis=3, keepdims=True) * normal
    gaps = np.linalg.norm(away, axis=3)
    order = np.argmin(gaps, axis=2)
    whole = (gaps.min(axis=2) <= _close(body, a)[:, None]).all(axis=1)
    whole &= (np.sort(order, axis=1) == np.arange(body.dim)).all(axis=1)
    if body.is_revolved:  # only rings of equal size can match
        off = np.take_along_axis(x[b][..., 0], order, axis=1) - x[a][..., 0]
        whole &= (np.abs(off) <= _close(body, a)[:, None]).all(axis=1)
    first, second = a[whole], b[whole]
    left = np.setdiff1d(firsts, first), np.setdiff1d(seconds, second)
    apart = _overlapping(body, *left)
    # If a facet hides another facet of its surface, the hidden facet faces the hiding facet's
    # partner.
    apart = apart or _overlapping(body, left[0], second, in_front=True)
    apart = apart or _overlapping(body, left[1], first, in_front=True)
    return Touching(first, second, order[whole], apart)


def _close(body: Body, facets: Longs) -> Floats:
    """Return the tangential distance that counts as zero at each facet."""
    sizes = body.widths[facets]
    if body.is_revolved:  # the radius scales the difference of two rings
        sizes = np.minimum(sizes, body.vertices[body.facets[facets]][..., 0].max(axis=1))
    rounding = 1e-6  # tangential distance counted as zero, over the least width of the facet
    return rounding * np.asarray(sizes)


def _candidates(body: Body, firsts: Longs, seconds: Longs) -> tuple[Longs, Longs]:
    """Return the pairs of opposed facets whose centres lie on one line along their normals.

    To find the pairs, the function projects the normal and the foot of each line on one direction
    and sorts the results. It then compares only facets that are close in this order.
    """
    none = np.zeros(0, dtype=np.int64)
    if not (len(firsts) and len(seconds)):
        return none, none
    centres = body.vertices[body.facets].mean(axis=1)
    middle = centres[firsts].mean(axis=0)
    extent = float(np.ptp(centres[np.concatenate([firsts, seconds])], axis=0).max())
    close = float(_close(body, firsts).max())
    size = extent or close
    along = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])

    def seen(facets: Longs, sign: float) -> Floats:
        n = sign * body.normals[facets]
        foot = centres[facets] - middle
        foot = foot - np.sum(foot * n, axis=1, keepdims=True) * n
        values: Floats = np.hstack([n, foot / size]) @ along[: 2 * body.dim]
        return values

    of_first, of_second = seen(firsts, 1.0), seen(seconds, -1.0)
    order = np.argsort(of_second)
    same_normal = 1e-8  # normals whose components differ by less are equal
    # An error of a normal moves a foot by at most this error times 2 extents.
    reach = along.sum() * (5 * body.dim * same_normal + close / size)
    start = np.searchsorted(of_second[order], of_first - reach)
    number = np.searchsorted(of_second[order], of_first + reach, side="right") - start
    found_a, found_b = [none], [none]
    pieces = np.cumsum(number) // AT_ONCE
    for piece in np.split(np.arange(len(firsts)), np.flatnonzero(np.diff(pieces)) + 1):
        many = number[piece]
        within = np.arange(int(many.sum())) - np.repeat(np.cumsum(many) - many, many)
        a = np.repeat(firsts[piece], many)
        b = seconds[order[np.repeat(start[piece], many) + within]]
        n, between = body.normals[a], centres[b] - centres[a]
        height = np.sum(between * n, axis=1)
        across = np.linalg.norm(between - height[:, None] * n, axis=1)
        fits = np.abs(body.normals[b] + n).max(axis=1) <= same_normal
        fits &= (across <= _close(body, a)) & (height >= -_close(body, a))
        found_a.append(a[fits])
        found_b.append(b[fits])
    return np.concatenate(found_a), np.concatenate(found_b)


def _each_other(body: Body, a: Longs, b: Longs) -> tuple[Longs, Longs]:
    """Return the pairs on common lines in which each facet is the other's nearest facet."""
    centres = body.vertices[body.facets].mean(axis=1)
    height = np.sum((centres[b] - centres[a]) * body.normals[a], axis=1)
    nearest = np.ones(len(a), dtype=bool)
    for facets in (a, b):
        order = np.lexsort([height, facets])
        nearest[order[np.diff(facets[order], prepend=-1) == 0]] = False
    return a[nearest], b[nearest]


def _overlapping(body: Body, a: Longs, b: Longs, in_front: bool = False) -> int:
    """Return the number of facets of ``a`` that overlap an opposing facet of ``b``.

    Facets overlap if the bounding boxes of their projections along the normal overlap. The function
    stops at the first batch of ``a`` with an overlap. One overlap suffices for a refusal, and a
    check of all pairs of many thousand facets would take long.

    Args:
        body: The bodies.
        a: Indices of facets.
        b: Indices of other facets.
        in_front: Whether to include only facets that lie in front of each other.
    """
    if not (len(a) and len(b)):
        return 0
    x = body.vertices[body.facets]
    centres = x.mean(axis=1)
    radii = np.linalg.norm(x - centres[:, None], axis=2).max(axis=1)
    # Facets face each other if the cosine of the angle between their normals is below −facing.
    facing = 0.1
    for some in np.array_split(a, len(a) * len(b) // AT_ONCE + 1):
        n = body.normals[some]
        between = centres[b] - centres[some][:, None]
        height = np.einsum("abi,ai->ab", between, n)
        across = np.maximum(np.einsum("abi,abi->ab", between, between) - height**2, 0)
        near = across < (radii[some][:, None] + radii[b]) ** 2
        near &= n @ body.normals[b].T < -facing
        if in_front:
            near &= height >= -_close(body, some)[:, None]
        i, j = np.nonzero(near)
        frames = np.linalg.qr(
            np.concatenate([n[:, :, None], np.tile(np.eye(body.dim), (len(n), 1, 1))], axis=2)
        )[0][:, :, 1:]
        mine, other = (x[f] @ frames[i] for f in (some[i], b[j]))
        slack = np.minimum(_close(body, some[i]), _close(body, b[j]))[:, None]
        apart = (mine.min(axis=1) >= other.max(axis=1) - slack) | (
            other.min(axis=1) >= mine.max(axis=1) - slack
        )
        meets = np.unique(i[~apart.any(axis=1)])
        if len(meets):
            return len(meets)
    return 0


def obstacles_of(body: Body) -> Iterator[tuple[np.int64, Floats, np.float64, np.float64]]:
    """Yield the tag, normal, adhesion and friction of each rigid obstacle.

    Args:
        body: The bodies.
    """
    rubs = body.obstacle_adhesion, body.obstacle_friction
    yield from zip(body.obstacles, body.obstacle_normals, *rubs, strict=True)
