"""Build the page: put its parts into the template, with style and scripts inlined."""

import re
import shlex
from collections.abc import Mapping
from html import escape
from string import Template

from perfplast_fenicsx.io.results.claims import Proofs
from perfplast_fenicsx.io.results.combination_table import as_cells, read_table
from perfplast_fenicsx.io.results.result_files import FALLS, FIGURES, LEAST, PROOF, STANDS, figures
from perfplast_fenicsx.io.results.summary import Summary
from perfplast_fenicsx.outcome_words import force_rows, percent
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.case_words import MODELS, CaseWords
from perfplast_fenicsx.report.curve import NARROW, curve_of, to_svg
from perfplast_fenicsx.report.frame import WORKERS, asset, framed, scripts_of
from perfplast_fenicsx.report.packing import size_of
from perfplast_fenicsx.report.proof_again import prove_again
from perfplast_fenicsx.report.proof_section import proof_section, proofs_of
from perfplast_fenicsx.report.tables import (
    GRADES,
    TIGHT,
    bolt_table,
    captioned,
    force_table,
    image,
    level_table,
    pairs,
    reaction_table,
    table,
)
from perfplast_fenicsx.report.verdict import Verdict, verdict_on
from perfplast_fenicsx.report.view_data import ROOM, View
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.solvers.verdicts import CREDIBLE

OF_SOLVERS = re.compile(r"-perfplast_([a-z]+_)?\d+_\S+ \S+ ?")
"""Options that solvers set for themselves, each with its own number."""


def command_of(summary: Summary) -> str:
    """Return the shell command; empty if a Python program made the run."""
    if not summary.case:
        return ""
    launch = f"mpirun -n {summary.ranks} " if summary.ranks > 1 else ""
    words = ["perfplast", "run", summary.case["file"], "-o", "results"]
    command = summary.surroundings.get("command") or shlex.join(words)
    options = OF_SOLVERS.sub("", summary.surroundings.get("petsc_options", "")).strip()
    return launch + command + (f" -- {options}" if options else "")


VIEW = (
    *("decode", "camera", "shaders", "colours", "drawing", "viewer", "sides"),
    *("gestures", "controls"),
)
"""Files of the view, in reading order."""


def page_of(reader: ResultReader, view: View, running: str = "") -> str:
    """Return the HTML of a report.

    Args:
        reader: The results.
        view: View of the bodies.
        running: HTML above the verdict, about a run in progress.

    Raises:
        InputError: If a file of the results cannot be read, or claims a bound that it does not
            prove.
    """
    summary, scene = reader.summary, reader.scene
    proofs = proofs_of(reader)
    found = summary.limit or {}
    several = bool(found.get("envelope") or found.get("shakedown"))
    staged = any(step.get("stage") for step in summary.steps)
    words = CaseWords(summary.given, summary.units, summary.model["axes"], staged)
    title = scene.title or "A run"
    sections = {
        "verdict": _verdict(verdict_on(reader), words.meaning(scene.driven, several)),
        "combinations": _combinations(reader),
        "warnings": _warnings(summary),
        "bodies": _section("bodies", "The bodies", _view(view)),
        "curve": _curve(reader),
        "levels": _water(reader) + _levels(reader) + _meshes(summary) + _pictures(reader),
        "reactions": _limit_forces(reader) + _reactions(reader) + _bolts(reader),
        "proof": _section("proof", "The proof", _proof(reader, proofs, view)),
        "case": _case(summary, words),
        "again": _again(summary),
    }
    body = Template(asset("page.html")).substitute(
        sections,
        title=escape(title),
        head=head_of(summary) + signatures(summary.report),
        running=running,
        contents=contents_of("".join(sections.values())),
        version=escape(summary.version),
        scripts=scripts_of(view.data, VIEW),
    )
    return framed(body, title, ["page.css"], WORKERS)


SIGNED = ("prepared", "checked", "approved")
"""Keys of [report] with the names of the persons who sign."""

HANDED_IN = ("client", "revision", *SIGNED)
"""Keys of [report] that ask for lines to sign."""


def head_of(summary: Summary) -> str:
    """Return the document data of [report] with the date of the run; empty without [report]."""
    rows = [(key.capitalize(), text) for key, text in summary.report.items() if key not in SIGNED]
    began = summary.surroundings.get("began", "")
    return pairs([*rows, ("Date", began)] if rows and began else rows)


def signatures(head: Mapping[str, str]) -> str:
    """Return a table with a signature line for each person; empty if [report] names no one."""
    if not any(key in head for key in HANDED_IN):
        return ""
    rows = [[key.capitalize(), escape(head.get(key, "")), "", ""] for key in SIGNED]
    signed = table(["", "name", "date", "signature"], rows)
    return f'<section id="signatures" aria-label="Signatures">{signed}</section>'


HEADING = re.compile(r'<h2 id="([a-z]+)-h">(.*?)</h2>')


def contents_of(body: str) -> str:
    """Return links to all sections, shown when the page is printed."""
    links = "".join(
        f'<li><a href="#{name}">{head}</a></li>' for name, head in HEADING.findall(body)
    )
    return f'<nav class="contents" aria-label="Contents"><h2>Contents</h2><ol>{links}</ol></nav>'


def _proof(reader: ResultReader, proofs: Proofs, view: View) -> str:
    """Return the section on the proof files, with the checker in the browser."""
    paths = [reader.path / name for name in (PROOF, LEAST, STANDS, FALLS) if name in proofs]
    room = ROOM - size_of(view.data)
    return proof_section(reader.path, proofs) + prove_again(paths, room)


def _verdict(verdict: Verdict, meaning: str) -> str:
    marks = {
        "proven": ("✓", "Proven of the bodies"),
        "one-sided": ("◐", "One bound is proven of the bodies"),
        "found": ("●", "Found on this mesh"),
        "open": ("!", "Open"),
    }
    sign, word = marks[verdict.mark]
    details = "".join(f"<p>{_words(text)}</p>" for text in (meaning, *verdict.details) if text)
    return (
        f'<section id="verdict" class="{verdict.mark}" aria-label="Verdict">'
        f'<p class="badge"><span aria-hidden="true">{sign}</span> {word}</p>'
        f'<p class="sentence">{_words(verdict.sentence)}</p>{details}</section>'
    )


def _words(text: str) -> str:
    """Return a sentence with load factors protected against line breaks."""
    return escape(text).replace("ζ = ", "ζ&nbsp;=&nbsp;").replace(" %", "&nbsp;%")


def _view(view: View) -> str:
    remarks = "".join(f"<p>{escape(text)}</p>" for text in view.remarks)
    return remarks + (asset("view.html") if view.data is not None else "")


def _curve(reader: ResultReader) -> str:
    unit = reader.summary.units.get("work", "")
    curve = curve_of(reader.reports, reader.limit, reader.scene.driven, unit)
    if curve is None:
        return ""
    words = escape(f"{curve.y_label} over {curve.x_label}")
    return _section("curve", "The curve", captioned(to_svg(curve) + to_svg(curve, NARROW), words))


def _levels(reader: ResultReader) -> str:
    if not reader.reports:
        return ""
    good, fair, _ = GRADES
    units = [reader.summary.units.get(kind, "") for kind in ("work", "length")]
    table = level_table(reader.reports, reader.scene.driven, *units)
    note = (
        "<p>Each solved step is checked again: <b>energy</b>, that no other state has less;"
        " <b>forces</b>, that all are in balance; <b>contact</b>, that bodies push where they"
        f" touch and nowhere else. {good.sign} {good.word}: no more than {TIGHT:.0e} is missing,"
        f" in relation to the whole; {fair.sign} {fair.word}: no more than {CREDIBLE:.0e}.</p>"
    )
    return _section("levels", "Levels", table + note)


def _meshes(summary: Summary) -> str:
    """Return the bounds on each mesh, where there are several."""
    meshes = ((summary.limit or {}).get("body") or {}).get("meshes", [])
    if len(meshes) < 2:
        return ""
    none = "–"
    rows = [
        [
            str(number),
            str(mesh["cells"]),
            none if mesh["lower"] is None else rounded_down(mesh["lower"]),
            none if mesh["upper"] is None else rounded_up(mesh["upper"]),
            none if mesh["gap"] is None else percent(mesh["gap"]),
        ]
        for number, mesh in enumerate(meshes, start=1)
    ]
    heads = ["mesh", "cells", "carried", "collapsed", "best bounds so far apart"]
    note = (
        "<p>What each mesh gave when it was solved. The verdict has the best of all, which the"
        " checker has proven.</p>"
    )
    return _section("meshes", "Meshes", note + table(heads, rows))


def _water(reader: ResultReader) -> str:
    """Return the section on seepage: discharges, and the picture."""
    flow = reader.summary.seepage
    if flow is None:
        return ""
    rows = [
        [escape(name), f"{max(discharge, 0.0):.5g}", f"{max(-discharge, 0.0):.5g}"]
        for name, discharge in flow["discharges"].items()
    ]
    unit = reader.summary.units.get("stress", "")
    note = (
        f"<p>Largest pore pressure {flow['largest_pressure']:.5g} {escape(unit)}. Inflow "
        f"and outflow differ by {flow['imbalance']:.1e} of the discharge. Proofs take the "
        "pressure as data.</p>"
    )
    figure = next(figure for figure in FIGURES if figure.file == "seepage.png")
    file = reader.path / figure.file
    picture = captioned(image(file, figure.title), figure.title) if file.is_file() else ""
    heads = ["surface", "enters per unit of time", "leaves"]
    return _section("water", figure.title, table(heads, rows) + note + picture)


def _pictures(reader: ResultReader) -> str:
    """Return the pictures of installed packages; the page draws the other data itself."""
    added = [figure for figure in figures() if figure not in FIGURES]
    shown = [
        f"<h3>{escape(figure.title)}</h3>{captioned(image(file, figure.title), figure.title)}"
        for figure in added
        if (file := reader.path / figure.file).is_file()
    ]
    return _section("pictures", "More pictures", "".join(shown))


def _reactions(reader: ResultReader) -> str:
    steps = [step for step in reader.summary.steps if step["converged"]]
    if not steps or not steps[-1]["reactions"]:
        return ""
    last, model = steps[-1], reader.summary.model
    if ((reader.summary.limit or {}).get("forces") or {}).get("zeta") == last["zeta"]:
        return ""  # the limit load has its own table
    table = reaction_table(last["reactions"], model["axes"], reader.summary.units.get("force", ""))
    of = f", {model['forces']}" if model["forces"] else ""
    note = f"<p>At the last solved step, ζ = {last['zeta']:.6g}{escape(of)}.</p>"
    return _section("reactions", "Forces", note + table)


def _bolts(reader: ResultReader) -> str:
    table = bolt_table(reader.reports, reader.summary.units.get("force", ""))
    note = (
        "<p>Tension in each shank. Bolts are tightened to their preloads before any load "
        "acts, and then keep their length. While a joint is closed, a bolt carries a "
        "share of the load in addition to its preload; after the joint has opened, it "
        "carries only the load. <b>Preloads do not change the limit load</b> of perfectly "
        "plastic bodies, but they change forces, gaps and stiffness below it.</p>"
    )
    return _section("bolts", "Forces of bolts", table and table + note)


def _limit_forces(reader: ResultReader) -> str:
    """Return forces and moments of loads and supports at the limit load."""
    summary = reader.summary
    limit = summary.limit or {}
    body = limit.get("body") or {}
    known = (summary.loads, body.get("lower"), body.get("upper"), limit.get("forces"))
    forces, axes = force_rows(*known, zeta="ζ"), summary.model["axes"]
    if not limit or not forces:
        return ""
    units = [summary.units.get(kind, "") for kind in ("force", "moment")]
    text = force_table("force", axes, units[0], forces)
    moments = force_rows(*known, moments=True, zeta="ζ")
    if any(row for _, row in moments):
        about = "xyz" if len(axes) == 3 else "z"
        text += force_table("moment about the origin", about, units[1], moments)
    note = summary.model["forces"]
    text += f"<p>Forces and moments are {escape(note)}.</p>" if note else ""
    if found := limit.get("forces"):
        whose = "proves the lower bound" if found.get("strict") else "was found on the mesh"
        text += (
            f"<p>Forces of supports and contacts are those of the stress that {whose}; if "
            "they can share a force in several ways, this is one of them.</p>"
        )
    return _section("loads", "Forces and moments", text)


def _combinations(reader: ResultReader) -> str:
    """Return the table of all combinations that include this run, the worst first."""
    rows = read_table(reader.path.parent)
    name = reader.path.name
    if name not in [row["combination"] for row in rows]:
        return ""
    heads, *cells = as_cells(rows)
    shown = [[escape(text) for text in line] for line in cells]
    for line, row in zip(shown, rows, strict=True):
        if row["combination"] == name:
            line[0] += " (this page)"
    note = (
        "<p>For each: ζ that is carried for certain, and ζ at which it collapses for certain.</p>"
    )
    return _section("combinations", "All combinations", table(heads, shown) + note)


def _warnings(summary: Summary) -> str:
    """Return the section of the program's warnings and remarks."""
    told = [*summary.warnings, *summary.remarks]
    items = "".join(f"<li>{escape(text[:1].upper() + text[1:])}</li>" for text in told)
    return _section("warnings", "What to know of this run", f"<ul>{items}</ul>" if items else "")


def _case(summary: Summary, words: CaseWords) -> str:
    kind = summary.model["kind"]
    parts = [
        ("Bodies", words.bodies()),
        ("Supports", words.supports()),
        ("Loads", words.loads()),
        ("Contact", words.contacts()),
    ]
    text = pairs([("Model", MODELS.get(kind, kind)), ("Mesh", mesh_in_words(summary))])
    text += "".join(f"<h3>{head}</h3>{pairs(rows)}" for head, rows in parts if rows)
    limit = summary.limit or {}
    body = limit.get("body") or {}
    bounds = [body, limit.get("strength") or {}]
    proven = any(one.get(kind) is not None for one in bounds for kind in ("lower", "upper"))
    of_bodies = proven or bool(limit.get("envelope"))
    listed = words.assumptions(kind, body.get("taken", ()), of_bodies)
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in listed)
    return _section("case", "The case", text) + _section(
        "assumptions", "Assumptions", f"<ul>{items}</ul>"
    )


def mesh_in_words(summary: Summary) -> str:
    """Return the size of the mesh; of several meshes, that of the last one."""
    mesh, degree = summary.mesh, summary.given.get("degree")
    elements = "" if degree is None else f", elements of degree {degree}"
    size = f"{mesh['cells']} cells, {mesh['vertices']} vertices, {mesh['dofs']} unknowns"
    meshes = ((summary.limit or {}).get("body") or {}).get("meshes", [])
    if len(meshes) < 2:
        return f"{size}{elements}"
    last = f"{meshes[-1]['cells']} cells, the last of {len(meshes)} meshes{elements}"
    return f"{last}; the first one: {size}"


def _again(summary: Summary) -> str:
    case, timings = summary.case, summary.timings
    versions = ", ".join(f"{a} {b}" for a, b in summary.surroundings.get("versions", {}).items())
    rows = [
        ("Method", summary.method),
        ("Date", summary.surroundings.get("began", "")),
        ("Processes", str(summary.ranks)),
        ("Time", f"{timings.get('total', sum(timings.values())):.1f} s"),
        ("Memory", f"{summary.peak_memory_mb:.0f} MiB in all"),
        ("Versions", versions or f"perfplast {summary.version}"),
    ]
    command = command_of(summary)
    text = "<p>A Python program made this run; run that program again.</p>"
    if command:
        text = f"<p>To run it again:</p><pre><code>{escape(command)}</code></pre>"
    text += pairs([row for row in rows if row[1]])
    if case:
        name = escape(case["file"])
        file = f"<pre><code>{escape(case['text'])}</code></pre>"
        text += f"<details><summary>The case file {name}</summary>{file}</details>"
    return _section("again", "How it was computed", text)


def _section(name: str, head: str, text: str) -> str:
    if not text:
        return ""
    heading = f'<h2 id="{name}-h">{head}</h2>'
    return f'<section id="{name}" aria-labelledby="{name}-h">{heading}{text}</section>'
