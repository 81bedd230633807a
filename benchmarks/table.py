"""Write the records of benchmarks as text tables."""

import statistics
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from benchmarks.goals import GOALS, Record, Results

Number = Callable[[Record], Any]

WRONG = 1e-8
"""Relative error of α above which a result counts as wrong."""

COLUMNS: dict[str, tuple[Number, str]] = {
    "dofs": (lambda r: r["dofs"], "d"),
    "ranks": (lambda r: r["ranks"], "d"),
    "Newton": (lambda r: r["newton_iterations"], "d"),
    "sets": (lambda r: r["active_set_iterations"], "d"),
    "moved": (lambda r: r["active_set_changes"], "d"),
    "CG its": (lambda r: r["linear_iterations"], "d"),
    "its/solve": (lambda r: r["iterations_per_solve"], ".1f"),
    "set-ups": (lambda r: r["setups"], "d"),
    "path s": (lambda r: r["seconds"]["path"], ".2f"),
    "run s": (lambda r: r["seconds"]["run"], ".2f"),
    "MB": (lambda r: r["peak_memory_mb"]["total"], ".0f"),
    "E s": (lambda r: r["E"]["seconds"], ".2f"),
    "E its": (lambda r: r["E"]["runs"][0]["iterations"], "d"),
    "E/step": (lambda r: r["E_per_newton_step"], ".2f"),
    "E path": (lambda r: r["E_path"], ".1f"),
    "µs/dof/step": (
        lambda r: r["seconds"]["path"] / r["newton_iterations"] / r["dofs"] * 1e6,
        ".1f",
    ),
}


def is_wrong(record: Record) -> bool:
    """Return whether a level did not converge, or α differs too much from the reference."""
    error = record.get("reference_error")
    return not record["converged"] or (error is not None and not abs(error) <= WRONG)


def median(records: Iterable[Record], number: Number) -> Any:
    """Return the median of a number over the records; None if no record has this number."""
    found = []
    for record in records:
        try:
            found.append(number(record))
        except KeyError:
            continue
    found = [value for value in found if value is not None]
    return statistics.median(found) if found else None


def shown(value: Any, form: str) -> str:
    """Return a number in a format, "d" for integers; "-" for None."""
    if value is None:
        return "-"
    return f"{round(value):d}" if form == "d" else f"{value:{form}}"


def lines(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines with aligned columns: the first to the left, the others to the right."""
    everything = [heading, *rows]
    widths = [max(len(row[k]) for row in everything) for k in range(len(heading))]
    return [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in everything
    ]


def main_table(results: Results) -> list[str]:
    """Return a table of iterations, times, memory and E, with a line for each job."""
    rows = []
    for group, jobs in results.items():
        for job, runs in jobs.items():
            good = [record for record in runs if record]
            note = "FAILED" if len(good) < len(runs) else ""
            note = "NOT SOLVED" if any(map(is_wrong, good)) else note
            name = f"{group}: {job}"
            cells = [shown(median(good, number), form) for number, form in COLUMNS.values()]
            rows.append([name, *cells, note])
    return lines(["case", *COLUMNS, ""], rows)


def _phase(name: str, record: Record) -> float:
    return float(record["seconds"]["phases"][name])


def phase_table(results: Results) -> list[str]:
    """Return a table of the seconds in each phase, averaged over ranks, for the program's jobs."""
    rows, names = [], []
    for group, jobs in results.items():
        for job, runs in jobs.items():
            good = [record for record in runs if record and "phases" in record["seconds"]]
            if not good:
                continue
            names = list(good[0]["seconds"]["phases"])
            spent = [median(good, partial(_phase, name)) for name in names]
            share = median(good, lambda record: record["contact_share"])
            cells = [shown(value, ".2f") for value in spent]
            rows.append([f"{group}: {job}", *cells, f"{share:.2%}"])
    return lines(["seconds by phase", *names, "contact share"], rows) if rows else []


def level_table(results: Results) -> list[str]:
    """Return a table of the load levels of the program's jobs, from their first records."""
    heading = ["load levels", "ζ", "α", "plastic", "Newton", "CG its", "set-ups", "E/step", "s"]
    rows = []
    for group, jobs in results.items():
        for job, runs in jobs.items():
            good = [record for record in runs if record and "levels" in record]
            for k, level in enumerate(good[0]["levels"] if good else []):
                units = good[0].get("E_per_newton_step_by_level")
                cells = [
                    f"{level['zeta']:g}",
                    f"{level['alpha']:.10g}",
                    f"{level['plastic_fraction']:.1%}",
                    f"{level['newton_iterations']}",
                    f"{level['linear_iterations']}",
                    f"{level['setups']}",
                    shown(units and units[k], ".2f"),
                    f"{level['seconds']:.2f}",
                ]
                rows.append([f"{group}: {job}", *cells])
    return lines(heading, rows) if rows else []


def beside_table(results: Results) -> list[str]:
    """Return a table that compares CalculiX with the program, with a line for each load."""
    heading = [
        *("beside CalculiX", "load", "plastic", "work", "displacement", "contact"),
        *("last converged", "bracket", "time over CalculiX's"),
    ]
    rows = []
    for runs in results.get("calculix", {}).values():
        for record in filter(None, runs[:1]):
            bracket = f"{shown(record['lower'], '.6g')} ... {shown(record['upper'], '.6g')}"
            ratio = record["seconds"]["path"] / record["seconds"]["calculix"]
            ends = [shown(record["last_converged"], ".6g"), bracket, f"{ratio:.2f}"]
            for k, one in enumerate(record["beside"]):
                apart = [
                    f"{one[f'{key}_apart']:.2%}" for key in ("alpha", "displacement", "contact")
                ]
                cells = [f"{one['load']:.6g}", f"{one['plastic_fraction']:.1%}", *apart]
                rows.append([record["case"], *cells, *(ends if k == 0 else [""] * 3)])
    return lines(heading, rows) if rows else []


def rank_table(results: Results) -> list[str]:
    """Return a table of sizes and messages of each rank in the group ``scaling``."""
    heading = [
        *("ranks", "rank", "owned", "ghosts", "pairs", "MB"),
        *("messages", "MB in and out", "reductions"),
    ]
    rows = []
    for runs in results.get("scaling", {}).values():
        for record in filter(None, runs[:1]):
            for rank, detail in enumerate(record["ranks_detail"]):
                rows.append(
                    [
                        str(record["ranks"]),
                        str(rank),
                        *(str(detail[k]) for k in ("owned_dofs", "ghost_dofs", "pairs_hosted")),
                        f"{detail['peak_memory_mb']:.0f}",
                        f"{detail['messages']:.0f}",
                        f"{detail['bytes'] / 2**20:.1f}",
                        f"{detail['reductions']:.0f}",
                    ]
                )
    return lines(heading, rows) if rows else []


def goal_table(results: Results) -> list[str]:
    """Return a table with a line for each goal, if one of its groups has records."""
    rows = []
    for goal in GOALS:
        value = goal.measured(results)
        if value is None and not any(group in results for group in goal.groups):
            continue
        sign = "≥" if goal.more else "≤"
        aim = "" if goal.aim is None else f"{sign} {goal.aim:g}"
        measured = shown(value, ".3g")
        rows.append([goal.text, measured, f"{sign} {goal.limit:g}", aim, goal.verdict(value)])
    return lines(["goal", "measured", "limit", "aim", ""], rows) if rows else []


def report(results: Results) -> str:
    """Return all tables that are not empty, separated by empty lines."""
    tables = (main_table, phase_table, level_table, beside_table, rank_table, goal_table)
    texts = ["\n".join(table(results)) for table in tables]
    return "\n\n".join(text for text in texts if text)
