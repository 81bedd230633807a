"""Bound the limit load of rigid blocks: bodies that cannot yield and fail only at joints."""

import logging
from dataclasses import replace

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.blocks.block_limit import BlockLimit, block_limit
from perfplast_fenicsx.limit_analysis.blocks.joint_program import Outcome
from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import (
    RigidBlocks,
    check_blocks,
    rigid_blocks,
)
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, JointProof
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Question, Scope, Standing
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)

ROUNDING = 1e-12
"""Largest relative excess of the lower bound over the upper bound that counts as rounding. If the
excess is not larger, the program raises the upper bound to the lower bound."""

MET = "forces on the joints and a mechanism of the blocks were found"

ANY_FACTOR = (
    "nothing can yield, and the joints carry the loads at any factor; give a yield stress "
    "to bodies that may collapse"
)

WITHOUT_FRICTION = (
    "without friction (adhesion may remain) no joint forces balance the loads, and the lower "
    "bound theorem does not hold with friction that is not associated; give associated = true "
    "for both bounds of joints that dilate"
)


def block_bounds(problem: Problem, rtol: float) -> BodyBounds:
    """Return both bounds on the limit load of rigid blocks. Collective.

    Args:
        problem: The bodies and their loads; :func:`rigid_blocks.are_blocks` must be true for them.
        rtol: Largest relative distance of each bound from the best bound of its kind.

    Raises:
        InputError: If :func:`rigid_blocks.check_blocks` refuses the joints, if no joint forces
            balance the loads, or if a linear program has no reliable solution.
    """
    check_blocks(problem)
    log.info("bounds for rigid blocks: computing forces in their joints, and a mechanism")
    blocks = rigid_blocks(problem)
    question = Question.LIMIT if problem.loads.grows() else Question.STANDS
    found = block_limit(problem.comm, blocks, question, rtol)
    if found.upper[0] is Outcome.INFEASIBLE and question is Question.LIMIT:
        question = Question.STANDS
        found = block_limit(problem.comm, blocks, question, rtol)
    if Outcome.FAILED in (found.lower[0], found.upper[0]):
        raise InputError(
            "a linear program for the joints cannot be solved reliably; choose units in which the "
            "coordinates and the loads are closer to 1."
        )
    if question is Question.LIMIT and not found.resists:
        raise InputError(
            "no joint forces balance the loads, which move blocks apart or along their joints; "
            "reverse the loads, support the blocks there, or give constant loads (constant = "
            "true), such as the weight of the blocks."
        )
    return _told(problem, blocks, found, question)


def _told(
    problem: Problem, blocks: RigidBlocks, found: BlockLimit, question: Question
) -> BodyBounds:
    """Return the results of the linear programs as bounds of the body. Collective."""
    lower = _bound("lower", *found.lower)
    upper = _bound("upper", *found.upper)
    mechanism = _velocity(problem, blocks, found.motion)
    least, most = (bound.value for bound in (lower, upper))
    if least is not None and most is not None and 0 < least - most <= ROUNDING * abs(least):
        upper, most = replace(upper, value=least), least
    standing = Standing(least, most) if question is Question.STANDS else None
    limited = question is Question.LIMIT
    static = (
        most if least is None else least
    )  # By duality, both values are equal for joints that dilate.
    reason = MET if most is not None else upper.why_not[0]
    mesh = LimitLoad(
        method=LimitMethod.INTERIOR_POINT,
        lower=static if limited and static is not None else -np.inf,
        estimate=most if limited else None,
        residual=None,
        upper=most if limited else None,
        alpha=None,
        levelled_off=most is not None,
        reason=reason if standing is None else standing.in_words(),
        iterations=found.programs,
        linear_solves=0,
        factorisations=0,
        mechanism=mechanism,
        verdict=Verdict.FOUND if most is not None else Verdict.UNBOUNDED,
        question=question,
        standing=standing,
    )
    return BodyBounds(
        problem=problem,
        lower=lower,
        upper=upper,
        mechanism=mechanism,
        mesh=mesh,
        joints=JointProof(found.best, found.inner),
        steps=found.programs,
        question=question,
    )


def _bound(kind: str, outcome: Outcome, value: float) -> Bound:
    """Return the bound that a linear program gives; a bound without a value has a reason."""
    if outcome is Outcome.FOUND:
        return Bound(value, kind, Scope.BODY)
    why = ANY_FACTOR if outcome is Outcome.UNBOUNDED else WITHOUT_FRICTION
    return Bound(None, kind, Scope.MESH, (why,))


def _velocity(problem: Problem, blocks: RigidBlocks, motion: Floats) -> fem.Function:
    """Return the velocity field of the rigid motions of blocks. Collective."""
    found = fem.Function(problem.V, name="mechanism")
    d = problem.bodies.gdim
    x = problem.V.tabulate_dof_coordinates()[: len(blocks.of_node), :d]
    of_blocks = motion.reshape(blocks.count, -1)[blocks.of_node]
    values = np.einsum("nim,nm->ni", blocks.frames.at(blocks.of_node, x), of_blocks)
    found.x.array[:] = np.where(problem.fixed, 0.0, values).ravel()
    found.x.scatter_forward()
    return found
