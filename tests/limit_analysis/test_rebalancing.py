"""What is left where contact forces pull whatever is let go of."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic import rebalancing
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness

pytestmark = pytest.mark.serial


@dataclass
class Forces:
    """An iterate with contact forces alone."""

    forces: Floats
    deviator: Floats


@pytest.mark.parametrize("singular", [2, 3, None])
def test_what_was_balanced_last_is_left(
    singular: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program in which each correction makes another force pull."""
    found: list[Forces] = []

    def factorise() -> None:
        if singular == len(found) + 1:
            raise SingularStiffness("nothing resists")

    def balance(iteration: Any, _springs: Floats) -> None:
        forces = iteration.now.forces.copy()
        forces[len(found)] = -0.1
        iteration.now = Forces(forces, iteration.now.deviator)
        found.append(iteration.now)

    monkeypatch.setattr(rebalancing, "_balance", balance)
    stiffness = SimpleNamespace(factorise=factorise, add_at_jumps=lambda _: None)
    program = SimpleNamespace(
        weights=np.ones(2),
        comm=MPI.COMM_SELF,
        springs=np.ones(9),
        stiffness=stiffness,
        assemble=lambda *_: None,
    )
    iteration = SimpleNamespace(program=program, now=Forces(np.ones(9), np.zeros(2)))
    rebalancing.rebalance(cast("Any", iteration))
    assert len(found) == (rebalancing.MOST_ROUNDS if singular is None else singular - 1)
    assert iteration.now is found[-1]
