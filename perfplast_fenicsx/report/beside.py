"""Write a page that compares two runs: verdicts, numbers with differences, pictures, case files."""

import difflib
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import figures
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.case_words import MODELS, CaseWords
from perfplast_fenicsx.report.frame import asset, framed
from perfplast_fenicsx.report.page_file import write_page
from perfplast_fenicsx.report.proof_section import proofs_of
from perfplast_fenicsx.report.quantities import QUANTITIES, bolts, last_load
from perfplast_fenicsx.report.stored_summary import check_summary
from perfplast_fenicsx.report.tables import image, pairs, table
from perfplast_fenicsx.report.verdict import verdict_on
from perfplast_fenicsx.rounding import ROUNDING

LETTERS = ("A", "B")
"""Names of the two runs on a page."""


def write_beside(folders: Sequence[str | Path], output: str | Path | None = None) -> Path:
    """Write a page that compares two runs. Not collective.

    Args:
        folders: Two result folders.
        output: The file; by default ``beside_NAME.html`` in the first folder, where NAME is the
            name of the second folder.

    Returns:
        The path of the file.

    Raises:
        InputError: If the number of folders is not two, if a folder has no readable results, or if
            the file cannot be written.
    """
    if len(folders) != 2:
        raise InputError(
            f"a page shows one run or compares two runs, but {len(folders)} folders are "
            "given; give one or two."
        )
    readers = [ResultReader(folder) for folder in folders]
    for reader in readers:
        check_summary(reader)
    name = f"beside_{readers[1].path.resolve().name}.html"
    return write_page(output, readers[0].path / name, lambda: beside(readers))


def beside(readers: Sequence[ResultReader]) -> str:
    """Return the HTML page that compares two runs.

    Raises:
        InputError: If a file of the results cannot be read.
    """
    for reader in readers:
        proofs_of(reader)
    titles = [reader.scene.title or "A run" for reader in readers]
    title = titles[0] if titles[0] == titles[1] else " beside ".join(titles)
    rows = [
        (letter, f"{reader.path}{_began(reader)}")
        for letter, reader in zip(LETTERS, readers, strict=True)
    ]
    body = Template(asset("beside.html")).substitute(
        title=escape(title),
        head=pairs(rows),
        verdicts="".join(map(_verdict, LETTERS, readers)),
        remarks=_remarks(readers),
        numbers=_section("numbers", "Numbers", _numbers(readers)),
        pictures=_section("pictures", "Pictures", _pictures(readers)),
        cases=_section("cases", "Differences of the cases", _cases(readers)),
        version=escape(__version__),
    )
    return framed(body, title, ["page.css"])


def apart(readers: Sequence[ResultReader]) -> list[str]:
    """Return sentences on differing units, models and loads, which limit the comparison."""
    a, b = (reader.summary for reader in readers)
    told = []
    if _units(readers[0]) != _units(readers[1]):
        both = [_units(reader) or "unknown units" for reader in readers]
        told.append(
            f"The units differ: A uses {both[0]}, B uses {both[1]}. Numbers are not "
            "converted, and numbers with units have no differences."
        )
    if a.model["kind"] != b.model["kind"]:
        kinds = [MODELS.get(one.model["kind"], one.model["kind"]) for one in (a, b)]
        told.append(f"The models differ: A is {kinds[0]}, B is {kinds[1]}.")
    meant = [_meaning(reader) for reader in readers]
    if meant[0] != meant[1]:
        told.append(
            "ζ has a different meaning in each run, so load factors cannot be "
            f"compared directly. A: {meant[0] or 'nothing grows.'} B: "
            f"{meant[1] or 'nothing grows.'}"
        )
    return told


def _verdict(letter: str, reader: ResultReader) -> str:
    found = verdict_on(reader)
    sentence = escape(found.sentence).replace("ζ = ", "ζ&nbsp;=&nbsp;")
    return (
        f'<section class="verdict {found.mark}" aria-label="Verdict of {letter}">'
        f'<p class="badge">{letter}: {escape(reader.scene.title or "A run")}</p>'
        f'<p class="sentence">{sentence}</p></section>'
    )


def _remarks(readers: Sequence[ResultReader]) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in apart(readers))
    return _section("warnings", "Notes on this comparison", items and f"<ul>{items}</ul>")


def _numbers(readers: Sequence[ResultReader]) -> str:
    """Return a table with a row for each number that at least one run has."""
    same_units = _units(readers[0]) == _units(readers[1])
    same_loads = _meaning(readers[0]) == _meaning(readers[1])
    ends = [last_load(reader) for reader in readers]
    same_end = same_loads and _equal(*ends)
    heads = ["", *LETTERS, "B against A"]
    rows = [["method", *(escape(reader.summary.method) for reader in readers), ""]]
    for quantity in (*QUANTITIES, *bolts(readers)):
        known = [quantity.of(reader) for reader in readers]
        if known == [None, None]:
            continue
        units = [reader.summary.units.get(quantity.unit, "") for reader in readers]
        cells = [
            "–" if one is None else f"{quantity.shown(one)} {escape(unit)}".rstrip()
            for one, unit in zip(known, units, strict=True)
        ]
        comparable = (same_units or not quantity.unit) and (same_loads or not quantity.is_load)
        comparable &= same_end or not quantity.at_end
        rows.append([quantity.words, *cells, _difference(*known) if comparable else "–"])
    note = (
        "<p>Differences are relative to A. A dash – marks a number that a run lacks "
        "or that cannot be compared, such as displacements of last levels at "
        "different ζ. The limit load of a mesh is an estimate; a proven bound holds for the "
        "bodies.</p>"
    )
    return table(heads, rows) + note


def _equal(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) <= ROUNDING * max(abs(a), abs(b))


def _difference(a: float | None, b: float | None) -> str:
    if a is None or b is None:
        return "–"
    if _equal(a, b):
        return "the same"
    if not a:
        return "–"
    change = (b - a) / abs(a)
    return f"{100 * change:+.3g} %".replace("-", "−")


def _pictures(readers: Sequence[ResultReader]) -> str:
    """Return the stored pictures; each is beside or above the picture of the other run."""
    text = ""
    for figure in figures():
        words, files = figure.title, [reader.path / figure.file for reader in readers]
        if not any(file.is_file() for file in files):
            continue
        both = "".join(map(_figure, LETTERS, files, [words] * 2))
        way = "above" if figure.wide else "beside"
        text += f'<h3>{escape(words)}</h3><div class="{way}">{both}</div>'
    return text


def _figure(letter: str, file: Path, words: str) -> str:
    if not file.is_file():
        return f"<figure><figcaption>{letter} has no such picture.</figcaption></figure>"
    return (
        f"<figure>{image(file, f'{words} of {letter}')}<figcaption>{letter}</figcaption></figure>"
    )


def _cases(readers: Sequence[ResultReader]) -> str:
    """Return the lines that only one of the two case files contains."""
    cases = [reader.summary.case for reader in readers]
    if not all(cases):
        return (
            "<p>A Python program made at least one of the runs, so there are not two case "
            "files.</p>"
        )
    texts = [case["text"].splitlines() for case in cases]
    if texts[0] == texts[1]:
        return "<p>There are no differences: the case files are equal.</p>"
    a, b = (f"{letter}: {case['file']}" for letter, case in zip(LETTERS, cases, strict=True))
    lines = difflib.unified_diff(texts[0], texts[1], a, b, n=2, lineterm="")
    told = escape("\n".join(lines))
    return (
        f"<p>Lines with − are only in A, lines with + only in B.</p><pre><code>{told}</code></pre>"
    )


def _meaning(reader: ResultReader) -> str:
    return CaseWords.of(reader.summary).meaning(reader.scene.driven)


def _units(reader: ResultReader) -> str:
    units = reader.summary.units
    return ", ".join(units[kind] for kind in ("length", "force", "stress") if units.get(kind))


def _began(reader: ResultReader) -> str:
    began = reader.summary.surroundings.get("began", "")
    return f", {began}" if began else ""


def _section(name: str, head: str, text: str) -> str:
    if not text:
        return ""
    heading = f'<h2 id="{name}-h">{head}</h2>'
    return f'<section id="{name}" aria-labelledby="{name}-h">{heading}{text}</section>'
