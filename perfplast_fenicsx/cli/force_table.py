"""Forces and moments of loads and supports on the terminal, where a limit load was sought."""

from collections.abc import Iterator, Mapping, Sequence

from perfplast_fenicsx.limit_analysis.limit_forces import LimitForces
from perfplast_fenicsx.problem.load_resultants import LoadResultant
from perfplast_fenicsx.rounding import rounded_down, rounded_up

Row = tuple[str, Sequence[float]]

ROUNDING = 1e-9
"""What of a force or moment is no larger, relative to the largest of its kind, is told as 0."""


def force_lines(
    loads: Sequence[LoadResultant],
    lower: float | None,
    upper: float | None,
    at_limit: LimitForces | None,
    axes: str,
    units: Mapping[str, str],
) -> list[str]:
    """The table, a text for each line; nothing without loads that grow.

    Args:
        loads: At ζ = 1.
        lower: Load factor that the bodies carry for certain.
        upper: One at which they collapse for certain.
        at_limit: What the stress of the mesh is in balance with.
        axes: Letters of the components of forces.
        units: As :meth:`units.Units.table` has them.
    """
    forces = list(_rows(loads, lower, upper, at_limit, moments=False))
    moments = list(_rows(loads, lower, upper, at_limit, moments=True))
    if not forces:
        return []
    about = "xyz" if len(axes) == 3 else "z"
    lines = _table(f"Forces{_bracket(units.get('force', ''))}", axes, forces)
    if any(len(row) for _, row in moments):
        head = f"Moments about the origin{_bracket(units.get('moment', ''))}"
        lines += _table(head, about, moments)
    return lines


def _rows(
    loads: Sequence[LoadResultant],
    lower: float | None,
    upper: float | None,
    at_limit: LimitForces | None,
    moments: bool,
) -> Iterator[Row]:
    for load in loads:
        one = load.moment if moments else load.force
        if load.constant:
            yield f"load {load.name}, at any zeta", one
            continue
        yield f"load {load.name}, zeta = 1", one
        if lower is not None:
            told = f"load {load.name}, zeta = {rounded_down(lower)}, carried for certain"
            yield told, [lower * number for number in one]
        if upper is not None:
            told = f"load {load.name}, zeta = {rounded_up(upper)}, collapse for certain"
            yield told, [upper * number for number in one]
    if at_limit is not None and loads:
        found = at_limit.moments if moments else at_limit.reactions
        for name, one in found.items():
            if name != "loads":
                yield f"{name}, zeta = {at_limit.zeta:.6g}, limit load of the mesh", one


def _table(head: str, axes: str, rows: Sequence[Row]) -> list[str]:
    width = max(len(head), *(len(name) + 2 for name, _ in rows))
    largest = max((abs(number) for _, row in rows for number in row), default=0.0)
    lines = [f"{head:{width}}" + "".join(f"  {axis:>12}" for axis in axes)]
    for name, row in rows:
        shown = (number if abs(number) > ROUNDING * largest else 0.0 for number in row)
        cells = "".join(f"  {number:>12.6g}" for number in shown)
        lines.append(f"  {name:{width - 2}}{cells}")
    return lines


def _bracket(unit: str) -> str:
    return f" ({unit})" if unit else ""
