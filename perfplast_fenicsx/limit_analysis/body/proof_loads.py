"""Write the loads of a bound's body into a proof file, by kind."""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.limit_analysis.body.proof_cones import table_of
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody, FacetLoads
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.mesh.global_ordering import Block, Ordering, block
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Places:
    """Positions of a rank's rows in the file.

    Attributes:
        of_cells: Order of the owned cells.
        of_facets: Order of the outer facets.
    """

    of_cells: Ordering
    of_facets: Ordering


def loads_on_file(
    problem: Problem, body: BoundBody, question: Question, places: Places
) -> dict[str, Block]:
    """Return the arrays of all loads. Collective.

    Args:
        problem: The bodies.
        body: The bodies as bound data.
        question: The loads that λ multiplies.
        places: Positions of their cells and facets.
    """
    d, outer = body.vertices.shape[2], body.geometry.exterior
    found: dict[str, Block] = {}
    for prefix, loads in _kinds(problem, body, question).items():
        pushes = body.geometry.at_corners(outer, loads.tractions[outer])
        found[f"{prefix}body_force"] = block(places.of_cells, loads.forces)
        found[f"{prefix}traction"] = block(places.of_facets, pushes)
        if loads.wet:
            found[f"{prefix}pore_pressure"] = block(places.of_cells, loads.pores)
        if body.rigid.names:
            forces, moments = list(loads.rigid_forces), list(loads.rigid_moments)
            found[f"{prefix}rigid_force"] = table_of(problem, forces, (d,), np.float64)
            found[f"{prefix}rigid_moment"] = table_of(problem, moments, (2 * d - 3,), np.float64)
    return found


def _kinds(problem: Problem, body: BoundBody, question: Question) -> dict[str, FacetLoads]:
    """Return the loads of each kind that the file format supports."""
    if question is Question.STANDS:
        return {"": body.dead, "any_": body.live}
    if any(load.constant for load in problem.given.loads):
        return {"": body.live, "constant_": body.dead}
    return {"": body.live}
