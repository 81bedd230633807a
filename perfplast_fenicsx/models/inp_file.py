"""Read an ``.inp`` file from Abaqus or CalculiX as a model: mesh, loads, supports, contact."""

from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.models.element_types import AXIS, STRESS
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel
from perfplast_fenicsx.models.grouped_model import GroupedMesh, model_of
from perfplast_fenicsx.models.inp_keywords import read_keywords
from perfplast_fenicsx.models.inp_mesh import MESH_KEYWORDS, SCOPES, Assembly, MeshReader
from perfplast_fenicsx.models.inp_statements import InpBody, OnSurfaces, Statements
from perfplast_fenicsx.models.outer_facets import ElementFacets, OuterFacets
from perfplast_fenicsx.models.solid_cells import solid_cells


def read_inp(path: Path) -> ForeignModel:
    """Return the model in an ``.inp`` file.

    Raises:
        InputError: If the file cannot be read, is damaged, or has no solids.
    """
    reader, statements = MeshReader(), Statements()
    for keyword in read_keywords(path):
        if keyword.name in MESH_KEYWORDS + SCOPES:
            reader.take(keyword)
        if keyword.name not in MESH_KEYWORDS:
            statements.take(keyword)
    try:
        return _model(reader.assembly(), statements)
    except InputError as error:
        raise InputError(f"'{path}': {error}") from error


def _model(assembly: Assembly, statements: Statements) -> ForeignModel:
    solid = solid_cells(assembly.points, assembly.blocks, assembly.left_out)
    dim = solid.dim
    meanings = {block.kind.model for block in solid.blocks}
    if dim == 2 and (len(meanings) > 1 or "" in meanings):
        raise InputError(
            "plane elements are of different kinds "
            f"({' and '.join(m or 'shells' for m in sorted(meanings))}); use only plane strain "
            "(CPE), only plane stress (CPS) or only axisymmetry (CAX)."
        )
    thickness = _thickness(statements.thicknesses) if dim == 2 and meanings != {AXIS} else 1.0
    sheet = thickness if dim == 2 and meanings == {STRESS} else None
    on_sets = statements.chosen()
    if not (statements.sections or statements.surfaces or on_sets):
        found = model_of(_groups(assembly, statements, meanings == {AXIS}))
        found.thickness = sheet
        return found
    outer = OuterFacets(solid.cells, len(assembly.points))
    bodies, body = _bodies(assembly, statements, solid.parents)
    surfaces = ElementFacets(assembly.points, assembly.blocks, outer, dim)
    on = OnSurfaces(assembly, surfaces, bodies, dim, thickness)
    made = on.made(statements.surfaces, on_sets, statements.frictions)
    names, facets, surface, _ = made.surfaces
    return ForeignModel(
        dim=dim,
        turned=meanings == {AXIS},
        points=assembly.points,
        cells=solid.cells,
        body=body,
        bodies=[one.name for one in bodies],
        facets=outer.corners[facets],
        surface=surface,
        surfaces=names,
        materials={
            one.name: statements.materials[one.material]
            for one in bodies
            if one.material in statements.materials
        },
        held=made.held,
        pushed=made.pushed,
        joined=made.joined,
        thickness=sheet,
        remarks=solid.remarks + made.remarks + statements.remarks,
    )


def _thickness(given: set[float]) -> float:
    """Return the thickness of plane elements; 1 if sections give no thickness."""
    if len(given) > 1 or any(not one > 0 for one in given):
        told = " and ".join(f"{one:g}" for one in sorted(given))
        what = "thicknesses" if len(given) > 1 else "thickness"
        raise InputError(
            f"sections of plane elements have the {what} {told}, but a case has only one positive "
            "thickness; give all sections the same positive thickness, or model the bodies in 3D."
        )
    return next(iter(given), 1.0)


def _groups(assembly: Assembly, statements: Statements, turned: bool) -> GroupedMesh:
    """Return the mesh with groups of a file that has only sets, as from gmsh or Salome."""
    groups, node_groups = (
        {name: members for (kind, name), members in assembly.sets.items() if kind == wanted}
        for wanted in ("ELSET", "NSET")
    )
    mesh = GroupedMesh(assembly.points, assembly.blocks, groups, node_groups, turned=turned)
    mesh.left_out |= assembly.left_out
    mesh.remarks += statements.remarks
    return mesh


def _bodies(
    assembly: Assembly, statements: Statements, parent: Longs
) -> tuple[list[InpBody], Longs]:
    """Return the bodies that sections define, and the body of each simplex."""
    of_element = np.full(assembly.count, -1)
    rest = "rest"  # name of the body of elements without a section
    wanted, of = [rest], [""]
    for part, elset, material in statements.sections:
        alone = sum(one == part for one, _, _ in statements.sections) == 1
        for instance in [name for name, its in assembly.instances if its == part]:
            members = assembly.members("ELSET", f"{instance}.{elset}" if instance else elset)
            if members is None or not len(members):
                continue
            of_element[members] = len(wanted) - 1
            wanted.append(f"{instance}_{elset}" if instance and not alone else instance or elset)
            of.append(material)
    there, body = np.unique(of_element[parent], return_inverse=True)
    names = unique_names(wanted[number + 1] for number in there)
    bodies = []
    for name, number in zip(names, there, strict=True):
        material = of[number + 1]
        known = statements.materials.get(material, ForeignMaterial())
        elements = np.flatnonzero(of_element == number)
        bodies.append(InpBody(name, material, elements, known.density))
    return bodies, body.ravel()
