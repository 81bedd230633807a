"""Build the report page: fill the template with its parts, and embed style sheets and scripts."""

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
"""Pattern of the options with which a solver registers its own numbered prefix."""


def command_of(summary: Summary) -> str:
    """Return the shell command of the run; empty if a Python program made the run."""
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
"""Script files of the view, in the order in which the browser reads them."""


def page_of(reader: ResultReader, view: View, running: str = "") -> str:
    """Return the HTML of a report.

    Args:
        reader: The results.
        view: Data for the view of the bodies.
        running: HTML about a run in progress, placed above the verdict.

    Raises:
        InputError: If a result file cannot be read, or claims a bound that it does not prove.
    """
    summary, scene = reader.summary, reader.scene
    proofs = proofs_of(reader)
    words = CaseWords.of(summary)
    title = scene.title or "A run"
    sections = {
        "verdict": _verdict(verdict_on(reader), words.meaning(scene.driven)),
        "combinations": _combinations(reader),
        "warnings": _warnings(summary),
        "bodies": _section("bodies", "The bodies", _view(reader, view)),
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
"""Keys of [report] whose presence adds signature lines."""


def head_of(summary: Summary) -> str:
    """Return the data of [report] and the date of the run; empty if there is no [report]."""
    rows = [(key.capitalize(), text) for key, text in summary.report.items() if key not in SIGNED]
    began = summary.surroundings.get("began", "")
    return pairs([*rows, ("Date", began)] if rows and began else rows)


def signatures(head: Mapping[str, str]) -> str:
    """Return a table with signature lines; empty if [report] has no key of :data:`HANDED_IN`."""
    if not any(key in head for key in HANDED_IN):
        return ""
    rows = [[key.capitalize(), escape(head.get(key, "")), "", ""] for key in SIGNED]
    signed = table(["", "name", "date", "signature"], rows)
    return f'<section id="signatures" aria-label="Signatures">{signed}</section>'


HEADING = re.compile(r'<h2 id="([a-z]+)-h">(.*?)</h2>')


def contents_of(body: str) -> str:
    """Return links to all sections, which appear only in print."""
    links = "".join(
        f'<li><a href="#{name}">{head}</a></li>' for name, head in HEADING.findall(body)
    )
    return f'<nav class="contents" aria-label="Contents"><h2>Contents</h2><ol>{links}</ol></nav>'


def _proof(reader: ResultReader, proofs: Proofs, view: View) -> str:
    """Return the section on the proof files, and the checker that runs in the browser."""
    paths = [reader.path / name for name in (PROOF, LEAST, STANDS, FALLS) if name in proofs]
    room = ROOM - size_of(view.data)
    return proof_section(reader.path, proofs) + prove_again(paths, room)


def _verdict(verdict: Verdict, meaning: str) -> str:
    marks = {
        "proven": ("✓", "Proven for the bodies"),
        "one-sided": ("◐", "One bound is proven for the bodies"),
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
    """Return a sentence in which load factors are protected against line breaks."""
    return escape(text).replace("ζ = ", "ζ&nbsp;=&nbsp;").replace(" %", "&nbsp;%")


NO_VIEW = "The bodies cannot be shown here: this needs a browser with scripts and WebGL 2."
"""Sentence in place of the view of the bodies; the script of the view replaces or removes it."""


def _view(reader: ResultReader, view: View) -> str:
    """Return the view of the bodies, with a still picture for browsers that cannot show it."""
    remarks = "".join(f"<p>{escape(text)}</p>" for text in view.remarks)
    if view.data is None:
        return remarks
    picture = _picture(reader, "mechanism.png") or _picture(reader, "fields.png")
    still = f'<div id="still"><p id="still-words">{NO_VIEW}</p>{picture}</div>'
    hidden = "<noscript><style>#view { display: none; }</style></noscript>"
    return remarks + still + hidden + asset("view.html")


def _picture(reader: ResultReader, name: str) -> str:
    """Return a stored picture with its caption; "" if the folder does not contain it."""
    title = next(figure.title for figure in figures() if figure.file == name)
    file = reader.path / name
    return captioned(image(file, title), title) if file.is_file() else ""


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
        "<p>Three conditions check each solved step again. <b>Energy</b>: no other state has less "
        "energy. <b>Forces</b>: all forces balance. <b>Contact</b>: bodies push only where they "
        f"touch. {good.sign} {good.word}: the relative residual is at most {TIGHT:.0e}; "
        f"{fair.sign} {fair.word}: it is at most {CREDIBLE:.0e}.</p>"
    )
    return _section("levels", "Levels", table + note)


def _meshes(summary: Summary) -> str:
    """Return the section with the bounds on each mesh; empty if there are not several meshes."""
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
    heads = ["mesh", "cells", "carried", "collapsed", "gap of the best bounds so far"]
    note = (
        "<p>These are the bounds at the time when each mesh was solved. The verdict gives the"
        " best bounds, which the checker has proven.</p>"
    )
    return _section("meshes", "Meshes", note + table(heads, rows))


def _water(reader: ResultReader) -> str:
    """Return the section on seepage: discharges, and the picture."""
    flow = reader.summary.seepage
    if flow is None:
        return ""
    rows = [
        [escape(name), f"{max(discharge, 0.0):.5g}", f"{max(0.0, -discharge):.5g}"]
        for name, discharge in flow["discharges"].items()
    ]
    unit = reader.summary.units.get("stress", "")
    note = (
        f"<p>Largest pore pressure {flow['largest_pressure']:.5g} {escape(unit)}. Inflow "
        f"and outflow differ by {flow['imbalance']:.1e} of the discharge. Proofs use the "
        "pressure as given data.</p>"
    )
    figure = next(figure for figure in FIGURES if figure.file == "seepage.png")
    picture = _picture(reader, figure.file)
    volume = f"{reader.summary.units.get('volume', '')} per unit of time".lstrip()
    heads = ["surface", f"inflow ({volume})", f"outflow ({volume})"]
    return _section("water", figure.title, table(heads, rows) + note + picture)


def _pictures(reader: ResultReader) -> str:
    """Return the pictures that installed packages add; the page draws the built-in data itself."""
    added = [figure for figure in figures() if figure not in FIGURES]
    shown = [
        f"<h3>{escape(figure.title)}</h3>{picture}"
        for figure in added
        if (picture := _picture(reader, figure.file))
    ]
    return _section("pictures", "More pictures", "".join(shown))


def _reactions(reader: ResultReader) -> str:
    steps = [step for step in reader.summary.steps if step["converged"]]
    if not steps or not steps[-1]["reactions"]:
        return ""
    last, model = steps[-1], reader.summary.model
    if ((reader.summary.limit or {}).get("forces") or {}).get("zeta") == last["zeta"]:
        return ""  # a limit load has its own table
    table = reaction_table(last["reactions"], model["axes"], reader.summary.units.get("force", ""))
    of = f", {model['forces']}" if model["forces"] else ""
    note = f"<p>At the last solved step, ζ = {last['zeta']:.6g}{escape(of)}.</p>"
    return _section("reactions", "Forces", note + table)


def _bolts(reader: ResultReader) -> str:
    table = bolt_table(reader.reports, reader.summary.units.get("force", ""))
    note = (
        "<p>Tension in each shank. Bolts are tightened to their preloads before any load acts; "
        "then the shortening of their shanks is constant. While a joint is closed, a bolt carries "
        "a share of the load in addition to its preload. After the joint opens, it carries only "
        "the load. <b>Preloads do not change the limit load</b> of perfectly plastic bodies, but "
        "they change forces, gaps and stiffness below it.</p>"
    )
    return _section("bolts", "Forces of bolts", table and table + note)


def _limit_forces(reader: ResultReader) -> str:
    """Return the forces and moments of loads and supports at the limit load."""
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
            f"<p>Forces of supports and contacts belong to the stress that {whose}. If "
            "several distributions of a force balance the loads, the table shows one.</p>"
        )
    return _section("loads", "Forces and moments", text)


def _combinations(reader: ResultReader) -> str:
    """Return the table of all load combinations, the worst first; empty if there are none."""
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
        "<p>Each row lists the factor, ζ or F, with which the bodies certainly stand, and the "
        "factor with which they certainly collapse.</p>"
    )
    return _section("combinations", "All combinations", table(heads, shown) + note)


def _warnings(summary: Summary) -> str:
    """Return the section with the program's warnings and remarks."""
    told = [*summary.warnings, *summary.remarks]
    items = "".join(f"<li>{escape(text[:1].upper() + text[1:].rstrip('.'))}.</li>" for text in told)
    return _section("warnings", "Notes on this run", f"<ul>{items}</ul>" if items else "")


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
    """Return the size of the mesh; for several meshes, of the last and the first one."""
    mesh, degree = summary.mesh, summary.given.get("degree")
    elements = "" if degree is None else f", elements of degree {degree}"
    size = f"{mesh['cells']} cells, {mesh['vertices']} vertices, {mesh['dofs']} unknowns"
    limit = summary.limit or {}
    of_bounds = [one["cells"] for one in (limit.get("body") or {}).get("meshes", [])]
    cells = (limit.get("strength") or {}).get("cells") or of_bounds
    if len(cells) < 2:
        return f"{size}{elements}"
    last = f"{cells[-1]} cells, the last of {len(cells)} meshes{elements}"
    return f"{last}; the first mesh: {size}"


def _again(summary: Summary) -> str:
    case, timings = summary.case, summary.timings
    versions = ", ".join(f"{a} {b}" for a, b in summary.surroundings.get("versions", {}).items())
    rows = [
        ("Method", summary.method),
        ("Date", summary.surroundings.get("began", "")),
        ("Processes", str(summary.ranks)),
        ("Time", f"{timings.get('total', sum(timings.values())):.1f} s"),
        ("Memory", f"{summary.peak_memory_mb:.0f} MiB in total"),
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
