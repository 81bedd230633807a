"""List forces and moments of loads and supports as rows of a table, for a limit load."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from perfplast_fenicsx.rounding import ROUNDING, rounded_down, rounded_up

Row = tuple[str, list[float]]


def force_rows(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    moments: bool = False,
    zeta: str = "zeta",
) -> list[Row]:
    """Return the rows of loads at ζ = 1 and at collapse, and of supports at the lower bound.

    Args:
        loads: Tables of :class:`resultants.LoadResultant`.
        lower: Load factor that the bodies are proven to carry.
        upper: Load factor at which they are proven to collapse.
        at_limit: Table of :class:`limit_forces.LimitForces`, in which loads and supports balance,
            for the strict lower bound or the limit load of the mesh.
        moments: Whether to return moments instead of forces.
        zeta: Name of the load factor.

    Returns:
        Words and numbers; empty without loads.
    """
    rows = list(_rows(loads, lower, upper, at_limit, moments, zeta))
    largest = max((abs(number) for _, row in rows for number in row), default=0.0)
    return [
        (name, [number if abs(number) > ROUNDING * largest else 0.0 for number in row])
        for name, row in rows
    ]


def _rows(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    moments: bool,
    zeta: str,
) -> Iterator[Row]:
    strict = at_limit is not None and at_limit.get("strict", False)
    for load in loads:
        named = load["name"] not in ("", load["on"])
        name = f"load {load['name']} on {load['on']}" if named else f"load {load['on']}"
        one = load["moment" if moments else "force"]
        if load["constant"]:
            yield f"{name}, at any {zeta}", one
            continue
        yield f"{name}, {zeta} = 1", one
        if lower is not None:
            shown = rounded_down(lower)
            words = f"{name}, {zeta} = {shown}, carried for certain"
            yield words, [float(shown) * number for number in one]
        if upper is not None:
            shown = rounded_up(upper)
            words = f"{name}, {zeta} = {shown}, collapse for certain"
            yield words, [float(shown) * number for number in one]
        if at_limit is not None and not strict:
            words = f"{name}, {zeta} = {at_limit['zeta']:.6g}, limit load of the mesh"
            yield words, [at_limit["zeta"] * number for number in one]
    if at_limit is not None and loads:
        at = f"{at_limit['zeta']:.6g}, limit load of the mesh"
        if strict:
            at = f"{rounded_down(at_limit['zeta'])}, carried for certain"
        for name, one in at_limit["moments" if moments else "reactions"].items():
            if name != "loads":
                yield f"{name}, {zeta} = {at}", one
