"""Implement ``perfplast mesh MODEL.inp``: turn another program's model into mesh and first case."""

import argparse
import logging
import tempfile
from pathlib import Path

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.cli.mesh_command import describe, meshing_options
from perfplast_fenicsx.cli.mesh_folder import CASE, MESH, PICTURE, check_free, fill, written
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.survey import Survey
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

MODELS = {
    **{".inp": read_inp, ".med": read_med, ".unv": read_unv},
    **dict.fromkeys((".bdf", ".nas", ".fem"), read_bdf),
    **dict.fromkeys((".vtu", ".vtk"), read_vtu),
}
"""The reader of a model, by the suffix of its file."""

log = logging.getLogger(__name__)


def is_model(path: str) -> bool:
    """Return whether a file name is that of a model with its own mesh."""
    return Path(path).suffix.lower() in MODELS


def mesh_model(comm: MPI.Intracomm, chosen: argparse.Namespace) -> Survey | None:
    """Read a model, print its contents, and write mesh and first case. Collective.

    Args:
        comm: The ranks; rank 0 does the work.
        chosen: The arguments of ``perfplast mesh``.

    Returns:
        The survey, on rank 0.

    Raises:
        InputError: If the file cannot be used, if the folder already has a case, or for options
            that do not apply to a model with a mesh.
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
    """Write the folder; return the survey and whether the case is complete."""
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
            raise InputError(f"the mesh cannot be written: {error.strerror or error}.") from error
        fill(output, made, case)
    return survey, "<-" not in case


def _draw(model: ForeignModel, survey: Survey, made: Path) -> None:
    """Draw the bodies; without a graphics system the mesh is written all the same."""
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
