"""Generate the JSON Schema of case files, which editors use to complete keys and mark faults.

The schema comes from the dataclasses that read a case (:mod:`schema`): their keys, types, defaults
and choices, and the ``Args`` of their docstrings as descriptions. The schema does not define which
keys may occur together; ``perfplast check`` tests this.
"""

import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from perfplast_fenicsx.contact.declared.contact import INTERFACES, Tie
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.docstrings import arguments, summary
from perfplast_fenicsx.geometry.drawn_ground import DrawnLine, Region, Stratum
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, NamedFace
from perfplast_fenicsx.io.case.combinations import Combination, DesignTable
from perfplast_fenicsx.io.case.gravity_table import EarthquakeTable, GravityTable
from perfplast_fenicsx.io.case.load_table import load_table
from perfplast_fenicsx.io.case.support_tables import RigidSurfaceTable, SupportTable
from perfplast_fenicsx.io.case.tables import (
    Document,
    ElementOptions,
    MeshBuilder,
    MeshFile,
    ModelOptions,
    OutputOptions,
    ReportHead,
)
from perfplast_fenicsx.io.case.water_table import WaterTable
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.conic.conic_solver import CONIC, SOLVERS, USUAL
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.mesh.sample_meshes import BUILDERS
from perfplast_fenicsx.problem.declared.initial import Bolt, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.seepage.declared import Head, Seepage
from perfplast_fenicsx.solvers.methods import METHODS
from perfplast_fenicsx.spatial_fields import SpatialField
from perfplast_fenicsx.units import Units

DIALECT = "http://json-schema.org/draft-07/schema#"
"""The version of JSON Schema that TOML editors support."""

Schema = dict[str, Any]

_SCALARS: dict[Any, Schema] = {
    float: {"type": "number"},
    int: {"type": "integer"},
    str: {"type": "string"},
    bool: {"type": "boolean"},
    SpatialField: {
        "anyOf": [
            {"type": "string"},
            {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
            {
                "type": "object",
                "properties": {"file": {"type": "string"}, "column": {"type": "string"}},
                "required": ["file", "column"],
                "additionalProperties": False,
            },
        ]
    },
}


def case_schema() -> Schema:
    """Return the schema of a whole case file."""
    meaning = arguments(Document)
    tables = _tables()
    properties: Schema = {}
    for field in dataclasses.fields(Document):
        content = tables.get(field.name) or _of_type(typing.get_type_hints(Document)[field.name])
        hint = typing.get_type_hints(Document)[field.name]
        if field.name == "material":
            content = {"type": "object", "additionalProperties": content}
        elif typing.get_origin(hint) is list:
            content = {"type": "array", "items": content}
        properties[field.name] = _told(content, meaning[field.name])
    return {
        "$schema": DIALECT,
        "title": "A case of perfplast_fenicsx",
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
        "required": ["material"],
        "allOf": [
            {"anyOf": [{"required": [key]} for key in ("mesh", "geometry", "region", "stratum")]},
            {"oneOf": [{"required": ["loading"]}, {"required": ["stage"]}]},
        ],
    }


def _tables() -> dict[str, Schema]:
    """Return the schemas of tables, or of the items of arrays, by top-level key."""
    return {
        "mesh": _mesh(),
        "geometry": _geometry(),
        "region": _table(Region),
        "stratum": _table(Stratum),
        "line": _table(DrawnLine),
        "material": _choice("law", MATERIALS),
        "support": _table(SupportTable),
        "load": _table(load_table()),
        "gravity": _table(GravityTable),
        "earthquake": _table(EarthquakeTable),
        "water": _table(WaterTable),
        "seepage": _seepage(),
        "combination": _table(Combination),
        "design": _table(DesignTable),
        "temperature": _table(Temperature),
        "initial_stress": _table(InitialStress),
        "bolt": _table(Bolt),
        "contact": _choice("interface", INTERFACES, default="friction"),
        "obstacle": _choice("shape", OBSTACLES),
        "tie": _table(Tie),
        "rigid_surface": _table(RigidSurfaceTable),
        "model": _table(ModelOptions),
        "element": _table(ElementOptions),
        "solve": _solve(),
        "loading": _choice("control", CONTROLS, default="load"),
        "stage": _table(Stage),
        "output": _table(OutputOptions),
        "report": _table(ReportHead),
        "units": _table(Units),
    }


def _of_type(hint: Any) -> Schema:
    """Return the schema for the annotation of a field."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALARS:
        return dict(_SCALARS[hint])
    if origin is Literal:
        return {"enum": list(inner)}
    if origin in (typing.Union, types.UnionType):
        known = [_of_type(one) for one in inner if one is not types.NoneType]
        return known[0] if len(known) == 1 else {"anyOf": known}
    if origin in (list, Sequence):
        return {"type": "array", "items": _of_type(inner[0])}
    if origin is dict:
        return {"type": "object", "additionalProperties": _of_type(inner[1])}
    if dataclasses.is_dataclass(hint):
        return _table(typing.cast(type[Any], hint))
    return {}


def _table(described: type[Any], own: Schema | None = None) -> Schema:
    """Return the schema for the table that a dataclass defines.

    Args:
        described: The dataclass.
        own: Schemas of fields whose annotation does not define the schema.
    """
    hints, meaning = typing.get_type_hints(described), arguments(described)
    properties: Schema = {}
    required = []
    for field in dataclasses.fields(described):
        content = (own or {}).get(field.name) or _of_type(hints[field.name])
        content = _told(content, meaning.get(field.name, ""))
        if isinstance(field.default, str | int | float):
            content["default"] = field.default
        elif field.default is field.default_factory is dataclasses.MISSING:
            required.append(field.name)
        properties[field.name] = content
    return _told(_object(properties, required), summary(described))


def _object(properties: Schema, required: Sequence[str]) -> Schema:
    """Return the schema of a table that has only the given keys."""
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return schema | ({"required": list(required)} if required else {})


def _told(schema: Schema, text: str) -> Schema:
    """Return a schema with a description, which is converted to plain text."""
    plain = re.sub(r":\w+:`[~.]?([^`]+)`", r"\1", text).replace("``", "'")
    plain = re.sub(r"\s+", " ", plain).replace(" Collective.", "").strip()
    return schema | ({"description": plain} if plain else {})


def _choice(
    key: str, choices: Mapping[str, type[Any]], default: str | None = None, required: bool = True
) -> Schema:
    """Return the schema of a table in which the value of one key selects a dataclass.

    Args:
        key: The key.
        choices: The dataclasses by value of the key.
        default: Default value of the key; None if the key has no default.
        required: Whether the key is required when it has no default.
    """
    names: Schema = {"enum": list(choices)} | ({"default": default} if default else {})
    variants = []
    for name, described in choices.items():
        content = _table(described)
        content["properties"] = {key: {"const": name}} | content["properties"]
        asked: Schema = {"properties": {key: {"const": name}}}
        if name != default:
            asked["required"] = [key]
        variants.append({"if": asked, "then": content})
    schema: Schema = {"type": "object", "properties": {key: names}, "allOf": variants}
    return schema | ({"required": [key]} if required and default is None else {})


def _mesh() -> Schema:
    """Return the schema of ``[mesh]``: a file, a builder, or with a geometry only ``adapt``."""
    adapt = {"adapt": _table(Adaptation)}
    builders: dict[str, Callable[..., Any]] = dict(BUILDERS)
    variants = []
    for name, builder in builders.items():
        meaning, hints = arguments(builder), typing.get_type_hints(builder)
        properties: Schema = {"builder": {"const": name}} | adapt
        required = ["builder"]
        for argument, parameter in list(inspect.signature(builder).parameters.items())[1:]:
            properties[argument] = _told(_of_type(hints[argument]), meaning[argument])
            if parameter.default is inspect.Parameter.empty:
                required.append(argument)
        asked = {"properties": {"builder": {"const": name}}, "required": ["builder"]}
        variants.append({"if": asked, "then": _object(properties, required)})
    return {
        "type": "object",
        "properties": {
            "builder": _told({"enum": list(builders)}, arguments(MeshBuilder)["builder"])
        },
        "if": {"required": ["builder"]},
        "then": {"allOf": variants},
        "else": _table(MeshFile, adapt) | {"required": []},
    }


def _solve() -> Schema:
    """Return the schema of ``[solve]``: an algorithm with options, or a conic solver."""
    methods = {name: entry.options for name, entry in METHODS.items()}
    schema = _choice("method", methods, required=False)
    conic = _told({"enum": list(SOLVERS), "default": USUAL}, CONIC)
    for table in (schema, *(variant["then"] for variant in schema["allOf"])):
        table["properties"]["conic"] = conic
    return schema


def _geometry() -> Schema:
    """Return the schema of ``[geometry]``: a file (optional for drawn ground), options, faces."""
    faces = {"face": {"type": "array", "items": _table(NamedFace)}}
    options = _table(MeshingOptions, faces)
    file = _told(
        {"type": "string"}, "Path of the geometry file, relative to the folder of the case file."
    )
    return _object({"file": file} | options["properties"], [])


def _seepage() -> Schema:
    """Return the schema of ``[seepage]``: conductivities, and water levels at surfaces."""
    return _table(Seepage, {"head": {"type": "array", "items": _table(Head)}})
