"""Test strict bounds for Mohr–Coulomb and Tresca bodies in plane strain."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    Adaptation,
    DruckerPrager,
    Newton,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    TaggedMesh,
    VonMises,
    adaptive_bounds,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.materials import ElasticLaw, Expr
from perfplast_fenicsx.materials.coulomb_cone import CoulombSet, TrescaSet
from perfplast_fenicsx.proof import check
from tests.models import Read

COMM = MPI.COMM_WORLD
FOOTING = {0.0: 2 + math.pi, 10.0: 8.344926, 20.0: 14.834712, 30.0: 30.139628}
"""Prandtl's N_c by friction angle."""


@dataclass(frozen=True)
class CoulombLimits(ElasticLaw):
    """A yield set for limit analysis, without a flow rule for increments."""

    cohesion: Expr
    sine: Expr
    dilates: ClassVar[bool] = True

    @property
    def yields(self) -> CoulombSet:  # type: ignore[override]
        return CoulombSet(self.cohesion, self.sine)


@dataclass(frozen=True)
class TrescaLimits(ElasticLaw):
    """The same for Tresca's law."""

    cohesion: Expr

    @property
    def yields(self) -> TrescaSet:  # type: ignore[override]
        return TrescaSet(self.cohesion)


@dataclass(frozen=True)
class Ground:
    """Ground with cohesion 1 and a friction angle (degrees)."""

    law: ClassVar[type[CoulombLimits]] = CoulombLimits
    angle: float

    def parameters(self) -> Mapping[str, float]:
        sine = math.sin(math.radians(self.angle))
        return {"bulk": 1e4, "shear": 5e3, "cohesion": 1.0, "sine": sine}


@dataclass(frozen=True)
class Clay:
    """Undrained clay with cohesion 1."""

    law: ClassVar[type[TrescaLimits]] = TrescaLimits

    def parameters(self) -> Mapping[str, float]:
        return {"bulk": 1e4, "shear": 5e3, "cohesion": 1.0}


def ground(read: Read, angle: float = 0.0) -> TaggedMesh:
    """Return a mesh that is wide enough for a friction angle."""
    room = 6.0 if angle <= 20 else 12.0
    return read(write_strip_footing, width=room, depth=room / 2, grading=1.0, size=0.7)


def footing(tagged_mesh: TaggedMesh, material: object) -> Problem:
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    return Problem(
        tagged_mesh,
        {"ground": material},  # type: ignore[dict-item]
        supports,
        [Pressure("footing", 1.0)],
        degree=2,
    )


@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_a_footing(read: Read, shared_tmp_path: Path, angle: float) -> None:
    """Prandtl's load lies between the bounds, and the checker proves the bounds."""
    bounds = limit_bounds(footing(ground(read, angle), Ground(angle) if angle else Clay()))
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None
    assert low <= FOOTING[angle] <= high
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    for half, bound in zip((checked["lower"], checked["upper"]), (low, high), strict=True):
        assert not half.faults, half
        assert half.proven == pytest.approx(bound, rel=1e-8)


@pytest.mark.parametrize("angle", [10.0, 30.0])
def test_drucker_and_prager_match_it(read: Read, angle: float) -> None:
    """With the plane-strain match, both laws have the same bounds."""
    match = DruckerPrager(2.5e4, 0.25, 1.0, angle, "plane-strain")
    mesh = ground(read, angle)
    one, other = (limit_bounds(footing(mesh, it)) for it in (Ground(angle), match))
    assert one.lower.value == pytest.approx(other.lower.value, rel=1e-9)
    assert one.upper.value == pytest.approx(other.upper.value, rel=1e-9)


def test_levels_refuse_a_law_without_a_return_mapping(read: Read) -> None:
    """The levels would be elastic at any load, with a duality gap of zero."""
    with pytest.raises(InputError, match="TrescaLimits"):
        Newton(footing(ground(read), Clay()))


def test_tresca_is_von_mises_of_the_same_shear_strength(read: Read) -> None:
    mesh = ground(read)
    one, other, third = (
        interior_point(footing(mesh, it))
        for it in (Clay(), VonMises(2.5e4, 0.25, math.sqrt(3)), Ground(0.0))
    )
    assert one.lower == pytest.approx(other.lower, rel=1e-9)
    assert third.lower == pytest.approx(other.lower, rel=1e-9)
    assert one.upper == pytest.approx(other.upper, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(("angle", "apart"), [(10.0, 0.010), (20.0, 0.015), (30.0, 0.020)])
def test_footings_on_four_thousand_cells(read: Read, angle: float, apart: float) -> None:
    # few cells initially, and smaller cells at the edge: refinement cannot remove unneeded cells
    room = 6.0 if angle <= 20 else 12.0
    mesh = read(write_strip_footing, width=room, depth=room / 2, grading=0.3, size=1.0)
    bounds = adaptive_bounds(footing(mesh, Ground(angle)), Adaptation(until=apart, cells=4000))
    low, high = bounds.lower.value, bounds.upper.value
    print(angle, low, high)
    assert bounds.lower.strict and bounds.upper.strict
    assert low is not None and high is not None
    assert low <= FOOTING[angle] <= high
    assert 2 * (high - low) / (high + low) <= apart


def test_it_stays_in_mean_stress_and_deviator(read: Read) -> None:
    cones = body_cones(footing(ground(read), Ground(20.0)))
    assert cones.isotropic and cones.dilates
    assert cones.cones[0].standard.slope == pytest.approx(math.sqrt(2) * math.sin(math.radians(20)))
