"""Implement ``perfplast mesh``: make a first case from a geometry or another program's model."""

import argparse
import json
import logging
import os
import sys
import tempfile
import webbrowser
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.atomic_files import replace as replace_file
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.geometry.first_case import (
    Glued,
    affordable_cells,
    first_case,
    is_thread,
)
from perfplast_fenicsx.geometry.kept_mesh import make_mesh
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.survey import Face, Survey, listed
from perfplast_fenicsx.io.case.case_schema import case_schema
from perfplast_fenicsx.io.case.units_table import HEAVIEST, LIGHTEST
from perfplast_fenicsx.materials.common import MATERIALS, SOILS, find
from perfplast_fenicsx.models.bdf_file import read_bdf
from perfplast_fenicsx.models.foreign_model import ForeignModel, told_of_shared_nodes, with_material
from perfplast_fenicsx.models.inp_file import read_inp
from perfplast_fenicsx.models.med_file import read_med
from perfplast_fenicsx.models.model_case import case_of, skin_of_model, survey_of
from perfplast_fenicsx.models.msh_file import write_msh
from perfplast_fenicsx.models.outer_facets import OuterFacets, with_flat_ends
from perfplast_fenicsx.models.unv_file import read_unv
from perfplast_fenicsx.models.vtu_file import read_vtu
from perfplast_fenicsx.pictures.drawing_process import draw_parts
from perfplast_fenicsx.problem.contact_check import RefusedContacts, refused_contacts
from perfplast_fenicsx.report.setup_page import FaceRow, setup_page
from perfplast_fenicsx.units import SYSTEMS, Name

log = logging.getLogger(__name__)


CASE, MESH, PICTURE, PAGE = "case.toml", "case.msh", "bodies.png", "setup.html"
"""Files that the command writes into the output folder."""

SCHEMA = "case.schema.json"
"""Schema file next to the case; editors use it to complete keys and to mark faults."""

SCHEMA_LINE = f"#:schema ./{SCHEMA}\n"
"""First line of the case file, which names the schema for editors."""


def check_free(output: Path, force: bool) -> None:
    """Refuse a folder that already has a mesh or a case, unless ``force`` is given.

    Raises:
        InputError: If the folder has one of these files and ``force`` is False.
    """
    existing = [name for name in (CASE, MESH) if (output / name).exists()]
    if existing and not force:
        raise InputError(
            f"'{output}' already has a {existing[0]}; give --force to replace it, or another "
            "folder with -o."
        )


def fill(output: Path, made: Path, case: str) -> None:
    """Write the mesh, the case and its schema, the picture and the page into the output folder.

    Args:
        output: The folder.
        made: Folder with the new files: the mesh, and the picture and the page if they exist.
        case: The text of the case.

    Raises:
        InputError: If the folder cannot be written.
    """
    schema = json.dumps(case_schema(), indent=1, ensure_ascii=False)
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name in (MESH, PICTURE, PAGE):
            if (made / name).exists():
                replace_file(output / name, (made / name).read_bytes())
        replace_file(output / CASE, (SCHEMA_LINE + case).encode())
        replace_file(output / SCHEMA, f"{schema}\n".encode())
    except OSError as error:
        raise InputError(
            f"'{output}' cannot be written ({error.strerror or error}); give another "
            "folder with -o."
        ) from error


def written(output: Path) -> str:
    """Return, as text, the files that ``perfplast mesh`` has written, except the schema."""
    return ", ".join(name for name in (MESH, PICTURE, PAGE, CASE) if (output / name).exists())


def files_in(folder: Path) -> list[str]:
    """Return the names of the files in a folder."""
    return sorted(path.name for path in folder.iterdir() if path.is_file())


def address_of(folder: str) -> str:
    """Return the address of the page on which the user sets up a case."""
    return (Path(folder) / PAGE).resolve().as_uri()


def open_page(folder: str) -> str:
    """Open the setup page in a browser if there is a screen, and return a line on it.

    Args:
        folder: The output folder of ``perfplast mesh``.

    Returns:
        The outcome in a sentence, with the address of the page.

    Raises:
        InputError: If the folder has no such page.
    """
    page = Path(folder) / PAGE
    if not page.is_file():
        raise InputError(
            f"the folder '{folder}' contains no {PAGE}; write it with perfplast mesh DRAWING -o "
            f"{folder}."
        )
    address = address_of(folder)
    screen = sys.platform == "darwin" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if screen and webbrowser.open(address):
        return f"Opened {address}"
    return f"Open this page in a browser: {address}"


def mesh(
    comm: MPI.Intracomm,
    source: str,
    output: str,
    options: MeshingOptions,
    material: str | None = None,
    glued: Glued = Glued.SHARED,
    force: bool = False,
    trust: bool = False,
) -> Survey | None:
    """Mesh a geometry file, print its contents, and write the mesh and a first case. Collective.

    Args:
        comm: The ranks; rank 0 does the work.
        source: STEP, BREP, IGES or .geo file.
        output: The output folder.
        options: Meshing options.
        material: Material of all bodies, by its name in ``perfplast materials``.
        glued: Which joints are glued.
        force: Whether to replace an existing mesh and case file.
        trust: Whether to run a .geo script.

    Returns:
        The survey, on rank 0.

    Raises:
        InputError: If the file cannot be meshed, or if the folder already has a case file.
    """
    terminal = Terminal(comm)

    def meshed() -> Survey:
        terminal.status(f"meshing {source}")
        try:
            return _mesh(Path(source), Path(output), options, material, glued, force, trust)
        finally:
            terminal.clear()

    survey = on_rank0(comm, meshed)
    if survey is not None:
        terminal.say(describe(survey, glued))
        case = Path(output) / CASE
        terminal.say(
            f"\nWritten to {output}: {written(Path(output))}. Set up the case in a browser "
            f"with {PAGE}, or fill in the lines marked with <- in {CASE}; then: perfplast "
            f"run {case} -o {Path(output) / 'results'}"
        )
    return survey


def surveyed(survey: Survey, folder: str) -> dict[str, Any]:
    """Return a survey and the names of the written files, for the JSON answer."""
    return {
        "folder": folder,
        "files": files_in(Path(folder)),
        "bodies": [
            {"name": one.name, "elements": one.cells, "volume": one.volume}
            | {"low": one.low, "high": one.high}
            for one in survey.bodies
        ],
        "faces": [
            {"number": one.number, "name": one.name, "body": one.body, "shape": _shape(one)}
            | {"area": one.area, "centre": one.centre}
            for one in survey.faces
        ],
        "sets": [
            {"name": one.name, "faces": one.faces, "why": one.why, "area": one.area}
            for one in survey.sets
        ],
        "joints": [
            {"surfaces": one.surfaces, "bodies": one.bodies, "area": one.area}
            for one in survey.joints
        ],
        "remarks": survey.remarks,
    }


def meshing_options(chosen: argparse.Namespace) -> MeshingOptions:
    """Return the meshing options that the arguments of ``perfplast mesh`` give.

    Raises:
        InputError: If a value cannot be used.
    """
    return MeshingOptions(
        size=chosen.size,
        sizes=_pairs(
            "--size-of", chosen.size_of, "a body with a size; write, for example, bolt=2.5"
        ),
        curvature=chosen.curvature,
        without=chosen.without,
        order=chosen.order,
        meshed="apart" if chosen.apart else "together",
        shared="apart" if chosen.apart else "glued",
        symmetry=_pairs("--symmetry", chosen.symmetry, "a plane; write, for example, x=0"),
        overlap=chosen.overlap,
        close_gaps=chosen.close_gaps,
        patience=chosen.patience,
    )


def _pairs(option: str, given: Sequence[str], wanted: str) -> dict[str, float]:
    """Return the numbers by name that a repeated option ``NAME=NUMBER`` gives."""
    found = {}
    for text in given:
        name, equals, number = text.rpartition("=")
        try:
            found[name] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"{option} '{text}' is not {wanted}.")
    return found


def common_materials(system: Name) -> str:
    """Return a table of common materials and a table of soils in a system of units, as text."""
    units = SYSTEMS[system]
    rows: list[tuple[str, ...]] = [("material", "young", "poisson", "yield_stress", "", "source")]
    for one in (material.in_system(system) for material in MATERIALS):
        numbers = (f"{one.young:g}", f"{one.poisson:g}", f"{one.yield_stress:g}")
        rows.append((one.name, *numbers, one.what, one.source))
    text = [f"Stresses in {units.stress}.", *_aligned(rows)]
    rows = [
        ("ground", "young", "poisson", "cohesion", "friction_angle", "unit weight", "", "source")
    ]
    for soil in (soil.in_system(system) for soil in SOILS):
        strength = (f"{soil.cohesion:g}", f"{soil.friction_angle:g}", f"{soil.unit_weight:g}")
        rows.append(
            (soil.name, f"{soil.young:g}", f"{soil.poisson:g}", *strength, soil.what, soil.source)
        )
    weight = f"{units.force}/{units.length}^3"
    text += ["", f'Drained ground, law = "mohr-coulomb"; unit weights in {weight}.']
    return "\n".join([*text, *_aligned(rows)])


def describe(survey: Survey, glued: Glued = Glued.SHARED) -> str:
    """Return tables of the bodies, joints and faces of a geometry as text.

    Args:
        survey: The survey of bodies, joints and faces.
        glued: Which joints are glued.
    """
    area = "area" if survey.dim == 3 else "length"
    what = "body" if len(survey.bodies) == 1 else "bodies"
    text = [f"{len(survey.bodies)} {what}, {survey.nodes} nodes", *_aligned(_bodies(survey))]
    rows: list[tuple[str, ...]]
    if survey.joints:
        text += ["", *_aligned(_joints(survey, glued))]
    if survey.near:
        text += ["", *_aligned(_near(survey))]
    rows = [("no.", "free face", area, "of CAD", "shape", "centre")]
    for face in survey.faces:
        measures = (f"{face.area:.5g}", _known(face.cad))
        rows.append((f"{face.number}", face.name, *measures, _shape(face), _place(face.centre)))
    text += ["", *_aligned(rows)]
    if survey.sets:
        text += ["", *_aligned(_sets(survey))]
    long_name = 12  # length of body names above which names of faces are hard to read
    if survey.faces and max(len(body.name) for body in survey.bodies) > long_name:
        example = f'face = [{{ name = "inlet", number = {survey.faces[0].number} }}]'
        text += [f"\nA face can have a short name in addition; write under [geometry]: {example}"]
    text += [f"\nwarning: {remark}." for remark in survey.remarks]
    return "\n".join(text)


def _bodies(survey: Survey) -> list[tuple[str, ...]]:
    """Return a table of the bodies; the first row contains the headings."""
    volume = "volume" if survey.dim == 3 else "area"
    rows: list[tuple[str, ...]] = [("body", "elements", volume, "of CAD", "from", "to")]
    for body in survey.bodies:
        measures = (f"{body.volume:.5g}", _known(body.cad))
        rows.append((body.name, f"{body.cells}", *measures, _place(body.low), _place(body.high)))
    return rows


def _joints(survey: Survey, glued: Glued) -> list[tuple[str, ...]]:
    """Return a table of touching faces with headings: names, area, shape, tie or contact."""
    rows: list[tuple[str, ...]]
    rows = [("touching", "", "area" if survey.dim == 3 else "length", "shape", "in the case")]
    for joint in survey.joints:
        shape = " and ".join(joint.shapes) + (", one face of the drawing" if joint.shared else "")
        kind = "tie" if glued.glues(joint) else "contact"
        rows.append((*joint.surfaces, f"{joint.area:.5g}", shape, kind))
    return rows


def _near(survey: Survey) -> list[tuple[str, ...]]:
    """Return a table of bodies that nearly touch; the first row contains the headings."""
    rows = [(*near.bodies, f"{near.gap:.3g}") for near in survey.near]
    return [("apart", "", "gap"), *rows]


def _sets(survey: Survey) -> list[tuple[str, ...]]:
    """Return a table of the names that cover several faces; the first row contains the headings."""
    area = "area" if survey.dim == 3 else "length"
    rows: list[tuple[str, ...]] = [("no.", "also called", "faces", area, "of CAD", "in common")]
    for one in survey.sets:
        known = (listed(one.faces), f"{one.area:.5g}", _known(one.cad))
        rows.append((f"{one.number or '-'}", one.name, *known, one.why))
    return rows


def _shape(face: Face) -> str:
    return f"{face.shape}, {face.round_of}" if face.round_of else face.shape


def _mesh(
    source: Path,
    output: Path,
    options: MeshingOptions,
    material: str | None,
    glued: Glued,
    force: bool,
    trust: bool,
) -> Survey:
    filled = find(material) if material else None
    check_free(output, force)
    file = os.path.relpath(source.resolve(), output.resolve())
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch)
        skin = made / "skin.npz"
        survey = make_mesh(source, made / MESH, options, skin, trust)
        case = first_case(survey, source.stem, file, options, filled, glued)
        refused = refused_contacts(case, made / MESH)
        page = _page(source.stem, skin, survey, case, glued, refused)
        (made / PAGE).write_text(page, encoding="utf-8")
        try:
            draw_parts(skin, made / PICTURE)
        except InputError as error:  # the mesh is written even without a graphics system
            log.warning("%s", error)
        fill(output, made, case)
    return replace(survey, remarks=[*survey.remarks, refused.why]) if refused else survey


def _page(
    title: str,
    skin: Path,
    survey: Survey,
    case: str,
    glued: Glued,
    refused: RefusedContacts | None,
) -> str:
    """Return the HTML page on which the user sets up the case."""
    tables = {"Bodies": _bodies(survey)}
    if survey.sets:
        tables["Names of several faces"] = _sets(survey)
    if survey.joints:
        tables["Faces that touch"] = _joints(survey, glued)
    if survey.near:
        tables["Bodies that nearly touch"] = _near(survey)
    setup = {
        "dim": survey.dim,
        "bodies": [body.name for body in survey.bodies],
        "cells": sum(body.cells for body in survey.bodies),
        "affordable": affordable_cells(survey),
        "faces": [
            {"number": a.number, "name": a.name, "body": a.body, "round": a.round_of}
            for a in survey.faces
        ],
        "sets": [{"name": one.name, "faces": one.faces} for one in survey.sets],
        "joints": [
            {"bodies": one.bodies, "surfaces": one.surfaces, "glued": one.shared}
            | {"bolted": is_thread(one)}
            for one in survey.joints
        ],
        "refused": {"why": refused.why, "pairs": refused.pairs} if refused else None,
        "case": SCHEMA_LINE + case,
        "schema": case_schema(),
        "systems": {
            name: {"length": one.length, "force": one.force, "stress": one.stress}
            | {"density": one.density, "newtons": one.pascals / one.metres}
            for name, one in SYSTEMS.items()
        },
        "weights": [LIGHTEST, HEAVIEST],
        "library": {name: library(name) for name in SYSTEMS},
    }
    rows = [_face_row(face, survey) for face in survey.faces]
    size = "Area" if survey.dim == 3 else "Length"
    return setup_page(title, skin, rows, setup, tables, size, survey.remarks)


def library(system: Name) -> list[dict[str, object]]:
    """Return common materials and soils in a system of units; the values of ``keys`` are TOML."""
    found: list[dict[str, object]] = []
    for one in (material.in_system(system) for material in MATERIALS):
        numbers = {key: repr(getattr(one, key)) for key in ("young", "poisson", "yield_stress")}
        keys = {"law": '"von-mises"'} | numbers
        found.append({"name": one.name, "what": one.what, "source": one.source, "keys": keys})
    for soil in (soil.in_system(system) for soil in SOILS):
        names = ("young", "poisson", "cohesion", "friction_angle")
        keys = {"law": '"mohr-coulomb"'} | {key: repr(getattr(soil, key)) for key in names}
        found.append({"name": soil.name, "what": soil.what, "source": soil.source, "keys": keys})
    return found


def _face_row(face: Face, survey: Survey) -> FaceRow:
    """Return a face's row on the page, with its area as a share of each set that contains it."""
    names = [
        f"{one.name} ({one.why}), {100 * face.area / one.area:.3g} % of it"
        for one in survey.sets
        if face.number in one.faces
    ]
    centre = ", ".join(f"{x:.4g}" for x in face.centre)
    measures = (f"{face.area:.5g}", _known(face.cad))
    return FaceRow(face.number, face.name, _shape(face), *measures, centre, "; ".join(names))


def _known(measure: float | None) -> str:
    """Return a volume or area in the CAD file as text; "-" if it is unknown."""
    return "-" if measure is None else f"{measure:.5g}"


def _place(point: tuple[float, ...]) -> str:
    return " ".join(f"{x:.4g}" for x in point)


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


MODELS = {
    **{".inp": read_inp, ".med": read_med, ".unv": read_unv},
    **dict.fromkeys((".bdf", ".nas", ".fem"), read_bdf),
    **dict.fromkeys((".vtu", ".vtk"), read_vtu),
}
"""Functions that read models, by the suffix of the file."""


def is_model(path: str) -> bool:
    """Return whether the file name has the suffix of a model, which already has a mesh."""
    return Path(path).suffix.lower() in MODELS


def mesh_model(comm: MPI.Intracomm, chosen: argparse.Namespace) -> Survey | None:
    """Read a model, print its contents, and write the mesh and a first case. Collective.

    Args:
        comm: The ranks; rank 0 does the work.
        chosen: The arguments of ``perfplast mesh``.

    Returns:
        The survey, on rank 0.

    Raises:
        InputError: If the file cannot be used, if the folder already has a case, or if options do
            not apply to a model with a mesh.
    """
    if meshing_options(chosen) != MeshingOptions() or chosen.tied or chosen.bolted:
        raise InputError(
            f"'{chosen.geometry}' already has a mesh, but options for meshing and gluing "
            "apply only to geometry files; remove them."
        )
    terminal, output = Terminal(comm), Path(chosen.output)

    def made() -> tuple[Survey, bool]:
        terminal.status(f"reading {chosen.geometry}")
        try:
            return _made(Path(chosen.geometry), output, chosen.material, chosen.force)
        finally:
            terminal.clear()

    found = on_rank0(comm, made)
    if found is None:
        return None
    survey, complete = found
    terminal.say(describe(survey))
    fill = "" if complete else f" fill in the lines marked with <- in {CASE};"
    terminal.say(
        f"\nWritten to {output}: {written(output)}. Next:{fill} perfplast run"
        f" {output / CASE} -o {output / 'results'}"
    )
    return survey


def _made(source: Path, output: Path, material: str | None, force: bool) -> tuple[Survey, bool]:
    """Write the output folder; return the survey, and whether the case needs no more entries."""
    check_free(output, force)
    model = MODELS[source.suffix.lower()](source)
    model.remarks.extend(told_of_shared_nodes(model))
    stress = ""
    if material is not None:
        model, stress = with_material(model, material)
    if not (model.held and model.pushed):
        model = with_flat_ends(model)
    survey = survey_of(model)
    case = case_of(model, source.stem, source.name, MESH, stress)
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch)
        try:
            write_msh(model, made / MESH)
            _draw(model, survey, made)
        except OSError as error:
            raise InputError(
                "the mesh cannot be written to a temporary folder "
                f"({error.strerror or error}); free some space, or set TMPDIR to "
                "another folder."
            ) from error
        fill(output, made, case)
    return survey, "<-" not in case


def _draw(model: ForeignModel, survey: Survey, made: Path) -> None:
    """Draw the bodies, or log a warning if they cannot be drawn."""
    shown, body, face = model.cells, model.body, np.zeros(len(model.cells), dtype=np.int64)
    if model.dim == 3:
        outer = OuterFacets(model.cells, len(model.points))
        shown, body = outer.outwards(model.points, model.cells), model.body[outer.cells]
        at = outer.find(model.facets)
        face = np.zeros(len(shown), dtype=np.int64)
        face[at[at >= 0]] = model.surface[at >= 0] + 1
    np.savez(made / "skin.npz", **skin_of_model(model, survey, shown, body, face))
    try:
        draw_parts(made / "skin.npz", made / PICTURE)
    except InputError as error:
        log.warning("%s", error)
