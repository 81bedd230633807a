"""Find pieces of cells that facets connect, build trees of cells, and check pieces' equilibrium."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs


def pieces_of(body: Body) -> Longs:
    """Return an index for each cell, the same for connected cells, shape (num_cells,)."""
    one, other = (body.sides[0] // (body.dim + 1)).T
    return joined(len(body.cells), one, other)


def joined(count: int, one: Longs, other: Longs) -> Longs:
    """Return an index for each of ``count`` items; items that pairs connect have the same index.

    Args:
        count: Number of items.
        one: First item of each pair.
        other: Second item of each pair.
    """
    found = np.arange(count)
    while (found[one] != found[other]).any():
        least = np.minimum(found[one], found[other])
        for side in (one, other):
            np.minimum.at(found, found[side], least)
        while (found != found[found]).any():
            found = found[found]
    return found


def largest_share(
    body: Body, left: tuple[Floats, ...], applied: tuple[Floats, ...], strengths: Floats
) -> float:
    """Return the largest unbalanced force of a piece relative to its loads.

    In a piece without loads, the stress may be zero, and the residual is then harmless. To the
    loads of a piece, the function adds a thousandth of all loads, or of the strength of the piece's
    cells if that is less; an unbalanced force in a lightly loaded piece may otherwise be only a
    rounding error.

    Args:
        body: The bodies.
        left: Magnitudes of unbalanced forces on cells, inner facets and outer facets.
        applied: Magnitudes of the loads on cells, and of loads and contact forces on outer facets.
        strengths: Forces that the cells carry.
    """
    pieces, wide = pieces_of(body), body.dim + 1
    inner, outer = pieces[body.sides[0][:, 0] // wide], pieces[body.outer // wide]

    def summed(at: tuple[Longs, ...], values: tuple[Floats, ...]) -> Floats:
        parts = zip(at, values, strict=True)
        sums = [np.bincount(i, weights=v, minlength=len(pieces)) for i, v in parts]
        return np.asarray(sum(sums[1:], start=sums[0]))

    forces, loads = summed((pieces, inner, outer), left), summed((pieces, outer), applied)
    borne = np.bincount(pieces, weights=strengths, minlength=len(pieces))
    of_all = 1e-3  # share of all loads that counts as rounding in a piece
    sizes = loads + of_all * np.minimum(loads.sum(), borne)
    loaded = loads != 0
    return float(np.max(forces[loaded] / sizes[loaded], initial=0.0))


def sums_by(of: Longs, values: Floats, count: int) -> Floats:
    """Return the sums of values with equal indices, shape (count,)."""
    return np.asarray(np.bincount(of, weights=values, minlength=count), dtype=np.float64)


def bare_ends(body: Body, bare: Flags | None) -> Longs:
    """Return the number of each side's vertices with zero traction, shape (num_sides,).

    Args:
        body: The bodies.
        bare: Flags of vertices of cells at which the stress is zero; None without such vertices.
    """
    wide = body.dim + 1
    if bare is None:
        return np.zeros(len(body.cells) * wide, dtype=np.int64)
    order = np.argsort(body.cells[:, body.corners].reshape(-1, body.dim), axis=1)
    one, other = body.sides[0].T
    found = np.take_along_axis(bare[:, body.corners].reshape(-1, body.dim), order, axis=1)
    both = found[one] | found[other]
    found[one], found[other] = both, both
    return np.asarray(found.sum(axis=1))


def across_of(body: Body) -> Longs:
    """Return the opposite side of each side; −1 for outer facets."""
    sides = body.sides[0]
    found = np.full(len(body.cells) * (body.dim + 1), -1)
    found[sides[:, 0]], found[sides[:, 1]] = sides[:, 1], sides[:, 0]
    return found


def tree_of(body: Body, across: Longs, volumes: Floats, pieces: Longs) -> tuple[list[Longs], Longs]:
    """Return the cells by their distance from the roots, and each cell's side towards its root.

    The side is −1 at a root, the largest cell of its piece. The tree prefers large facets.

    Args:
        body: The bodies.
        across: Opposite side of each side; −1 where the tree must not pass.
        volumes: Sizes of the cells, which determine the roots.
        pieces: Index of the piece of each cell.
    """
    wide, count = body.dim + 1, len(body.cells)
    size = body.areas_of(np.arange(count * wide))
    order = np.lexsort([volumes, pieces])
    roots = order[np.flatnonzero(np.diff(pieces[order], append=-1))]
    back = np.full(count, -1)
    seen = np.zeros(count, dtype=bool)
    seen[roots] = True
    levels = [roots]
    while len(levels[-1]):
        out = (levels[-1][:, None] * wide + np.arange(wide)).ravel()
        there = across[out[across[out] >= 0]]
        there = there[~seen[there // wide]]
        there = there[np.lexsort([size[there], there // wide])]
        last = np.append(np.diff(there // wide) != 0, True)[: len(there)]
        there = there[last]
        cells = there // wide
        back[cells], seen[cells] = there, True
        levels.append(cells)
    return levels, back
