"""Test whether the points (α, ζ) of a loading path level off."""

from collections.abc import Sequence

Points = Sequence[tuple[float, float]]
"""Pairs (α, ζ) of levels, in the order of rising α."""


def is_flat(points: Points) -> bool:
    """Return whether the last level has added little to ζ."""
    if len(points) < 2:
        return False
    (_, before), (_, zeta) = points[-2:]
    # A level that increases ζ by less than this share shows the beginning of a mechanism.
    flattest = 0.1
    return zeta - before <= flattest * zeta


def tenfold_growth(points: Points) -> float:
    """Return the growth of ζ, relative to its last value, over the last tenfold growth of α.

    Returns:
        The growth; 1 if α has not grown tenfold since first yield.
    """
    alpha, zeta = points[-1]
    earlier = [z for a, z in points if a <= alpha / 10]
    return (zeta - earlier[-1]) / zeta if earlier else 1.0


def extrapolated_limit(points: Points) -> float | None:
    """Return ζ_∞ of ζ = ζ_∞ − c α^(−p) through three points (α, ζ) of rising α.

    Returns:
        The limit; None if fewer points are given, or if the curve does not flatten (p would have to
        be below 0.05).
    """
    if len(points) < 3:
        return None
    (a, x), (b, y), (c, z) = points
    steady = 1e-11  # relative growth of ζ that is rounding
    if z - y <= steady * abs(z):
        return z
    if y - x <= 0:
        return None
    wanted = (z - y) / (y - x)

    def ratio(p: float) -> float:
        return float((1 - (c / b) ** -p) / ((a / b) ** -p - 1))

    low, high = 0.05, 50.0
    if wanted >= ratio(low):
        return None
    if wanted <= ratio(high):
        return z
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if ratio(middle) > wanted else (low, middle)
    return z + (z - y) / ((c / b) ** high - 1)


def not_level(points: Points, plastic_cells: int, degree: int, dilates: bool = False) -> str:
    """Return a message for a curve that does not level off.

    Args:
        points: Pairs (α, ζ) of its levels.
        plastic_cells: Number of plastic cells at the last level.
        degree: Degree of the elements.
        dilates: Whether bodies dilate as they flow.
    """
    (first, _), (alpha, zeta) = points[0], points[-1]
    if plastic_cells == 0:
        return (
            f"ζ does not level off: nothing has yielded up to ζ = {zeta:.6g}; give the bodies"
            " that may collapse a yield stress"
        )
    told = (
        f"ζ does not level off: it has reached {zeta:.6g} and still rises at"
        f" {alpha / first:.3g} times the work at first yield; "
    )
    if dilates:
        return told + (
            "bodies that dilate where they flow may be confined, by supports or by each other, so"
            " that they carry any load; free a side of them, or refine the mesh"
        )
    if degree == 1:
        return told + (
            "linear elements lock in plastic flow, which keeps the volume, so that the limit load"
            " of this mesh may be infinite; use quadratic ones (degree = 2 under [element])"
        )
    return told + "the loads may be such that the bodies carry any multiple of them; or refine"
