"""Judge published factors of safety and limit loads by bounds that a file proves.

    ./fenicsx python3 demos/tribunal/tribunal.py [--only NAME ...] [-o DIR] [--publish]

Each case file beside this script is a problem. A problem without bounds is solved, both of its
proofs are checked, and a log spiral is compared where one applies. Then each number of
``published.csv`` gets a verdict. What was solved stays in DIR, so that a run that was stopped goes
on where it was. ``--publish`` copies the tables beside this script, and writes docs/tribunal.md.
"""

import argparse
import csv
import hashlib
import os
import re
import resource
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from json import loads
from pathlib import Path
from statistics import median
from typing import TypeVar

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [] if str(ROOT) in sys.path else [str(ROOT)]

from demos.tribunal.log_spiral import slope_of, upper_bound

PUBLISHED, BOUNDS, VERDICTS = "published.csv", "bounds.csv", "verdicts.csv"
PAGE = ROOT / "docs" / "tribunal.md"
PROOFS = {
    "strength": {"lower": "stands.h5", "upper": "falls.h5"},
    "bounds": {"lower": "bounds.h5", "upper": "bounds.h5"},
}
"""Files of the proofs by the control of a case: of a factor of safety, and of a load factor."""

LONGEST = 1800.0
"""Wall time (s) after which a run is given up."""

IMPOSSIBLE = "impossible"
POSSIBLE = "possible"
BELOW = "below what associated ground carries for certain"
UNDECIDED = "not decided"
WORDS = (IMPOSSIBLE, POSSIBLE, BELOW, UNDECIDED)

METHODS = ("limit equilibrium", "strength reduction", "limit analysis", "slip lines", "formula")
DIGITS = Decimal("1e-5")
"""To which bounds are rounded, away from each other."""

T = TypeVar("T")


@dataclass(frozen=True)
class Published:
    """A number that somebody has published.

    Attributes:
        problem: Name of the case file.
        value: As printed; its decimals are its rounding.
        quantity: "factor of safety", or what the load factor of the case is.
        method: One of :data:`METHODS`.
        program: Who or what computed it.
        year: Of the source, or "undated".
        source: Author, year, pages or DOI.
        transcribed_by: Whose transcription it is; empty where the source itself was seen.
        doubt: What is not certain of the problem that was solved there; empty if nothing is known.
    """

    problem: str
    value: str
    quantity: str
    method: str
    program: str
    year: str
    source: str
    transcribed_by: str
    doubt: str


@dataclass(frozen=True)
class Solved:
    """What is proven of a problem; numbers are texts as in the table, empty where one is missing.

    Attributes:
        problem: Name of the case file.
        case: SHA-256 of the case file.
        lower: Factor with which the bodies do not fall, rounded down.
        upper: Factor with which they fall, rounded up.
        spiral: Factor with which a log spiral falls.
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
    def sides(self) -> tuple[Decimal | None, Decimal | None]:
        """Both bounds."""
        low, high = (Decimal(text) if text else None for text in (self.lower, self.upper))
        return low, high


@dataclass(frozen=True)
class Verdict:
    """The judgement on a published number.

    Attributes:
        word: One of :data:`WORDS`.
        percent: By how much the number is above the upper or below the lower bound at least, in
            percent of that bound; None for the other verdicts.
    """

    word: str
    percent: Decimal | None = None


def judge(value: str, lower: Decimal | None, upper: Decimal | None, doubt: str = "") -> Verdict:
    """Judge a number by the bounds of its problem.

    Args:
        value: As printed. It stands for all numbers that round to it.
        lower: Proven lower bound; None if there is none.
        upper: Proven upper bound; None if there is none.
        doubt: A reason for which the bounds may be those of another problem.
    """
    printed = Decimal(value)
    exponent = printed.as_tuple().exponent
    assert isinstance(exponent, int), value
    half = Decimal(5).scaleb(exponent - 1)
    if doubt:
        return Verdict(UNDECIDED)
    if upper is not None and printed - half > upper:
        return Verdict(IMPOSSIBLE, 100 * ((printed - half) / upper - 1))
    if lower is not None and printed + half < lower:
        return Verdict(BELOW, 100 * (1 - (printed + half) / lower))
    return Verdict(UNDECIDED if lower is None or upper is None else POSSIBLE)


def judged(
    published: Iterable[Published], solved: Mapping[str, Solved]
) -> list[tuple[Published, Verdict]]:
    """Judge all numbers, in their order."""
    found = []
    for number in published:
        sides = solved[number.problem].sides if number.problem in solved else (None, None)
        found.append((number, judge(number.value, *sides, number.doubt)))
    return found


# ------------------------------------------------------------------------------- tables


def read(kind: type[T], path: Path) -> list[T]:
    """Return the rows of a table; nothing if there is no such file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [kind(**row) for row in csv.DictReader(file)]


def write(path: Path, names: Sequence[str], rows: Iterable[Mapping[str, str]]) -> None:
    """Write a table, whole or not at all."""
    new = path.with_suffix(".new")
    with new.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    new.replace(path)


def write_bounds(path: Path, solved: Mapping[str, Solved]) -> None:
    """Write what is proven, a row a problem."""
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
    """Return the percentage of a verdict, rounded down to two digits; empty where it has none."""
    if verdict.percent is None:
        return ""
    return str(verdict.percent.quantize(Decimal("0.01"), ROUND_FLOOR))


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# ------------------------------------------------------------------------------- solving


class Failed(Exception):
    """A problem has no bounds; the message says why."""


def solve(case: Path, folder: Path) -> Solved:
    """Solve a problem, check its proofs, and find its log spiral.

    Args:
        case: The case file.
        folder: Takes a copy of the case, and its results.

    Raises:
        Failed: If the run ends without bounds, a proof is not accepted, or the log spiral is below
            the lower bound.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mine = Path(shutil.copy(case, folder))
    results = folder / "results"
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    command("perfplast_fenicsx", "run", str(mine), "-o", str(results), "--force", "--quiet")
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
    summary = loads((results / "summary.json").read_text(encoding="utf-8"))
    asked = tomllib.loads(case.read_text(encoding="utf-8"))
    control = asked["loading"]["control"]
    found = summary["limit"]["strength" if control == "strength" else "body"]
    if found["lower"] is None and found["upper"] is None:
        raise Failed(summary["limit"]["verdict"])
    slope = slope_of(asked) if control == "strength" else None
    spiral = None if slope is None else upper_bound(slope)
    if spiral is not None and found["lower"] is not None and spiral < found["lower"]:
        raise Failed(f"a log spiral falls at F = {spiral}, but {found['lower']} is called proven")
    texts, sums, cells = {"lower": "", "upper": ""}, {"lower": "", "upper": ""}, 0
    for side, way in (("lower", ROUND_FLOOR), ("upper", ROUND_CEILING)):
        if found[side] is not None:
            proof = results / PROOFS[control][side]
            cells = max(cells, check_proof(proof, side, found[side], control == "strength"))
            texts[side] = str(Decimal(found[side]).quantize(DIGITS, way))
            sums[side] = checksum(proof)
    return Solved(
        problem=case.stem,
        case=checksum(case),
        lower=texts["lower"],
        upper=texts["upper"],
        spiral="" if spiral is None else f"{spiral:.5f}",
        cells=str(cells),
        seconds=f"{spent:.0f}",
        stands=sums["lower"],
        falls=sums["upper"],
    )


def check_proof(path: Path, side: str, factor: float, divides: bool) -> int:
    """Have a proof checked by the checker of proofs, in a process of its own.

    Args:
        path: The file.
        side: "lower" or "upper".
        factor: What it has to prove.
        divides: Whether the factor divides strengths; else it multiplies loads.

    Returns:
        The number of its cells.

    Raises:
        Failed: If it is not accepted, or is one of another factor.
    """
    said = command("perfplast_fenicsx.proof", str(path))
    proven = re.search(rf"^{side}: ([\d.e+-]+) is proven", said, re.MULTILINE)
    cells = re.search(r"Taken as written: (\d+) triangles", said)
    if proven is None or cells is None:
        raise Failed(f"{path.name} is not accepted: {said}")
    carried = Decimal(proven[1])
    if not divides:
        if abs(float(carried) / factor - 1) > 1e-6:
            raise Failed(f"{path.name} proves {carried}, not {factor}")
        return int(cells[1])
    divided = re.search(r"divided by F = ([\d.e+-]+?)[.;]?\s", said)
    if divided is None:
        raise Failed(f"{path.name} does not divide strengths: {said}")
    if not (carried >= 1 if side == "lower" else carried <= 1):
        raise Failed(f"{path.name} proves that the loads are carried {carried} times, not once")
    if abs(float(divided[1]) / factor - 1) > 1e-8:
        raise Failed(f"{path.name} is a proof of F = {divided[1]}, not of {factor}")
    return int(cells[1])


def command(module: str, *arguments: str) -> str:
    """Run a module on one core, and return what it prints.

    Raises:
        Failed: If its exit status is not 0, or it takes too long.
    """
    one_core = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-m", module, *arguments]
    try:
        ended = subprocess.run(
            words, cwd=ROOT, env=one_core, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired as error:
        raise Failed(f"{module} did not end within {LONGEST:g} s") from error
    if ended.returncode != 0:
        raise Failed(f"{module} ended with status {ended.returncode}: {ended.stderr.strip()}")
    return ended.stdout


def known(folder: Path, cases: Mapping[str, Path]) -> dict[str, Solved]:
    """Return what a folder has of the cases as they are now."""
    rows = read(Solved, folder / BOUNDS)
    return {
        row.problem: row
        for row in rows
        if row.problem in cases and row.case == checksum(cases[row.problem])
    }


# ------------------------------------------------------------------------------- the page

ABOVE_ALL = """# Published numbers before a proof

<!-- written by demos/tribunal/tribunal.py; edit that -->

Many programs, papers and books give factors of safety of the same slopes, or limit loads of the
same bodies, and their numbers differ. This page compares each number with two bounds that a file
proves. With strengths divided by the lower bound on a factor of safety, a stress carries the
weight, and no cell yields. With strengths divided by the upper bound, a mechanism moves, and the
weight does more work than the ground can take up. Bounds on a load factor multiply the loads
instead.

```bash
make tribunal                     # solves all problems; NAMES="pruska_01 cheng" selects
```

- [Case files](../demos/tribunal) of at most 25 lines have coordinates and strengths.
- [published.csv](../demos/tribunal/published.csv) has the numbers and their sources.
- [bounds.csv](../demos/tribunal/bounds.csv) has the bounds and the checksums of their proofs.
- [verdicts.csv](../demos/tribunal/verdicts.csv) has a verdict for each number.

"""

EXPLAINED = """
## What is proven, and what is not

- A number is **impossible** if it is above the upper bound by more than its rounding. Then it is
  wrong for the ground as written, whatever the flow rule is. Ground that dilates less than its
  angle of friction has no larger factor (D. Radenkovic, 1961).
- A number is **below what associated ground carries for certain** if it is below the lower bound by
  more than its rounding. Ground that dilates less may fall there. Limit equilibrium may rest on a
  cautious assumption.
- A number is **possible** if it is neither.
- A number is **not decided** if a bound is missing, or if it is not certain which problem was
  solved.
- The rounding is half a unit of the last printed digit. The percentage is the least one within it.

The bounds hold for plane strain, the law in the case file (Mohr–Coulomb's without a limit of
tension, or von Mises'), associated flow, and the geometry as written. In slopes this includes the
base, which is fixed, and the ends, which cannot move along x. A published number may belong to
other ends or to another base. Nothing is proven of cracks, of progressive failure, or of the ground
in the field.

Most sources were read in a transcription, which `published.csv` names in each row. So a verdict may
also mean a misprint in the source or in its transcription. Problems with a geometry that only a
figure has are left out, and so are factors of one given slip surface.

Factors of bearing capacity in textbooks are empirical or for design. "Impossible" then means that
no footing of this kind on such ground carries that much, and says nothing of a footing in the
field.

The last column of the first table is independent of the other bounds. It is the best log spiral
that `log_spiral.py` finds, with NumPy and SciPy alone: an upper bound of homogeneous dry slopes.
The script that writes this page fails if a lower bound is above it.

Five of the loads were also bounded with another solver, Clarabel (`[solve] conic = "clarabel"`), on
meshes that it adapted itself. Each of its brackets overlaps the one above:

| problem | lower | upper |
|---|---:|---:|
| `strip_punch` | 5.13043 | 5.15120 |
| `double_cracks_50` | 1.40398 | 1.41040 |
| `notches_90` | 1.78316 | 1.78907 |
| `footing_nc_20` | 14.82315 | 14.88340 |
| `footing_at_slope_45` | 3.56258 | 3.57802 |

To check the proofs of a problem, solve it and call the checker, which needs NumPy and h5py alone:

```bash
./fenicsx python3 demos/tribunal/tribunal.py --only pruska_01 -o build/tribunal
./fenicsx python3 -m perfplast_fenicsx.proof build/tribunal/pruska_01/results/stands.h5
./fenicsx python3 -m perfplast_fenicsx.proof build/tribunal/pruska_01/results/falls.h5
```

The checker prints F, the strengths, the area and the supports that the proof takes as written
([proof files](proof.md)).
"""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of Markdown; heads that end with ":" are aligned to the right."""
    lines = [[head.removesuffix(":") for head in heads]]
    lines += [["---:" if head.endswith(":") else "---" for head in heads], *map(list, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def page(
    cases: Mapping[str, Path], published: Sequence[Published], solved: Mapping[str, Solved]
) -> str:
    """Return the page in docs, which depends on the tables and the titles of the cases alone."""
    titles = {
        name: tomllib.loads(case.read_text(encoding="utf-8"))["title"]
        for name, case in cases.items()
    }
    verdicts = judged(published, solved)
    return "".join(
        [
            ABOVE_ALL,
            in_short(cases, verdicts, solved),
            "\n## Slopes\n\nBounds are those of the factor of safety. The columns of verdicts have"
            " numbers of published values.\n\n",
            of_problems(titles, verdicts, solved, loads=False),
            "\n## Footings, cuts and metal\n\nBounds are those of the load factor, which each case"
            " file explains.\n\n",
            of_problems(titles, verdicts, solved, loads=True),
            "\n## Verdicts by method\n\n",
            of_methods(verdicts),
            EXPLAINED,
            "\n## All numbers\n\nPercentages are above the upper or below the lower bound.\n\n",
            of_numbers(titles, verdicts),
        ]
    )


def in_short(
    cases: Mapping[str, Path],
    verdicts: Sequence[tuple[Published, Verdict]],
    solved: Mapping[str, Solved],
) -> str:
    """Return the result in some sentences."""
    counts = Counter(verdict.word for _, verdict in verdicts)
    widths = [width for row in solved.values() if (width := width_of(row)) is not None]
    said = [
        f"{len(widths)} of {len(cases)} problems have bounds on both sides.",
        f"Of {len(verdicts)} published numbers {counts[IMPOSSIBLE]} are impossible,"
        f" {counts[POSSIBLE]} possible, {counts[BELOW]} below what associated ground carries for"
        f" certain, and {counts[UNDECIDED]} not decided.",
    ]
    if widths:
        seconds = median(float(row.seconds) for row in solved.values())
        said.insert(
            1,
            f"The median distance of the two bounds is {median(widths):.2f} %, the largest"
            f" {max(widths):.2f} %. A problem takes {seconds:.0f} s of one core in the median.",
        )
    over = [verdict.percent for _, verdict in verdicts if verdict.word == IMPOSSIBLE]
    above = [it for it in over if it is not None]
    if above:
        said.append(
            f"Impossible numbers are {median(above):.1f} % above the upper bound in the median,"
            f" and {max(above):.1f} % at most."
        )
    return " ".join(said) + "\n"


def width_of(row: Solved) -> Decimal | None:
    """Return the distance of the bounds in percent of the lower one; None if one is missing."""
    low, high = row.sides
    return None if low is None or high is None else 100 * (high / low - 1)


def of_problems(
    titles: Mapping[str, str],
    verdicts: Sequence[tuple[Published, Verdict]],
    solved: Mapping[str, Solved],
    loads: bool,
) -> str:
    """Return the table with a row a problem.

    Args:
        titles: Of all problems, by name.
        verdicts: On all numbers.
        solved: What is proven, by name.
        loads: Whether to return the problems of a load factor; else those of a factor of safety.
    """
    asked = {number.problem: number.quantity for number, _ in verdicts}
    titles = {
        name: title
        for name, title in titles.items()
        if loads != asked.get(name, "").startswith("factor of safety")
    }
    heads = ["problem", "case", "lower:", "upper:", "width, %:", "s:"]
    heads += ["impossible:", "possible:", "below:", "not decided:"]
    heads += [] if loads else ["log spiral:"]
    rows = []
    for name in sorted(titles, key=lambda name: (not name.startswith("pruska"), name)):
        row = solved.get(name)
        width = None if row is None else width_of(row)
        numbers = Counter(verdict.word for number, verdict in verdicts if number.problem == name)
        found = ["–"] * 2 if row is None else [row.lower or "–", row.upper or "–"]
        spent = "–" if row is None else row.seconds
        case = f"[`{name}`](../demos/tribunal/{name}.toml)"
        shown = [titles[name], case, *found, "–" if width is None else f"{width:.2f}", spent]
        shown += [str(numbers[word] or "") for word in WORDS]
        spiral = [] if loads else ["" if row is None else row.spiral]
        rows.append([*shown, *spiral])
    return table(heads, rows)


def of_methods(verdicts: Sequence[tuple[Published, Verdict]]) -> str:
    """Return the distribution of verdicts by method."""
    counts = Counter((number.method, verdict.word) for number, verdict in verdicts)
    rows = []
    for method in METHODS:
        numbers = [counts[method, word] for word in WORDS]
        if sum(numbers):
            rows.append([method, str(sum(numbers)), *map(str, numbers)])
    return table(["method", "numbers:", *(f"{word}:" for word in WORDS)], rows)


def of_numbers(titles: Mapping[str, str], verdicts: Sequence[tuple[Published, Verdict]]) -> str:
    """Return the table of all numbers."""
    rows = []
    for number, verdict in verdicts:
        by = f" ({percent(verdict)} %)" if verdict.percent is not None else ""
        why = f": {number.doubt}" if number.doubt else ""
        source = number.source
        if number.transcribed_by:
            source += f"; transcribed by {number.transcribed_by}"
        shown = [titles[number.problem], number.value, number.program, number.method]
        rows.append([*shown, number.year, f"{verdict.word}{by}{why}", source])
    heads = ["problem", "value:", "program or author", "method", "year", "verdict", "source"]
    return table(heads, rows)


# ------------------------------------------------------------------------------- command


def all_cases() -> dict[str, Path]:
    """Return the case files by name."""
    return {case.stem: case for case in sorted(HERE.glob("*.toml"))}


def main(argv: Sequence[str] | None = None) -> int:
    """Solve what is not solved, judge all, and write tables and page; 1 if a problem failed."""
    cases = all_cases()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=cases, default=list(cases))
    parser.add_argument("-o", metavar="DIR", type=Path, default=ROOT / "build" / "tribunal")
    parser.add_argument(
        "--publish", action="store_true", help="copy tables and page to their place"
    )
    arguments = parser.parse_args(argv)
    folder: Path = arguments.o.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    solved, failed = known(folder, cases), []
    left = [name for name in arguments.only if name not in solved]
    for number, name in enumerate(left, 1):
        print(f"[{number}/{len(left)}] {name}", end=" ", flush=True)
        try:
            solved[name] = solve(cases[name], folder / name)
        except Failed as error:
            failed.append(name)
            print(f"has no bounds: {error}", flush=True)
            continue
        write_bounds(folder / BOUNDS, solved)
        row = solved[name]
        width = width_of(row)
        apart = "" if width is None else f" ({width:.2f} %)"
        print(f"{row.lower or '–'} … {row.upper or '–'}{apart}, {row.cells} cells, {row.seconds} s")
    published = read(Published, HERE / PUBLISHED)
    verdicts = judged(published, solved)
    write_bounds(folder / BOUNDS, solved)
    write_verdicts(folder / VERDICTS, verdicts)
    (folder / PAGE.name).write_text(page(cases, published, solved), encoding="utf-8")
    if arguments.publish:
        for name in (BOUNDS, VERDICTS):
            shutil.copy(folder / name, HERE)
        shutil.copy(folder / PAGE.name, PAGE)
    for word, count in Counter(verdict.word for _, verdict in verdicts).most_common():
        print(f"{count:4d} {word}")
    print(f"Tables, page and proofs are in {folder}.")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
