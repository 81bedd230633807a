"""Print forces of loads and supports at a limit load, and of bolts, on the terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from perfplast_fenicsx.outcome_words import Row, force_rows
from perfplast_fenicsx.problem.judged.state import LevelReport


def force_lines(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    axes: str,
    units: Mapping[str, str],
) -> list[str]:
    """Return the lines of the table; an empty list without loads.

    Args:
        loads: See :func:`outcome_words.force_rows`.
        lower: Load factor that the bodies carry for certain.
        upper: Load factor at which the bodies collapse for certain.
        at_limit: The forces in balance with the stress of the lower bound or of the mesh.
        axes: Letters of the components of forces.
        units: Units as in :meth:`units.Units.table`.
    """
    forces = force_rows(loads, lower, upper, at_limit)
    moments = force_rows(loads, lower, upper, at_limit, moments=True)
    if not forces:
        return []
    lines = _table(f"Forces{_bracket(units.get('force', ''))}", axes, forces)
    if any(row for _, row in moments):
        head = f"Moments about the origin{_bracket(units.get('moment', ''))}"
        lines += _table(head, "xyz" if len(axes) == 3 else "z", moments)
    return lines


def bolt_lines(reports: Sequence[LevelReport], unit: str) -> list[str]:
    """Return lines with the forces of bolts at each solved level; an empty list without bolts.

    Args:
        reports: Reports of all levels.
        unit: Unit of forces, if known.
    """
    solved = [(n, report) for n, report in enumerate(reports, 1) if report.converged]
    if not solved or not solved[0][1].bolts:
        return []
    names = list(solved[0][1].bolts)
    widths = [max(12, len(name)) for name in names]
    lines = [f"Forces of bolts, tension positive{_bracket(unit)}:"]
    heads = "".join(f"  {name:>{width}}" for name, width in zip(names, widths, strict=True))
    lines.append(f"{'step':>6}  {'zeta':>12}{heads}")
    for number, report in solved:
        forces = zip((report.bolts[name] for name in names), widths, strict=True)
        cells = "".join(f"  {force:>{width}.6g}" for force, width in forces)
        lines.append(f"{number:>6}  {report.zeta:>12.6g}{cells}")
    return lines


def _table(head: str, axes: str, rows: Sequence[Row]) -> list[str]:
    width = max(len(head), *(len(name) + 2 for name, _ in rows))
    lines = [f"{head:{width}}" + "".join(f"  {axis:>12}" for axis in axes)]
    for name, row in rows:
        cells = "".join(f"  {number:>12.6g}" for number in row)
        lines.append(f"  {name:{width - 2}}{cells}")
    return lines


def _bracket(unit: str) -> str:
    return f" ({unit})" if unit else ""
