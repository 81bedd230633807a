"""Test rebalancing if contact forces pull, for any order of their removal."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic import interior_iteration
from perfplast_fenicsx.limit_analysis.conic.cone import Borne
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness

pytestmark = pytest.mark.serial


@dataclass
class Iterate:
    """An iterate with contact forces only."""

    borne: Borne

    @property
    def forces(self) -> Floats:
        """Return the forces of the pairs."""
        return self.borne.forces

    def bearing(self, borne: Borne, _blocks: object) -> "Iterate":
        """Return the same iterate with other forces."""
        return Iterate(borne)


def pushing(forces: Floats) -> Iterate:
    """Return an iterate with given forces."""
    return Iterate(Borne(np.zeros(2), np.zeros((2, 2)), forces))


@pytest.mark.parametrize("singular", [2, 3, None])
def test_what_was_balanced_last_is_left(
    singular: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this program each correction makes another force pull."""
    found: list[Iterate] = []

    def factorise() -> None:
        if singular == len(found) + 1:
            raise SingularStiffness("nothing resists")

    def balance(iteration: Any, _springs: Floats) -> None:
        forces = iteration.now.forces.copy()
        forces[len(found)] = -0.1
        iteration.now = pushing(forces)
        found.append(iteration.now)

    monkeypatch.setattr(interior_iteration, "_balance", balance)
    stiffness = SimpleNamespace(factorise=factorise, add_at_jumps=lambda _: None)
    program = SimpleNamespace(
        moduli=lambda _: None,
        comm=MPI.COMM_SELF,
        springs=np.ones(9),
        stiffness=stiffness,
        assemble=lambda *_: None,
        blocks=(),
    )
    iteration = SimpleNamespace(program=program, now=pushing(np.ones(9)))
    interior_iteration.rebalance(cast("Any", iteration))
    assert len(found) == (interior_iteration.MOST_ROUNDS if singular is None else singular - 1)
    assert iteration.now is found[-1]
