"""A law with a history, in this one file: a step of plastic flow, which is Hencky's law shifted.

With the plastic strain p of the last level (implicit Euler of Prandtl and Reuss), Σ(e − p) is the
stress, ψ(e − p) the potential, and ½ s:C⁻¹s + s:p its conjugate.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

from mpi4py import MPI

import numpy as np
import pytest
import ufl

from perfplast_fenicsx import (
    Elastic,
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
from perfplast_fenicsx.materials import Expr, IsotropicElasticity, Law, Material, VonMisesLaw
from tests.models import STEEL

SHARP = NewtonOptions(tolerance=1e-12)


@dataclass(frozen=True)
class FlowLaw(Law):
    bulk: Expr
    shear: Expr
    yield_radius: Expr
    projects: ClassVar[bool] = False

    @property
    def hencky(self) -> VonMisesLaw:
        return VonMisesLaw(self.bulk, self.shear, self.yield_radius)

    @property
    def elastic(self) -> IsotropicElasticity:
        return self.hencky.elastic

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        return {"plastic_strain": (m,), "plastic_work": ()}

    def stress(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        return self.hencky.stress(e - old["plastic_strain"], {})

    def potential(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        return self.hencky.potential(e - old["plastic_strain"], {})

    def conjugate(self, s: Expr, old: Mapping[str, Expr]) -> Expr:
        return self.hencky.conjugate(s, {}) + ufl.dot(s, old["plastic_strain"])

    def plastic(self, e: Expr, old: Mapping[str, Expr]) -> Expr:
        return self.hencky.plastic(e - old["plastic_strain"], {})

    def tangent_fields(self, e: Expr, old: Mapping[str, Expr], rho: Expr) -> Mapping[str, Expr]:
        return self.hencky.tangent_fields(e - old["plastic_strain"], {}, rho)

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        return self.hencky.tangent(stored, d)

    def updated(self, e: Expr, old: Mapping[str, Expr]) -> Mapping[str, Expr]:
        stress = self.stress(e, old)
        strain = e - self.elastic.compliance(stress)
        work = ufl.dot(stress, strain - old["plastic_strain"])
        return {"plastic_strain": strain, "plastic_work": old["plastic_work"] + work}

    def yield_ratio(self, s: Expr) -> Expr:
        return self.hencky.yield_ratio(s)

    def dissipation(self, rate: Expr) -> Expr:
        return self.hencky.dissipation(rate)

    def inadmissible(self, rate: Expr) -> Expr:
        return self.hencky.inadmissible(rate)


@dataclass(frozen=True)
class Flow:
    law: ClassVar[type[Law]] = FlowLaw

    base: VonMises

    def parameters(self) -> dict[str, float]:
        return self.base.parameters()


class ScalarLaw(FlowLaw):
    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        return {"plastic_strain": ()}


@dataclass(frozen=True)
class Scalar(Flow):
    law: ClassVar[type[Law]] = ScalarLaw


@cache
def mesh() -> TaggedMesh:
    """The one mesh of all problems: two would not be divided among the ranks alike."""
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
    assert set(problem.history) == {"plastic_strain", "plastic_work"}
    newton = Newton(problem, SHARP)
    loaded = newton.solve(0.8 * limit)
    hencky = Newton(plate(STEEL, degree), SHARP).solve(0.8 * limit)
    assert loaded.report.converged
    assert loaded.report.plastic_fraction > 0.02
    assert loaded.report.alpha == pytest.approx(hencky.report.alpha, rel=1e-12)
    assert loaded.state.history["plastic_work"].x.array.min() >= -1e-12

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
    with pytest.raises(InputError, match=r"'plastic_strain' of the history of ScalarLaw"):
        blocks(Flow(STEEL), Scalar(STEEL))
