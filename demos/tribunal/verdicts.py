"""Judge published numbers by proven bounds, and read and write both kinds of tables."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from decimal import ROUND_FLOOR, Decimal
from pathlib import Path
from typing import TypeVar

IMPOSSIBLE = "impossible"
POSSIBLE = "possible"
BELOW = "below what associated ground carries for certain"
UNDECIDED = "not decided"
WORDS = (IMPOSSIBLE, POSSIBLE, BELOW, UNDECIDED)

METAL = ("constraint factor", "p/(2k)", "p/k")
"""Quantities of problems in metal; other load factors belong to problems in ground."""

METHODS = ("limit equilibrium", "strength reduction", "limit analysis", "slip lines", "formula")
T = TypeVar("T")


@dataclass(frozen=True)
class Published:
    """A published number.

    Attributes:
        problem: Name of the case file.
        value: The number as printed; its last decimal determines the rounding. "1/0.261" means the
            reciprocal.
        quantity: "factor of safety", or the meaning of the load factor of the case.
        bound: "lower" or "upper" if the source calls the number a bound; otherwise empty.
        method: One of :data:`METHODS`.
        program: Program or person that computed the number.
        year: Year of the source, or "undated".
        source: Author, year, pages or DOI.
        transcribed_by: Author of the transcription; empty if the source itself was read.
        doubt: Reason to doubt which problem the source solved; empty if there is no doubt.
    """

    problem: str
    value: str
    quantity: str
    bound: str
    method: str
    program: str
    year: str
    source: str
    transcribed_by: str
    doubt: str


@dataclass(frozen=True)
class Solved:
    """The proven bounds of a problem; numbers are texts as in the table, empty if missing.

    Attributes:
        problem: Name of the case file.
        case: SHA-256 of the case file.
        lower: Factor at which the bodies do not collapse, rounded down.
        upper: Factor at which the bodies collapse, rounded up.
        spiral: Factor at which a log spiral collapses.
        cells: Number of triangles of the larger proof.
        seconds: Processor time of the run.
        stands: SHA-256 of the file that proves the lower bound.
        falls: SHA-256 of the file that proves the upper bound.
    """

    problem: str
    case: str
    lower: str
    upper: str
    spiral: str
    cells: str
    seconds: str
    stands: str
    falls: str

    @property
    def width(self) -> Decimal | None:
        """Distance of the bounds in percent of the lower bound; None if a bound is missing."""
        low, high = self.sides
        return None if low is None or high is None else 100 * (high / low - 1)

    @property
    def sides(self) -> tuple[Decimal | None, Decimal | None]:
        """The lower and the upper bound."""
        low, high = (Decimal(text) if text else None for text in (self.lower, self.upper))
        return low, high


@dataclass(frozen=True)
class Verdict:
    """The judgement on a published number.

    Attributes:
        word: One of :data:`WORDS`.
        percent: Least amount by which the number is above the upper or below the lower bound, in
            percent of this bound; None for the other verdicts.
    """

    word: str
    percent: Decimal | None = None


def ends(value: str) -> tuple[Decimal, Decimal]:
    """Return the least and the largest number that round to a printed value.

    Args:
        value: A decimal number, or "1/" and a decimal number for its reciprocal.
    """
    inverse = value.startswith("1/")
    printed = Decimal(value.removeprefix("1/"))
    exponent = printed.as_tuple().exponent
    assert isinstance(exponent, int), value
    half = Decimal(5).scaleb(exponent - 1)
    least, most = printed - half, printed + half
    return (1 / most, 1 / least) if inverse else (least, most)


def judge(
    value: str, lower: Decimal | None, upper: Decimal | None, doubt: str = "", bound: str = ""
) -> Verdict:
    """Judge a number by the bounds of its problem.

    Args:
        value: The printed value. It represents all numbers that round to this value.
        lower: Proven lower bound; None if it is missing.
        upper: Proven upper bound; None if it is missing.
        doubt: Reason why the bounds may belong to another problem.
        bound: "lower" or "upper" if the source calls the number a bound. Such a number is wrong
            only if it is on the wrong side of both proven bounds.
    """
    least, most = ends(value)
    if doubt:
        return Verdict(UNDECIDED)
    if bound != "upper" and upper is not None and least > upper:
        return Verdict(IMPOSSIBLE, 100 * (least / upper - 1))
    if bound != "lower" and lower is not None and most < lower:
        return Verdict(BELOW, 100 * (1 - most / lower))
    return Verdict(UNDECIDED if lower is None or upper is None else POSSIBLE)


def kind_of(quantity: str) -> str:
    """Return "slopes", "ground" or "metal" for the quantity of a problem."""
    if quantity.startswith(("factor of safety", "k_c", "stability number")):
        return "slopes"
    return "metal" if quantity in METAL else "ground"


def judged(
    published: Iterable[Published], solved: Mapping[str, Solved]
) -> list[tuple[Published, Verdict]]:
    """Judge all numbers in order, and return the verdicts."""
    found = []
    for number in published:
        sides = solved[number.problem].sides if number.problem in solved else (None, None)
        found.append((number, judge(number.value, *sides, number.doubt, number.bound)))
    return found


# ------------------------------------------------------------------------------- tables


def read(kind: type[T], path: Path) -> list[T]:
    """Return the rows of a table; an empty list if the file does not exist."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [kind(**row) for row in csv.DictReader(file)]


def write(path: Path, names: Sequence[str], rows: Iterable[Mapping[str, str]]) -> None:
    """Write a table completely, or leave the old file unchanged."""
    new = path.with_suffix(".new")
    with new.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    new.replace(path)


def write_bounds(path: Path, solved: Mapping[str, Solved]) -> None:
    """Write the proven bounds, with a row for each problem."""
    names = [field.name for field in fields(Solved)]
    write(path, names, (asdict(solved[name]) for name in sorted(solved)))


def write_verdicts(path: Path, rows: Iterable[tuple[Published, Verdict]]) -> None:
    """Write the numbers with their verdicts."""
    names = [field.name for field in fields(Published)]
    table = (
        asdict(number) | {"verdict": verdict.word, "percent": percent(verdict)}
        for number, verdict in rows
    )
    write(path, [*names, "verdict", "percent"], table)


def percent(verdict: Verdict) -> str:
    """Return the percentage of a verdict, rounded down; empty for a verdict without a percentage.

    The percentage has two decimals, or two significant digits if it is below 0.01.
    """
    if verdict.percent is None:
        return ""
    two = Decimal("0.01")
    if 0 < verdict.percent < two:
        two = Decimal(1).scaleb(verdict.percent.adjusted() - 1)
    return f"{verdict.percent.quantize(two, ROUND_FLOOR):f}"
