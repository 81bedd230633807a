"""Make the reference of case files from the dataclasses that read them.

Sphinx replaces :data:`MARK` in ``case_file.md`` with the reference. Keys, types and defaults come
from the dataclasses. Meanings and ranges come from the ``Args`` of their docstrings.
"""

import dataclasses
import inspect
import re
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from docs.marks import replace_mark
from perfplast_fenicsx import docstrings
from perfplast_fenicsx.contact.declared.contact import INTERFACES, Tie
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.geometry.drawn_ground import DrawnLine, Region, Stratum
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, NamedFace
from perfplast_fenicsx.io.case import support_tables, tables
from perfplast_fenicsx.io.case.combinations import Combination, DesignTable
from perfplast_fenicsx.io.case.gravity_table import EarthquakeTable, GravityTable
from perfplast_fenicsx.io.case.load_table import load_table
from perfplast_fenicsx.io.case.mesh_table import GeometryFile
from perfplast_fenicsx.io.case.schema import described, shown
from perfplast_fenicsx.io.case.water_table import WaterTable
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.conic.conic_solver import CONIC, SOLVERS, USUAL
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.mesh.sample_meshes import BUILDERS
from perfplast_fenicsx.problem.declared.initial import Bolt, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.seepage.declared import Head, Seepage
from perfplast_fenicsx.solvers.methods import METHODS
from perfplast_fenicsx.units import Units

MARK = "<!-- the tables, from the program -->"

HEAD = "| key | type | default | meaning |\n|---|---|---|---|\n"


def arguments(documented: object) -> dict[str, str]:
    """Return the ``Args`` of a docstring by name, each on one line, in Markdown."""
    module = inspect.getmodule(documented)
    return {name: markdown(text, module) for name, text in docstrings.arguments(documented).items()}


def summary(documented: object) -> str:
    """Return the text of a docstring before its first section, in Markdown."""
    text = docstrings.summary(documented)
    return re.sub(r"\s*\bCollective\.", "", markdown(text, inspect.getmodule(documented)))


def markdown(text: str, module: object = None) -> str:
    """Return reStructuredText as MyST; roles without a module refer to ``module``."""

    def role(match: re.Match[str]) -> str:
        kind, target = match.groups()
        if "." not in target and inspect.ismodule(module):
            return f"{{py:{kind}}}`{target} <{module.__name__}.{target}>`"
        return f"{{py:{kind}}}`{target}`"

    return re.sub(r":(\w+):`([^`]+)`", role, text.replace("``", "`"))


def row(key: str, kind: str, default: str, meaning: str) -> str:
    """Return a row of a table, with escaped bars."""
    cells = (f"`{key}`", kind, default, meaning)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def rows(schema: type[Any], leave_out: frozenset[str] = frozenset()) -> str:
    """Return the keys of a dataclass as rows of a table."""
    hints = typing.get_type_hints(schema)
    meaning = arguments(schema)
    lines = ""
    for field in dataclasses.fields(schema):
        if field.name in leave_out:
            continue
        kind = _type(hints[field.name], field.name)
        lines += row(field.name, kind, _default(field), meaning[field.name])
    return lines


def _type(hint: Any, key: str) -> str:
    """Return a type in the words of the program's messages, with the quotes of TOML."""
    return re.sub(r"'([^']*)'", r'`"\1"`', described(hint, key))


def _default(field: "dataclasses.Field[Any]") -> str:
    if field.default is None:
        return "none"
    if field.default is not dataclasses.MISSING:
        return f"`{shown(field.default)}`".replace("'", '"')
    return "required" if field.default_factory is dataclasses.MISSING else "none"


def _parameters(builder: Callable[..., Any]) -> str:
    """Return the arguments of a builder as rows of a table."""
    meaning = arguments(builder)
    lines = ""
    for name, parameter in list(inspect.signature(builder).parameters.items())[1:]:
        required = parameter.default is inspect.Parameter.empty
        default = "required" if required else f"`{list(parameter.default)}`"
        lines += row(name, _type(parameter.annotation, name), default, meaning[name])
    return lines


def _choice(key: str, choices: Mapping[str, object], default: str | None, meaning: str) -> str:
    """Return the row for the key that selects one of several tables."""
    kinds = " or ".join(f'`"{choice}"`' for choice in choices)
    return row(key, kinds, f'`"{default}"`' if default else "required", meaning)


def _variants(key: str, choices: Mapping[str, type[Any]]) -> Iterator[str]:
    """Yield a table for each choice; choices with the same dataclass share one table."""
    for schema in dict.fromkeys(choices.values()):
        names = [name for name, other in choices.items() if other is schema]
        wanted = " or ".join(f'`"{name}"`' for name in names)
        yield f"**`{key} =` {wanted}.** {summary(schema)}\n\n{HEAD}{rows(schema)}"


def _mesh() -> Iterator[str]:
    yield f"Give either a file or a builder.\n\n**`file`.** {summary(tables.MeshFile)}\n"
    yield HEAD + rows(tables.MeshFile)
    yield f"**`builder`.** {summary(tables.MeshBuilder)}\n"
    meaning = arguments(tables.MeshBuilder)
    yield (
        HEAD
        + _choice("builder", BUILDERS, None, meaning["builder"])
        + row("...", "see below", "", meaning["arguments"])
        + row("adapt", "a table", "none", meaning["adapt"])
    )
    for name, builder in BUILDERS.items():
        yield f'**`builder = "{name}"`.** {summary(builder)}\n\n{HEAD}{_parameters(builder)}'
    yield f"**`adapt`.** {summary(Adaptation)}\n\n{HEAD}{rows(Adaptation)}"


def _geometry() -> Iterator[str]:
    yield f"{summary(GeometryFile)}\n"
    yield "With `[[region]]` or `[[stratum]]` there is no `file`; the other keys are the same.\n"
    meaning = arguments(GeometryFile)
    yield HEAD + row("file", "a string", "required", meaning["file"]) + rows(MeshingOptions)
    yield f"**`[[geometry.face]]`.** {summary(NamedFace)}\n\n{HEAD}{rows(NamedFace)}"


def _seepage() -> Iterator[str]:
    yield f"{summary(Seepage)}\n"
    yield HEAD + rows(Seepage)
    yield f"**`[[seepage.head]]`.** {summary(Head)}\n\n{HEAD}{rows(Head)}"


def _solve() -> Iterator[str]:
    yield HEAD + _choice(
        "method",
        METHODS,
        None,
        "The algorithm; by default ALG1 if loads are prescribed, and ALG3 if works are prescribed.",
    ).replace("required", "see right")
    kinds = " or ".join(f'`"{name}"`' for name in SOLVERS)
    yield row("conic", kinds, f'`"{USUAL}"`', CONIC)
    yield from _variants("method", {name: entry.options for name, entry in METHODS.items()})


def _single(schema: type[Any]) -> Callable[[], Iterator[str]]:
    """Return a function that yields the content of a table that one dataclass reads."""
    return lambda: iter([summary(schema) + "\n", HEAD + rows(schema)])


def _chosen(
    key: str, choices: Mapping[str, type[Any]], default: str | None, meaning: str
) -> Callable[[], Iterator[str]]:
    """Return a function that yields the content of a table whose ``key`` selects the dataclass."""
    return lambda: iter([HEAD + _choice(key, choices, default, meaning), *_variants(key, choices)])


SECTIONS: dict[str, tuple[str, Callable[[], Iterator[str]]]] = {
    "mesh": ("[mesh]", _mesh),
    "geometry": ("[geometry]", _geometry),
    "region": ("[[region]]", _single(Region)),
    "stratum": ("[[stratum]]", _single(Stratum)),
    "line": ("[[line]]", _single(DrawnLine)),
    "material": (
        "[material.NAME]",
        _chosen("law", MATERIALS, None, "The law of the body."),
    ),
    "support": ("[[support]]", _single(support_tables.SupportTable)),
    "load": ("[[load]]", _single(load_table())),
    "gravity": ("[gravity]", _single(GravityTable)),
    "earthquake": ("[earthquake]", _single(EarthquakeTable)),
    "water": ("[water]", _single(WaterTable)),
    "seepage": ("[seepage]", _seepage),
    "combination": ("[[combination]]", _single(Combination)),
    "design": ("[design]", _single(DesignTable)),
    "temperature": ("[[temperature]]", _single(Temperature)),
    "initial_stress": ("[[initial_stress]]", _single(InitialStress)),
    "bolt": ("[[bolt]]", _single(Bolt)),
    "contact": (
        "[[contact]]",
        _chosen("interface", INTERFACES, "friction", "The kind of interface between the surfaces."),
    ),
    "obstacle": ("[[obstacle]]", _chosen("shape", OBSTACLES, None, "The shape of the obstacle.")),
    "rigid_surface": ("[[rigid_surface]]", _single(support_tables.RigidSurfaceTable)),
    "tie": ("[[tie]]", _single(Tie)),
    "model": ("[model]", _single(tables.ModelOptions)),
    "element": ("[element]", _single(tables.ElementOptions)),
    "solve": ("[solve]", _solve),
    "loading": (
        "[loading]",
        _chosen("control", CONTROLS, "load", "The quantity that the run prescribes or computes."),
    ),
    "stage": ("[[stage]]", _single(Stage)),
    "output": ("[output]", _single(tables.OutputOptions)),
    "report": ("[report]", _single(tables.ReportHead)),
    "units": ("[units]", _single(Units)),
}
"""Heading and content of each table of a case file, by its key at the top level."""


def reference() -> str:
    """Return the whole reference as MyST."""
    scalars = frozenset(SECTIONS)
    text = f"## Top level\n\n{HEAD}{rows(tables.Document, leave_out=scalars)}"
    meaning = arguments(tables.Document)
    for key, (heading, content) in SECTIONS.items():
        text += f"\n## `{heading}`\n\n{meaning[key]}\n\n" + "\n".join(content())
    return text


def setup(app: Any) -> dict[str, bool]:
    """Insert the reference where a page has :data:`MARK`; Sphinx calls this function."""
    return replace_mark(app, MARK, reference)
