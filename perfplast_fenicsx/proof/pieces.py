"""Which cells hang together by facets, and whether each piece by itself is in equilibrium."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs


def pieces_of(body: Body) -> Longs:
    """Return a number for each cell, the same of those that inner facets join, (num_cells,)."""
    one, other = (body.sides[0] // (body.dim + 1)).T
    return joined(len(body.cells), one, other)


def joined(count: int, one: Longs, other: Longs) -> Longs:
    """Return a number for each of so many things, the same of those that pairs join.

    Args:
        count: How many.
        one: The first of each pair.
        other: The second.
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
    """Return the largest share that forces without balance have of the loads of one piece.

    A piece without loads could be free of stress, so that what is left there is harmless. A share
    of all loads is rounding wherever it is left, but not more of it than the cells of a piece could
    bear.

    Args:
        body: The bodies.
        left: Magnitudes of forces without balance of cells, inner facets and outer ones.
        applied: Those of loads of cells, and of loads and forces of contact on outer facets.
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
    of_all = 1e-3  # share of all loads whose rounding may be left in a piece
    sizes = loads + of_all * np.minimum(loads.sum(), borne)
    loaded = loads != 0
    return float(np.max(forces[loaded] / sizes[loaded], initial=0.0))
