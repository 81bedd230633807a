"""Test that cases with many statements have valid bounds, or a sentence with the reason.

``PERFPLAST_FUZZ=42`` tries five hundred cases.
"""

import os
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import InputError, ResultFolder, limit_bounds
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.proof import check
from tests.random_statements import random_case

COMM = MPI.COMM_WORLD
EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "0.5"))
REFUSED = (
    "can move as a rigid body",
    "move bodies away from supports",
    "is a formula that is not linear",
)
"""Parts of sentences that are valid answers if the limit load is not known."""

HINGED = 193
"""A case whose elastic body rotates about a hinge next to its first vertex, due to its supports."""

BETTER = 91
"""A case in which the checker proves an upper bound that is better by 1e-4 than the search."""

SEEDS = [
    pytest.param(seed, marks=[] if seed in (0, 2, 4) else [pytest.mark.serial])
    for seed in sorted({*range(int(12 * EFFORT)), BETTER, HINGED})
]


@pytest.mark.long(but=["0", "1", "2", "3", "4"])
@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_a_case_says(shared_tmp_path: Path, seed: int) -> None:
    try:
        case = random_case(seed)
        bounds = limit_bounds(case.problem, 1e-3)
    except InputError as refusal:
        print("STATED", seed, "refused", str(refusal))
        assert seed % 3 > 0
        assert any(words in str(refusal) for words in REFUSED)
        return
    told = [seed, bounds.question.name, bounds.lower.value, bounds.upper.value, case.exact]
    print("STATED", *told, case.words, bounds.why_not)
    for bound in (bounds.lower, bounds.upper):
        assert bound.strict or bound.why_not
    proven = proven_of(bounds, shared_tmp_path)
    lowest, highest = proven.get("lower", -np.inf), proven.get("upper", np.inf)
    rounding = 1e-9 * max(abs(value) for value in (*proven.values(), 0.0))
    assert lowest <= highest + rounding
    if case.exact is None:
        return
    assert bounds.question is Question.LIMIT
    rounding = max(rounding, 1e-9)
    assert lowest <= case.exact + rounding
    assert case.exact <= highest + rounding
    assert bounds.strict
    assert highest - lowest < 0.02


def proven_of(bounds: BodyBounds, path: Path) -> dict[str, float]:
    """Return the values of strict bounds that the checker proves. Collective."""
    halves = proofs(bounds, bounds)
    if halves == (None, None):
        return {}
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *halves)
    checked = check(folder.file("bounds.h5"))
    found = {}
    for kind, half in checked.items():
        assert not half.faults
        assert half.proven is not None
        value = getattr(bounds, kind).value
        assert half.proven == pytest.approx(value, rel=1e-9, abs=1e-9)
        found[kind] = half.proven
    strict = {bound.kind for bound in (bounds.lower, bounds.upper) if bound.strict}
    assert set(found) == strict
    return found
