"""Test that a single lower or upper bound equals that of a pair, with the same proof."""

from collections.abc import Callable

from mpi4py import MPI

import pytest

from meshes.slope import write_slope
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    Pressure,
    Problem,
    Support,
    VonMises,
    limit_bounds,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis.body.limit_bounds import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from tests.models import Read

STEEL = VonMises(1e3, 0.3, 0.3)


def slope(read: Read) -> Problem:
    """Return a slope in plane strain."""
    return Problem(
        read(write_slope, size=0.5),
        {"soil": DruckerPrager(1e3, 0.3, 0.05, 20.0, "plane-strain")},
        [Support("bottom"), Support("left", "x")],
        [BodyForce("soil", (0.0, -1.0), constant=True)],
        degree=2,
    )


def ring(read: Read) -> Problem:
    """Return a ring in axisymmetry."""
    return Problem(
        read(write_thick_tube, size=0.5, order=1).turned(),
        {"tube": STEEL},
        [Support("y0", "y")],
        [Pressure("inner", 0.1, constant=True)],
        degree=2,
    )


def cubes(read: Read) -> Problem:
    """Return cubes in 3D, where cells are split."""
    tagged_mesh = stacked_blocks(MPI.COMM_WORLD, n=1)
    return Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, STEEL),
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 0.1, constant=True)],
        [Contact("upper_bottom", "lower_top")],
        degree=2,
    )


@pytest.mark.long(but=["slope"])
@pytest.mark.parametrize("model", [slope, ring, cubes])
def test_each_is_that_of_both(model: Callable[[Read], Problem], read: Read) -> None:
    problem = model(read)
    both = limit_bounds(problem, 1e-3)
    low, high = lower_bound(problem, both, 1e-3), upper_bound(problem, 1e-3)
    assert low.lower.strict and high.upper.strict
    assert low.lower.value == pytest.approx(both.lower.value, rel=1e-3)
    assert high.upper.value == pytest.approx(both.upper.value, rel=1e-3)
    assert low.upper.value is None and high.lower.value is None
    assert proofs(low, low)[0] is not None and proofs(low, low)[1] is None
    assert proofs(high, high)[0] is None and proofs(high, high)[1] is not None
