"""Write the page that compares published numbers with proven bounds."""

import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from statistics import median

from demos.tribunal.verdicts import (
    BELOW,
    IMPOSSIBLE,
    METHODS,
    POSSIBLE,
    UNDECIDED,
    WORDS,
    Published,
    Solved,
    Verdict,
    ends,
    judged,
    kind_of,
    percent,
)

NARROW = Decimal("1.5")
"""Width (percent) that nine of ten problems should not exceed."""

TINY = Decimal("0.01")
"""Percentage below which impossible numbers are counted separately."""

PICTURES = "pictures/tribunal"
"""Folder of the pictures, relative to the page."""

MOST_NAMED = 15
"""Number of problems that the page names in the comparison with published numbers."""

ABOVE_ALL = """# Published numbers and proven bounds

<!-- written by demos/tribunal/tribunal.py; edit that -->

Programs, papers and books give different factors of safety for the same slopes, and different limit
loads for the same bodies. This page compares each number with two proven bounds. If strengths are
divided by the lower bound on a factor of safety, an admissible stress balances the weight. If
strengths are divided by the upper bound, the weight does more work on a mechanism than the ground
can dissipate. In problems with a load factor, the bounds multiply the loads instead.

```bash
make tribunal       # solves all problems; NAMES="pruska_01 cheng" selects case files
```

- [Case files](../demos/tribunal) contain coordinates and strengths, in at most 25 lines each.
- [published.csv](../demos/tribunal/published.csv) lists the numbers and their sources.
- [bounds.csv](../demos/tribunal/bounds.csv) lists the bounds and the checksums of their proofs.
- [verdicts.csv](../demos/tribunal/verdicts.csv) gives a verdict for each number.

"""

PROBLEMS = """
## Problems

Bounds are on the factor of safety, unless the title names k_c, γH/c or another load factor, which
the case file defines. The column "s" gives the processor time in seconds. The column "numbers"
counts published numbers: impossible/possible/below/not decided. The pictures show the mechanism
that proves the upper bound: grey parts are at rest, and parts in darker colours move faster. If
only a small part moves, the picture enlarges it. Black lines separate bodies and strengths.
`make tribunal` draws the pictures from the proof files (`demos/tribunal/picture.py`). """

EXPLAINED = """
## What is proven, and what is not

- A number is **impossible** if it exceeds the upper bound by more than its rounding. It is then
  wrong for the ground as written, for any flow rule: ground that dilates less than its friction
  angle has no larger factor (D. Radenkovic, 1961).
- A number is **below what associated ground carries for certain** if it is less than the lower
  bound by more than its rounding. Ground that dilates less may collapse at this number, and limit
  equilibrium may rest on a conservative assumption.
- A number is **possible** if it is neither impossible nor below. A number that its source calls a
  lower or an upper bound is wrong only if it is on the wrong side of both bounds.
- A number is **not decided** if a bound is missing, or if it is not certain which problem was
  solved.
- The rounding is half a unit of the last printed digit. The percentage is the smallest that is
  consistent with the rounding. A percentage below 0.01 % has two significant digits. Such a verdict
  holds only if the source has rounded to the nearest digit.

The bounds hold for plane strain, the law in the case file (Mohr–Coulomb without a tension limit, or
von Mises), associated flow, and the geometry as written. For slopes, this includes the fixed base,
and the ends, which cannot move along x. A published number may assume other ends or another base.
Cracks, progressive failure and the ground in the field are outside the proofs.

We read most sources in a transcription, which `published.csv` names in each row. So a misprint in
the source or in its transcription may also be the cause of a verdict. The page omits problems whose
geometry is only in a figure, and factors of one given slip surface.

Bearing capacity factors in textbooks are empirical, or are meant for design. "Impossible" means
here that no footing of this kind carries that much on such ground.

The last column of the table of slopes is independent of the other bounds. It is an upper bound for
homogeneous slopes, with or without pore water, from the best log spiral that `log_spiral.py` finds
with only NumPy and SciPy. Without friction, the spiral is a slip circle. The script that writes
this page fails if a lower bound exceeds this bound.

For five of the loads another solver, Clarabel (`[solve] conic = "clarabel"`), also computed bounds,
with its own adaptive meshes. Each of its brackets overlaps the bracket above:

| problem | lower | upper |
|---|---:|---:|
| `strip_punch` | 5.13043 | 5.15120 |
| `double_cracks_50` | 1.40398 | 1.41040 |
| `notches_90` | 1.78316 | 1.78907 |
| `footing_nc_20` | 14.82315 | 14.88340 |
| `footing_at_slope_45` | 3.56258 | 3.57802 |

To check the proofs of a problem, solve it and call the checker, which needs only NumPy and h5py:

```bash
./fenicsx python3 demos/tribunal/tribunal.py --only pruska_01 -o build/tribunal
./fenicsx python3 -m perfplast_fenicsx.proof build/tribunal/pruska_01/results/stands.h5
./fenicsx python3 -m perfplast_fenicsx.proof build/tribunal/pruska_01/results/falls.h5
```

The checker prints F, the strengths, the area and the supports that the proof takes as written
([proof files](proof.md)).
"""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; columns whose head ends with ":" are aligned to the right."""
    lines = [[head.removesuffix(":") for head in heads]]
    lines += [["---:" if head.endswith(":") else "---" for head in heads], *map(list, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def page(
    cases: Mapping[str, Path], published: Sequence[Published], solved: Mapping[str, Solved]
) -> str:
    """Return the page for docs; it depends only on the tables and the titles of the cases."""
    titles = {
        name: tomllib.loads(case.read_text(encoding="utf-8"))["title"]
        for name, case in cases.items()
    }
    verdicts = judged(published, solved)
    kinds = {number.problem: kind_of(number.quantity) for number in published}
    return "".join(
        [
            ABOVE_ALL,
            in_short(kinds, verdicts, solved),
            "\n## Verdicts by method\n\n",
            of_methods(verdicts),
            PROBLEMS,
            with_spirals(kinds, solved),
            "\n\n",
            filtered(of_problems(kinds, titles, verdicts, solved)),
            "\n## Comparison with published bounds and numbers\n\n",
            beside(titles, published, solved),
            EXPLAINED,
            "\n## All numbers\n\nPercentages are distances above the upper or below the lower"
            " bound. The sources are in [published.csv](../demos/tribunal/published.csv).\n\n",
            filtered(of_numbers(titles, verdicts)),
        ]
    )


def filtered(rows: str) -> str:
    """Return a table in a box, to which the site adds a filter by verdict (``tribunal.js``)."""
    return f'<div class="tribunal">\n\n{rows}\n</div>\n'


def with_spirals(kinds: Mapping[str, str], solved: Mapping[str, Solved]) -> str:
    """Return a sentence on the number of slopes with a log spiral."""
    rows = [row for name, row in solved.items() if kinds.get(name) == "slopes"]
    found = sum(bool(row.spiral) for row in rows)
    return (
        f"For {found} of {len(rows)} slopes a log spiral gives another upper bound, which no lower"
        " bound exceeds; the other slopes have layers, or water above the surface."
    )


def in_short(
    kinds: Mapping[str, str],
    verdicts: Sequence[tuple[Published, Verdict]],
    solved: Mapping[str, Solved],
) -> str:
    """Return a summary of the results in a few sentences.

    Args:
        kinds: Kinds of all problems, by name.
        verdicts: Verdicts on all numbers.
        solved: Proven bounds, by name.
    """
    counts = Counter(verdict.word for _, verdict in verdicts)
    widths = {name: width for name, row in solved.items() if (width := row.width) is not None}
    both = Counter(kinds[name] for name in widths if name in kinds)
    said = [
        f"{len(widths)} of {len(kinds)} problems have both bounds: {both['slopes']}"
        f" slopes, {both['ground']} other problems with ground, {both['metal']} with metal.",
        f"Of {len(verdicts)} published numbers {counts[IMPOSSIBLE]} are impossible,"
        f" {counts[POSSIBLE]} possible, {counts[BELOW]} below what associated ground carries for"
        f" certain, and {counts[UNDECIDED]} not decided.",
    ]
    if widths:
        seconds = [float(row.seconds) for row in solved.values()]
        narrow = 100 * sum(width <= NARROW for width in widths.values()) // len(widths)
        said.insert(
            1,
            f"The median distance between the bounds is {median(widths.values()):.2f} %, the"
            f" largest {max(widths.values()):.2f} %; for {narrow} % of the problems it is at most"
            f" {NARROW} %."
            f" The median time for a problem is {median(seconds):.0f} s on one core, the total time"
            f" {sum(seconds) / 60:.0f} minutes.",
        )
    above = [it.percent for _, it in verdicts if it.word == IMPOSSIBLE and it.percent is not None]
    tiny = sum(it < TINY for it in above)
    if above:
        said.append(
            f"Impossible numbers exceed the upper bound by {median(above):.1f} % in the median and"
            f" by {max(above):.1f} % at most, {tiny} of them by less than {TINY} %."
        )
    return " ".join(said) + "\n"


def of_problems(
    kinds: Mapping[str, str],
    titles: Mapping[str, str],
    verdicts: Sequence[tuple[Published, Verdict]],
    solved: Mapping[str, Solved],
) -> str:
    """Return the table with a row for each problem.

    Args:
        kinds: Kinds of all problems, by name.
        titles: Titles of all problems, by name.
        verdicts: Verdicts on all numbers.
        solved: Proven bounds, by name.
    """
    heads = ["collapse", "problem", "kind", "lower:", "upper:", "width, %:", "s:", "numbers:"]
    heads += ["log spiral:"]
    rows, order = [], ("slopes", "ground", "metal")
    first = "pruska"
    for name in sorted(
        kinds, key=lambda it: (order.index(kinds[it]), not it.startswith(first), it)
    ):
        row = solved.get(name)
        numbers = Counter(verdict.word for number, verdict in verdicts if number.problem == name)
        found = ["–"] * 4
        if row is not None:
            width = "–" if row.width is None else f"{row.width:.2f}"
            found = [row.lower or "–", row.upper or "–", width, row.seconds]
        picture = f"![]({PICTURES}/{name}.png)" if row is not None and row.upper else ""
        case = f"[{titles[name]}](../demos/tribunal/{name}.toml)"
        counts = "/".join(str(numbers[word]) for word in WORDS)
        spiral = "" if row is None else row.spiral
        rows.append([picture, case, kinds[name], *found, counts, spiral])
    return table(heads, rows)


def beside(
    titles: Mapping[str, str], published: Sequence[Published], solved: Mapping[str, Solved]
) -> str:
    """Return a comparison of the widths of the bounds with published pairs of bounds and numbers.

    If no published pair of bounds is known, the comparison uses the least and the largest published
    number. Problems with exact slip lines are excluded.
    """
    pairs, spreads = [], []
    for name in sorted(titles):
        row = solved.get(name)
        mine = [it for it in published if it.problem == name and not it.doubt]
        if row is None or row.width is None:
            continue
        lows = [it for it in mine if it.bound == "lower"]
        highs = [it for it in mine if it.bound == "upper"]
        if lows and highs:
            low = max(lows, key=lambda it: ends(it.value))
            high = min(highs, key=lambda it: ends(it.value))
            theirs = 100 * (Decimal(high.value) / Decimal(low.value) - 1)
            both = dict.fromkeys(it.source.partition(": ")[0] for it in (low, high))
            here = f"{row.lower} … {row.upper}"
            pairs.append(
                (name, f"{low.value} … {high.value}", theirs, here, row.width, " and ".join(both))
            )
        elif len({it.program for it in mine}) > 2 and all(it.method != "slip lines" for it in mine):
            least = min(ends(it.value)[1] for it in mine)
            most = max(ends(it.value)[0] for it in mine)
            spreads.append((name, 100 * (most / least - 1), row.width))
    said = (
        f"We know published pairs of bounds for {len(pairs)} problems. Our bounds are closer"
        f" together in {sum(width < theirs for *_, theirs, _, width, _ in pairs)} of them:\n\n"
    )
    heads = [
        "problem",
        "published pair",
        "width, %:",
        "our pair",
        "width, %:",
        "source of the pair",
    ]
    lines = [
        [titles[name], printed, f"{theirs:.2f}", here, f"{width:.2f}", sources]
        for name, printed, theirs, here, width, sources in pairs
    ]
    return said + table(heads, lines) + beside_numbers(titles, spreads)


def beside_numbers(
    titles: Mapping[str, str], spreads: Sequence[tuple[str, Decimal, Decimal]]
) -> str:
    """Return a comparison of the widths of the bounds with the differences of published numbers.

    Args:
        titles: Titles of all problems, by name.
        spreads: Name, largest difference between numbers (percent), and width of the bounds
            (percent).
    """
    finer = sorted((it for it in spreads if it[2] < it[1]), key=lambda it: it[2] / it[1])
    ratio = median(spread / width for _, spread, width in finer) if finer else 0
    named = finer[:MOST_NAMED]
    said = (
        "\nFor the other problems we know no published pair."
        f" {len(spreads)} problems have numbers from at least three programs, methods or authors."
        f" In {len(finer)} of them our bounds are closer together than the smallest and the largest"
        f" number, by a factor of {ratio:.0f} in the median. The difference between the numbers"
        f" excludes their rounding. These {len(named)} problems have the largest factors;"
        " `published.csv` lists the sources:\n\n"
    )
    cells = [
        [titles[name], f"{spread:.1f}", f"{width:.2f}", f"{spread / width:.0f}"]
        for name, spread, width in named
    ]
    heads = ["problem", "numbers differ by, %:", "bounds differ by, %:", "factor:"]
    return said + table(heads, cells)


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
        value = f"{number.value} ({number.bound} bound)" if number.bound else number.value
        source = f"{number.program} ({number.method}, {number.year})"
        word = "below" if verdict.word == BELOW else verdict.word
        rows.append([titles[number.problem], value, source, f"{word}{by}{why}"])
    return table(["problem", "value:", "program or author", "verdict"], rows)
