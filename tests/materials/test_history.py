"""Test a law with a history: unloading, bodies without history, and wrong shapes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Elastic,
    Flow,
    InputError,
    Newton,
    NewtonOptions,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    l_plate,
    two_blocks,
)
from perfplast_fenicsx.materials import FlowLaw, Material, VonMisesLaw
from tests.models import STEEL

SHARP = NewtonOptions(tolerance=1e-12)


class ScalarLaw(FlowLaw):
    of = VonMisesLaw

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        return {"plastic_strain": ()}


@dataclass(frozen=True)
class Scalar(Flow):
    @property
    def law(self) -> type[FlowLaw]:
        return ScalarLaw


@cache
def mesh() -> TaggedMesh:
    """Return the one mesh of all problems: two meshes would be distributed differently."""
    return l_plate(MPI.COMM_WORLD, 1)


def plate(material: Material, degree: int) -> Problem:
    return Problem(
        mesh(),
        {"plate": material},
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z")],
        [Traction("top", (0.0, 200.0, 0.0))],
        degree=degree,
    )


@pytest.mark.parametrize(("degree", "limit"), [(1, 1.299), (2, 0.8)])
def test_unloading_is_elastic_and_leaves_stress_behind(degree: int, limit: float) -> None:
    """``limit`` is below the limit load of the mesh."""
    problem = plate(Flow(STEEL), degree)
    assert set(problem.history) == {"plastic_strain", "accumulated_plastic_strain"}
    newton = Newton(problem, SHARP)
    loaded = newton.solve(0.8 * limit)
    hencky = Newton(plate(STEEL, degree), SHARP).solve(0.8 * limit)
    assert loaded.report.converged
    assert loaded.report.plastic_fraction > 0.02
    assert loaded.report.alpha == pytest.approx(hencky.report.alpha, rel=1e-12)
    assert loaded.state.history["accumulated_plastic_strain"].x.array.min() >= 0

    unloaded = newton.solve(0.1 * limit, loaded.state)
    assert unloaded.report.converged
    assert abs(unloaded.report.duality_gap) < 1e-10
    assert unloaded.report.plastic_cells == 0
    elastic = Newton(plate(Elastic(STEEL.young, STEEL.poisson), degree), SHARP).solve(0.7 * limit)
    for name in ("u", "stress"):
        before, after, change = (
            (level.state.u if name == "u" else level.stress).x.array
            for level in (loaded, unloaded, elastic)
        )
        assert np.allclose(before - after, change, rtol=0, atol=1e-8 * abs(change).max())

    again = newton.solve(0.8 * limit, unloaded.state)
    assert again.report.alpha == pytest.approx(loaded.report.alpha, rel=1e-9)


def blocks(lower: Material, upper: Material) -> Problem:
    supports, loads = [Support("left")], [Traction("top", (0.0, 0.0, -1.0))]
    return Problem(two_blocks(MPI.COMM_WORLD, 1), {"lower": lower, "upper": upper}, supports, loads)


@pytest.mark.mpi2
def test_history_of_some_of_the_bodies() -> None:
    problem = blocks(Elastic(2e5, 0.3), Flow(VonMises(2e5, 0.3, 100.0)))
    level = Newton(problem).solve(60.0)
    assert level.report.plastic_cells > 0
    strain = level.state.history["plastic_strain"].x.array.reshape(-1, 6)
    cells = problem.tagged_mesh.cells
    assert not strain[cells("lower")].any()
    largest = abs(strain[cells("upper")]).max(initial=0)
    assert problem.comm.allreduce(largest, MPI.MAX) > 1e-6


def test_shapes_that_do_not_fit_are_named() -> None:
    with pytest.raises(InputError, match=r"'plastic_strain' in the history of ScalarLaw"):
        blocks(Flow(STEEL), Scalar(STEEL))
