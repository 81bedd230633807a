"""The goals of the benchmarks, with their limits, and functions that compute their values."""

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Record = dict[str, Any]

Results = Mapping[str, Mapping[str, Sequence[Record | None]]]
"""Records by group, job and round; None if a run failed."""

Round = Mapping[str, Record]
"""Records of one round by job, without the jobs that failed."""

MULTIGRID = "1 rank, multigrid solver"
MULTIGRID_2 = "2 ranks, multigrid solver"
DEFAULT = "1 rank, default solver"
DEFAULT_2 = "2 ranks, default solver"


@dataclass(frozen=True)
class Goal:
    """A number that must be at most ``limit``, and should be at most ``aim``.

    Attributes:
        text: Description of the number.
        groups: Names of the groups whose records the value needs.
        value: Function that returns the number from one round of each group; it raises KeyError if
            a job is missing.
        more: Whether the number must instead be at least ``limit``.
    """

    text: str
    groups: tuple[str, ...]
    value: Callable[..., float]
    limit: float
    aim: float | None = None
    more: bool = False

    def measured(self, results: Results) -> float | None:
        """Return the median of the value over all rounds; None if no round has all jobs."""
        chosen = [results.get(group, {}) for group in self.groups]
        rounds = max((len(runs) for jobs in chosen for runs in jobs.values()), default=0)
        values = []
        for number in range(rounds):
            try:
                values.append(self.value(*(_round(jobs, number) for jobs in chosen)))
            except (KeyError, ZeroDivisionError):
                continue
        return statistics.median(values) if values else None

    def verdict(self, value: float | None) -> str:
        """Return "met", "MISSED" or "aim reached" for a value; "-" for None."""
        if value is None:
            return "-"
        if self.aim is not None and self._within(value, self.aim):
            return "aim reached"
        return "met" if self._within(value, self.limit) else "MISSED"

    def _within(self, value: float, bound: float) -> bool:
        return value >= bound if self.more else value <= bound


def _round(jobs: Mapping[str, Sequence[Record | None]], number: int) -> Round:
    """Return the record of each job in a round; a job with fewer rounds gives its last record."""
    found = {name: runs[min(number, len(runs) - 1)] for name, runs in jobs.items() if runs}
    return {name: record for name, record in found.items() if record}


def per_step(record: Record) -> float:
    """Return the time (s) of the path per unknown and Newton step."""
    return float(record["seconds"]["path"] / record["newton_iterations"] / record["dofs"])


def units_in_plastic_range(record: Record) -> float:
    """Return the time of a Newton step, in E, for levels with a plastic fraction of 10 % to 35 %.

    Raises:
        KeyError: If no level has such a plastic fraction.
    """
    chosen = [one for one in record["levels"] if 0.10 <= one["plastic_fraction"] <= 0.35]
    if not chosen:
        raise KeyError("no such level")
    steps = sum(level["newton_iterations"] for level in chosen)
    return float(sum(level["seconds"] for level in chosen) / steps / record["E"]["seconds"])


def iterations_at(record: Record, zeta: float) -> float:
    """Return the CG iterations per solve at the level ζ; raise KeyError if it is missing."""
    for level in record["levels"]:
        if level["zeta"] == zeta:
            return float(level["linear_iterations"] / level["linear_solves"])
    raise KeyError(f"no level {zeta}")


def whole_path(record: Record) -> float:
    """Return the time of the path in E; raise KeyError if a level was not solved."""
    if not record["converged"]:
        raise KeyError("not solved")
    return float(record["E_path"])


def _against_plain(ours: str, ranks: str) -> Callable[[Round], float]:
    """Return a function that divides the program's time by the time of the faster plain loop."""

    def ratio(jobs: Round) -> float:
        plain = [
            record["seconds"]["path"]
            for name, record in jobs.items()
            if name.startswith("plain UFL") and name.endswith(ranks)
        ]
        if not plain:
            raise KeyError("no plain loop")
        return float(jobs[ours]["seconds"]["path"] / min(plain))

    return ratio


def _largest_contact_share(*rounds: Round) -> float:
    shares = [
        record["contact_share"]
        for jobs in rounds
        for record in jobs.values()
        if record.get("contact_share")
    ]
    if not shares:
        raise KeyError("no contact")
    return max(shares)


def _path(jobs: Round, name: str) -> float:
    return float(jobs[name]["seconds"]["path"])


def _memory(jobs: Round, name: str) -> float:
    return float(jobs[name]["peak_memory_mb"]["total"])


CONTACT_GROUPS = (
    *("two_blocks_8", "two_blocks_16", "two_blocks_24", "two_blocks_38"),
    *("punch_16", "punch_32", "punch_64", "p2_contact"),
)

GOALS = (
    Goal(
        "E per Newton step, two blocks n = 16, 10 % to 35 % plastic, GAMG",
        ("two_blocks_16",),
        lambda jobs: units_in_plastic_range(jobs[MULTIGRID]),
        0.42,
        0.35,
    ),
    Goal(
        "E of the whole path, two blocks n = 16, ζ = 60, 80, 100",
        ("two_blocks_16",),
        lambda jobs: whole_path(jobs[MULTIGRID]),
        9.0,
        8.0,
    ),
    Goal(
        "time over GetFEM's, punch n = 32, one core",
        ("punch_32",),
        lambda jobs: _path(jobs, DEFAULT) / _path(jobs, "GetFEM"),
        0.4,
        0.15,
    ),
    Goal(
        "memory over GetFEM's, punch n = 32, one core",
        ("punch_32",),
        lambda jobs: _memory(jobs, DEFAULT) / _memory(jobs, "GetFEM"),
        0.5,
    ),
    Goal(
        "time over plain UFL + MUMPS, plate level 3, one core",
        ("l_plate_8",),
        _against_plain(DEFAULT, "1 rank"),
        0.40,
        0.35,
    ),
    Goal(
        "time over plain UFL + MUMPS, plate level 3, 2 ranks",
        ("l_plate_8",),
        _against_plain(DEFAULT_2, "2 ranks"),
        0.40,
        0.35,
    ),
    Goal(
        "time per unknown and Newton step over step-42's, 1 rank",
        ("step42",),
        lambda jobs: per_step(jobs[DEFAULT]) / per_step(jobs["deal.II step-42, 1 rank"]),
        1.0,
        0.5,
    ),
    Goal(
        "time per unknown and Newton step over step-42's, 2 ranks",
        ("step42",),
        lambda jobs: per_step(jobs[DEFAULT_2]) / per_step(jobs["deal.II step-42, 2 ranks"]),
        1.0,
        0.5,
    ),
    Goal(
        "memory of Total FETI over a factorisation's, bolted 270 thousand unknowns, 2 ranks",
        ("bolted_tfeti_250k",),
        lambda jobs: _memory(jobs, "2 ranks, T-FETI") / _memory(jobs, "2 ranks, direct solver"),
        0.6,
    ),
    Goal(
        "a level with constant load, given motion and history over one without",
        ("terms",),
        lambda jobs: float(jobs["1 rank"]["ratio"]),
        1.1,
    ),
    Goal(
        "growth of CG iterations per solve, two blocks n = 8 to 38, same works",
        ("growth",),
        lambda jobs: jobs["n = 38"]["iterations_per_solve"] / jobs["n = 8"]["iterations_per_solve"],
        1.5,
    ),
    Goal(
        "the same at ζ = 60, about three quarters of the body's limit load",
        ("two_blocks_8", "two_blocks_38"),
        lambda few, many: (
            iterations_at(many[MULTIGRID_2], 60.0) / iterations_at(few[MULTIGRID], 60.0)
        ),
        1.5,
    ),
    Goal(
        "1 M unknowns with contact on 2 ranks: memory in all, GB",
        ("two_blocks_38",),
        lambda jobs: (
            _memory(jobs, MULTIGRID_2) * 2**20 / 1e9
            if jobs[MULTIGRID_2]["converged"]
            else float("inf")
        ),
        10.0,
    ),
    Goal(
        "CG iterations per solve, bolted assembly of 270 thousand unknowns, elastic levels",
        ("bolted_250k",),
        lambda jobs: float(jobs[MULTIGRID_2]["iterations_per_solve"]),
        25.0,
        15.0,
    ),
    Goal(
        "their growth from 42 thousand to 1 million unknowns",
        ("bolted_40k", "bolted_1m"),
        lambda few, many: (
            many[DEFAULT_2]["iterations_per_solve"] / few[MULTIGRID_2]["iterations_per_solve"]
        ),
        1.5,
    ),
    Goal(
        "E per Newton step, bolted assembly of 270 thousand unknowns, 2 ranks",
        ("bolted_250k",),
        lambda jobs: float(jobs[DEFAULT_2]["E_per_newton_step"]),
        1.5,
        0.8,
    ),
    Goal(
        "E of the limit load to 1e-3, bolted assembly of 270 thousand unknowns, 2 ranks",
        ("bolted_limit",),
        lambda jobs: whole_path(jobs["limit load, 2 ranks"]),
        60.0,
        30.0,
    ),
    Goal(
        "bolted assembly of 1 M unknowns, 3 load levels, 2 ranks: memory in all, GB",
        ("bolted_1m",),
        lambda jobs: _memory(jobs, DEFAULT_2) * 2**20 / 1e9,
        16.0,
        12.0,
    ),
    Goal(
        "2 ranks against 1, two blocks n = 24: times faster",
        ("two_blocks_24",),
        lambda jobs: _path(jobs, MULTIGRID) / _path(jobs, MULTIGRID_2),
        1.7,
        more=True,
    ),
    Goal(
        "largest share of the contact set-up in a run",
        CONTACT_GROUPS,
        _largest_contact_share,
        0.02,
    ),
    Goal(
        "share of the contact set-up in a run, assembly of bodies meshed apart",
        ("bolted_apart",),
        _largest_contact_share,
        0.05,
    ),
    Goal(
        "import to first Newton step, s",
        ("start",),
        lambda jobs: float(jobs["1 rank"]["seconds"]["to_first_step"]),
        5.0,
    ),
)
