"""Loads as they are in a proof, by kind."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.results.global_ordering import Ordering
from perfplast_fenicsx.io.results.parallel_hdf5 import Block, block
from perfplast_fenicsx.io.results.proof_cones import table_of
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.mesh.straight_geometry import OuterFacets
from perfplast_fenicsx.problem.assembled.linear_tractions import linear_pores, linear_tractions
from perfplast_fenicsx.problem.assembled.rigid_resultants import rigid_resultants
from perfplast_fenicsx.problem.declared.loads import BodyForce, Force, Load, PorePressure
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Places:
    """Cells and outer facets of this rank.

    Attributes:
        of_cells: The cells' order in the file.
        of_facets: That of the facets.
        cells: Vertices of the cells, shape (num_cells, d + 1, d).
        facets: Those of the facets, shape (num_facets, d, d).
        surface: Tag of each facet.
    """

    of_cells: Ordering
    of_facets: Ordering
    cells: Floats
    facets: Floats
    surface: Longs


def loads_on_file(
    problem: Problem,
    question: Question,
    outer: OuterFacets,
    places: Places,
    tags: dict[str, int],
) -> dict[str, Block]:
    """The arrays of all loads. Collective.

    Args:
        problem: The bodies.
        question: Of which loads λ is the factor.
        outer: The facets.
        places: Where these and the cells are.
        tags: Of the surfaces.
    """
    given, d = problem.given, places.cells.shape[2]
    rigid = [surface for surface in given.rigid if surface.free]
    found: dict[str, Block] = {}
    for prefix, constant in _kinds(problem, question).items():
        chosen = [load for load in given.loads if load.constant is constant]
        pushes = _tractions(chosen, outer, places, tags)
        forces = _body_forces(problem, chosen, len(places.cells))
        found[f"{prefix}body_force"] = block(places.of_cells, forces)
        found[f"{prefix}traction"] = block(places.of_facets, pushes)
        pores = _pores(problem, chosen, places.cells)
        if pores is not None:
            found[f"{prefix}pore_pressure"] = block(places.of_cells, pores)
        if rigid:
            forces, moments = rigid_resultants(rigid, chosen, d)
            name = f"{prefix}rigid"
            found[f"{name}_force"] = table_of(problem, list(forces), (d,), np.float64)
            found[f"{name}_moment"] = table_of(problem, list(moments), (2 * d - 3,), np.float64)
    return found


def _kinds(problem: Problem, question: Question) -> dict[str, bool]:
    """Whether the loads of each kind that the file knows are the constant ones."""
    if question is Question.STANDS:
        return {"": True, "any_": False}
    if any(load.constant for load in problem.given.loads):
        return {"": False, "constant_": True}
    return {"": False}


def _body_forces(problem: Problem, loads: Sequence[Load], count: int) -> Floats:
    """Force per volume of each owned cell."""
    tagged_mesh = problem.tagged_mesh
    forces = np.zeros((count, tagged_mesh.mesh.geometry.dim))
    for load in loads:
        if isinstance(load, BodyForce):
            cells = tagged_mesh.cells(load.on)
            forces[cells[cells < count]] += np.asarray(load.value, dtype=np.float64)
    return forces


def _pores(problem: Problem, loads: Sequence[Load], corners: Floats) -> Floats | None:
    """Pressure in the pores at the vertices of owned cells, if there is such a load."""
    pores = [load for load in loads if isinstance(load, PorePressure)]
    values = np.zeros(corners.shape[:2])
    for load in pores:
        cells = problem.tagged_mesh.cells(load.on)
        cells = cells[cells < len(corners)]
        values[cells] += linear_pores(load, corners[cells])[0]
    return values if pores else None


def _tractions(
    loads: Sequence[Load], outer: OuterFacets, places: Places, tags: dict[str, int]
) -> Floats:
    """Force per area at the vertices of outer facets."""
    corners = places.facets
    values = np.zeros_like(corners)
    for load in loads:
        if not isinstance(load, BodyForce | PorePressure | Force):
            here = places.surface == tags[load.on]
            values[here] += linear_tractions(load, corners[here], outer.normals[here])[0]
    return values
