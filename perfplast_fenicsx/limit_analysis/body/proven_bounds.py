"""Bounds that are strict only where the checker of proofs proves them."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import (
    LowerProof,
    VelocityProof,
    half_arrays,
    proofs,
)
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.proof.checker import check_halves
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.verdict import Checked

Ask = Callable[[LowerProof | None, VelocityProof | None], Mapping[str, Checked]]
"""Asks the checker. Collective; rank 0 has the answer."""


def proven(bounds: BodyBounds) -> BodyBounds:
    """Return bounds that are strict where the checker proves them. Collective.

    Args:
        bounds: As the program found them.
    """
    comm = bounds.problem.comm

    def ask(lower: LowerProof | None, upper: VelocityProof | None) -> dict[str, Checked]:
        blocks, numbers = half_arrays(lower, upper)
        halves = {}
        for kind, half in blocks.items():
            whole = {name: comm.gather(rows.values, root=0) for name, rows in half.items()}
            halves[kind] = {name: np.concatenate(of) for name, of in whole.items() if of}
            halves[kind] |= {name: np.asarray(of) for name, of in numbers[kind].items()}
        return check_halves(halves) if comm.rank == 0 else {}

    low, high = proven_part(bounds, bounds, ask)
    if bounds.weaker is not None and not (low.lower.strict and high.upper.strict):
        # The water of a slope that has an upper and a lower substitute is not one statement. A
        # factor of safety has a file of each.
        lower, upper = (
            replace(of, value=None, of=Scope.MESH) for of in (bounds.lower, bounds.upper)
        )
        low, high = replace(bounds, upper=upper), replace(bounds, lower=lower)
        low = proven_part(low, low, ask)[0]
        high = proven_part(high, high, ask)[1]
    return replace(bounds, lower=low.lower, upper=high.upper)


def proven_part(
    low: BodyBounds, high: BodyBounds, ask: Ask, divisor: float | None = None
) -> tuple[BodyBounds, BodyBounds]:
    """Return bounds that are strict where a checker proves them. Collective.

    A bound that it proves to be worse has the value that it proves. Others that it refuses are
    bounds of the mesh.

    Args:
        low: With the lower bound.
        high: With the upper bound.
        ask: Asks the checker.
        divisor: F that divides the strengths of the bodies; None without such a factor.
    """
    comm, claimed = low.problem.comm, (low.lower.value, high.upper.value)
    while (halves := proofs(low, high, divisor)) != (None, None):
        refused, reached = comm.bcast(_answered(ask, *halves))
        both = (low.lower, high.upper)
        worse = {
            bound.kind: bound.proven(reached[bound.kind])
            for bound, before in zip(both, claimed, strict=True)
            if bound.kind in refused
            and reached.get(bound.kind) not in (None, before)
            and bound.value == before
        }
        lower, upper = (_judged(bound, worse, refused) for bound in both)
        low = low if lower is low.lower else replace(low, lower=lower)
        high = high if upper is high.upper else replace(high, upper=upper)
        if not refused:
            break
    return low, high


def _judged(bound: Bound, worse: Mapping[str, Bound], refused: Mapping[str, str]) -> Bound:
    """Return a bound after the checker has answered.

    Args:
        bound: A bound.
        worse: Those that the checker proves with a worse value, which it has to see again.
        refused: Why it refuses others, by kind.
    """
    if bound.kind in worse:
        return worse[bound.kind]
    if not bound.can_be_strict:
        return bound
    if not refused:
        return bound.proven() if bound.doubts else bound
    return bound if worse or bound.kind not in refused else bound.refused(refused[bound.kind])


def _answered(
    ask: Ask, lower: LowerProof | None, upper: VelocityProof | None
) -> tuple[dict[str, str], dict[str, float | None]]:
    """Return why the checker refuses halves, by kind, and the bounds that they prove."""
    try:
        found = ask(lower, upper)
    except ProofError as error:
        why = f"the proof checker refuses it: {error}"
        return dict.fromkeys(("lower", "upper"), why), {}
    refused = {
        kind: f"the proof checker refuses it: {'; '.join(half.faults)}"
        for kind, half in found.items()
        if half.faults
    }
    return refused, {kind: half.reached for kind, half in found.items()}
