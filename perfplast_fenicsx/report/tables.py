"""Build the tables of the page: levels with grades, forces, and pairs of name and description."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.rounding import without_rounding
from perfplast_fenicsx.solvers.verdicts import CREDIBLE

TIGHT = 1e-6
"""Largest certificate for which a condition counts as satisfied for engineering purposes."""


@dataclass(frozen=True)
class Grade:
    """A grade of a condition: a sign, a word, and the CSS class of its colour."""

    sign: str
    word: str
    style: str


GRADES = (Grade("✓", "met", "good"), Grade("≈", "nearly", "fair"), Grade("✗", "not met", "bad"))


def grade(certificate: float) -> Grade:
    """Return the grade of a certificate: a residual that is 0 at a solution."""
    size = abs(certificate)
    return GRADES[0] if size <= TIGHT else GRADES[1] if size <= CREDIBLE else GRADES[2]


def judged(certificate: float) -> str:
    """Return a certificate as HTML: its grade and its number."""
    found = grade(certificate)
    return (
        f'<span class="mark {found.style}"><span aria-hidden="true">{found.sign}</span>'
        f" {found.word}</span> <small>{abs(certificate):.0e}</small>"
    )


def level_table(
    reports: Sequence[LevelReport], driven: bool, unit_of_work: str = "", unit_of_length: str = ""
) -> str:
    """Return a table with a row for each level; column heads have known units in brackets."""
    staged = any(report.stage for report in reports)
    rubs = any(report.friction_dissipation or report.slipping for report in reports)
    heads = ["step", *(["stage"] if staged else []), "ζ", "driving force" if driven else "work α"]
    heads[-1] += _bracket("" if driven else unit_of_work)
    heads += ["plastic", "closed contacts", f"largest displacement{_bracket(unit_of_length)}"]
    heads += ["solved", "energy", "forces"]
    heads += ["contact", *(["friction"] if rubs else []), "seconds"]
    rows = []
    for number, report in enumerate(reports, start=1):
        found = report.driving_force if driven else report.alpha
        cells = [str(number), *([escape(report.stage or "start")] if staged else [])]
        cells += [f"{report.zeta:.6g}", f"{found:.6g}", f"{report.plastic_fraction:.1%}"]
        cells += [f"{report.active_contacts} of {report.contact_pairs}"]
        cells += [f"{report.max_displacement:.4g}"]
        if report.converged:
            cells += ['<span class="mark good"><span aria-hidden="true">✓</span> yes</span>']
            cells += [judged(report.duality_gap), judged(report.equilibrium)]
            cells += [judged(report.complementarity)]
            cells += [judged(report.friction_excess)] if rubs else []
        else:
            no = '<span class="mark bad"><span aria-hidden="true">✗</span> no solution</span>'
            cells += [no, *["–"] * (4 if rubs else 3)]
        rows.append([*cells, f"{report.seconds:.2f}"])
    return table(heads, rows)


def reaction_table(reactions: Mapping[str, Sequence[float]], axes: str, unit: str) -> str:
    """Return a table with a row for each load, support, obstacle and contact."""
    heads = ["force on the bodies from", *(f"{axis}{_bracket(unit)}" for axis in axes)]
    shown = without_rounding(list(reactions.values()))
    rows = [
        [escape(name), *(f"{force:.6g}" for force in forces)]
        for name, forces in zip(reactions, shown, strict=True)
    ]
    return table(heads, rows)


def bolt_table(reports: Sequence[LevelReport], unit: str) -> str:
    """Return a table of bolt forces with a row for each solved level; "" if there are no bolts."""
    solved = [(n, report) for n, report in enumerate(reports, 1) if report.converged]
    if not solved or not solved[0][1].bolts:
        return ""
    names = list(solved[0][1].bolts)
    heads = ["step", "ζ", *(f"{escape(name)}{_bracket(unit)}" for name in names)]
    rows = [
        [str(n), f"{report.zeta:.6g}", *(f"{report.bolts[name]:.6g}" for name in names)]
        for n, report in solved
    ]
    return table(heads, rows)


def force_table(what: str, axes: str, unit: str, rows: Sequence[tuple[str, list[float]]]) -> str:
    """Return a table with a row for each force or moment of :func:`outcome_words.force_rows`."""
    heads = [what, *(f"{axis}{_bracket(unit)}" for axis in axes)]
    cells = [[escape(name), *(f"{number:.6g}" for number in row)] for name, row in rows]
    return table(heads, cells)


def _bracket(unit: str) -> str:
    return f" ({escape(unit).replace(' ', '&nbsp;')})" if unit else ""


def pairs(rows: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and their descriptions."""
    items = "".join(f"<div><dt>{escape(a)}</dt><dd>{escape(b)}</dd></div>" for a, b in rows)
    return f"<dl>{items}</dl>" if items else ""


def table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table that scrolls sideways on a narrow page; its cells are HTML."""
    body = "".join(
        f'<tr><th scope="row">{row[0]}</th>{"".join(f"<td>{cell}</td>" for cell in row[1:])}</tr>'
        for row in rows
    )
    return scrolled(heads, body)


def scrolled(heads: Sequence[str], rows: str, name: str = "") -> str:
    """Return a table that scrolls sideways on a narrow page.

    Args:
        heads: HTML of the column headings.
        rows: HTML of the rows.
        name: Name of the table for screen readers; "" for no name.
    """
    head = "".join(f'<th scope="col">{words}</th>' for words in heads)
    label = escape(f"{name}: table" if name else "table") + ", which scrolls sideways"
    named = f' aria-label="{escape(name)}"' if name else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{label}">'
        f"<table{named}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def image(file: Path, words: str) -> str:
    """Return an <img> element that contains a PNG file, with an alternative text.

    Raises:
        InputError: If the file cannot be read.
    """
    try:
        data = base64.b64encode(file.read_bytes()).decode()
    except OSError as error:
        raise InputError(f"'{file}' cannot be read ({error.strerror}); draw it again.") from error
    return f'<img src="data:image/png;base64,{data}" alt="{escape(words)}">'


def captioned(picture: str, words: str) -> str:
    """Return a figure with a caption; the style sheet of the page numbers all figures.

    Args:
        picture: HTML of the picture.
        words: HTML of the caption.
    """
    return f"<figure>{picture}<figcaption>{words}</figcaption></figure>"
