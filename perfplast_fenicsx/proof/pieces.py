"""Find pieces of cells connected by facets, and check the equilibrium of each piece."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs


def pieces_of(body: Body) -> Longs:
    """Return an index for each cell, equal for cells joined by inner facets, shape (num_cells,)."""
    one, other = (body.sides[0] // (body.dim + 1)).T
    return joined(len(body.cells), one, other)


def joined(count: int, one: Longs, other: Longs) -> Longs:
    """Return an index for each of ``count`` things, equal for those that pairs join.

    Args:
        count: Number of things.
        one: The first of each pair.
        other: The second of each pair.
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

    A piece without loads could be free of stress, so that its residual is harmless. A small share
    of all loads counts as rounding in any piece, unless it exceeds the capacity of the piece's
    cells.

    Args:
        body: The bodies.
        left: Magnitudes of unbalanced forces of cells, inner facets and outer ones.
        applied: Magnitudes of loads of cells, and of loads and contact forces on outer facets.
        strengths: Forces that cells bear.
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
