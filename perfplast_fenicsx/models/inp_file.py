"""An ``.inp`` file of Abaqus or CalculiX as a model: mesh, and what a case can say of the rest."""

from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.parts import unique_names
from perfplast_fenicsx.models.element_types import AXIS, STRESS
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel
from perfplast_fenicsx.models.inp_keywords import read_keywords
from perfplast_fenicsx.models.inp_mesh import MESH_KEYWORDS, SCOPES, Assembly, Block, MeshReader
from perfplast_fenicsx.models.inp_on_surfaces import InpBody, OnSurfaces
from perfplast_fenicsx.models.inp_statements import Statements
from perfplast_fenicsx.models.inp_surfaces import InpSurfaces
from perfplast_fenicsx.models.outer_facets import OuterFacets
from perfplast_fenicsx.models.simplices import divided

BENT = 1e-3
"""Share of an edge by which a midside may be off its middle and the edge still be straight."""

REST = "rest"
"""The body of elements without a section."""


def read_inp(path: Path) -> ForeignModel:
    """Read a file.

    Raises:
        InputError: If it cannot be read, is damaged, or has no solids.
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
    solids = [block for block in assembly.blocks if block.kind.shape.dim > 1]
    if not solids:
        left = ", ".join(assembly.left_out) or "none"
        raise InputError(
            f"there are no solid elements (types that are not known: {left}); give C3D4, C3D10,"
            " C3D8, C3D20, C3D6, C3D15, or CPE and CAX ones in the plane."
        )
    dim = max(block.kind.shape.dim for block in solids)
    solids = [block for block in solids if block.kind.shape.dim == dim]
    meanings = {block.kind.model for block in solids}
    if dim == 2 and (len(meanings) > 1 or meanings & {STRESS, ""}):
        raise InputError(
            f"elements in the plane are of {' and '.join(m or 'shells' for m in sorted(meanings))};"
            " give one of plane strain (CPE) or axisymmetry (CAX)."
        )
    cells, parents = [], []
    for block in solids:
        corners, of = divided(block.nodes[:, : block.kind.shape.corners], block.kind.shape)
        cells.append(corners)
        parents.append(block.first + of)
    every, parent = np.concatenate(cells), np.concatenate(parents)
    every = _oriented(assembly.points, every, dim)
    remarks = _told_of_mesh(assembly, solids, len(every))
    outer = OuterFacets(every, len(assembly.points))
    bodies, body = _bodies(assembly, statements, parent)
    surfaces = InpSurfaces(assembly, outer, dim)
    on = OnSurfaces(assembly, surfaces, bodies, dim)
    made = on.made(statements.surfaces, statements.chosen(), statements.frictions)
    names, facets, surface, _ = made.surfaces
    return ForeignModel(
        dim=dim,
        turned=meanings == {AXIS},
        points=assembly.points,
        cells=every,
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
        remarks=remarks + made.remarks + statements.remarks,
    )


def _oriented(points: Floats, cells: Longs, dim: int) -> Longs:
    """Cells with positive volume."""
    edges = points[cells[:, 1:], :dim] - points[cells[:, :1], :dim]
    turned = np.linalg.det(edges) < 0
    cells = cells.copy()
    cells[turned] = cells[turned][:, [1, 0, *range(2, dim + 1)]]
    return cells


def _told_of_mesh(assembly: Assembly, solids: list[Block], count: int) -> list[str]:
    """What became of elements."""
    remarks = [
        f"{number} lines of elements of type {name}, which the program does not know, are left out"
        for name, number in assembly.left_out.items()
    ]
    whole = sum(len(block.nodes) for block in solids)
    if count > whole:
        remarks.append(
            f"{whole} elements are divided into {count} triangles or tetrahedra whose faces match"
        )
    bent = 0
    for block in solids:
        shape = block.kind.shape
        if block.kind.nodes < shape.corners + len(shape.midsides):
            continue
        ends = assembly.points[block.nodes[:, np.array(shape.midsides)]]
        middles = assembly.points[block.nodes[:, shape.corners :]]
        off = np.linalg.norm(middles - ends.mean(axis=2), axis=2)
        bent += int((off > BENT * np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)).sum())
    if bent:
        remarks.append(
            f"{bent} midsides lie off the middle of their edge: curved elements are taken as"
            " straight between their corners"
        )
    return remarks


def _bodies(
    assembly: Assembly, statements: Statements, parent: Longs
) -> tuple[list[InpBody], Longs]:
    """Bodies by their sections, and the body of each simplex."""
    of_element = np.full(assembly.count, -1)
    wanted, of = [REST], [""]
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
