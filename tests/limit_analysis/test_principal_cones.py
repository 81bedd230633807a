"""Test Mohr–Coulomb and Tresca in 3D and axisymmetry: limit loads, strict bounds, proofs."""

import math
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Tie,
    Tresca,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.proof.checker import check
from tests.conftest import Read

COMM = MPI.COMM_WORLD
SMOOTH = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
ROUGH = [Support("x0", "x"), Support("y0", "y"), Support("bottom")]
TIED = [Tie("lower_top", "upper_bottom")]


def ground(angle: float, cohesion: float = 20.0) -> Any:
    """Return ground with a friction angle (degrees); for the angle 0, Tresca ground."""
    return MohrCoulomb(1e4, 0.3, cohesion, angle) if angle else Tresca(1e4, 0.3, cohesion)


def column(
    lower: Any, upper: Any, *loads: Any, supports: Any = SMOOTH, n: int = 1, **more: Any
) -> Problem:
    """Return two stacked blocks, in one piece or in contact."""
    more = more or {"contacts": TIED}
    given = {"lower": lower, "upper": upper}
    return Problem(
        stacked_blocks(COMM, n),
        given,
        supports,
        list(loads) or [Pressure("top", 1.0)],
        degree=2,
        **more,
    )


def assert_proven(bounds: BodyBounds, path: Path) -> None:
    """Check the file with the checker. Collective."""
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    if COMM.rank == 0:
        checked = check(path / "bounds.h5")
        assert set(checked) == {"lower", "upper"}
        assert not any(half.faults for half in checked.values())
    COMM.barrier()


@pytest.mark.mpi2("0.0")
@pytest.mark.parametrize("angle", [0.0, 25.0])
def test_a_smooth_block(angle: float) -> None:
    """The limit load is 2c √N, N = (1 + sin φ)/(1 − sin φ)."""
    sine = math.sin(math.radians(angle))
    exact = 40 * math.sqrt((1 + sine) / (1 - sine))
    bounds = limit_bounds(column(ground(angle), ground(angle)))
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(exact, rel=1e-4)
    assert bounds.upper.value == pytest.approx(exact, rel=1e-4)
    assert bounds.lower.value <= exact <= bounds.upper.value


@pytest.mark.parametrize(("sign", "exact"), [(1.0, 62.787423), (-1.0, -62.787423)])
def test_both_signs_beside_a_dead_pressure(sign: float, exact: float) -> None:
    """A pressure on all sides costs nothing, and helps in one direction: 2c√N and 2c/√N."""
    slope = (1 + math.sin(math.radians(25))) / (1 - math.sin(math.radians(25)))
    dead = Pressure("top", 10.0, constant=True)
    exact = 62.787423 - 10 if sign > 0 else 40 / math.sqrt(slope) + 10
    bounds = limit_bounds(column(ground(25.0), ground(25.0), Pressure("top", sign), dead))
    assert bounds.strict
    assert bounds.lower.value <= exact <= bounds.upper.value
    assert bounds.upper.value - bounds.lower.value <= 2e-4 * exact


def test_rough_ends_are_between_strict_bounds(tmp_path: Path) -> None:
    path = Path(COMM.bcast(str(tmp_path)))
    bounds = limit_bounds(column(ground(20.0), ground(20.0), supports=ROUGH))
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None
    # for a finer mesh, n = 4 and 3 072 cells before the split
    assert low <= 57.1717 and high >= 57.1239
    assert high - low <= 0.03 * low
    assert_proven(bounds, path)


def test_contact_of_unlike_bodies(tmp_path: Path) -> None:
    """The weaker body yields in each case; steel on ground, ground on Tresca metal."""
    path = Path(COMM.bcast(str(tmp_path)))
    steel = VonMises(2e5, 0.3, 300.0)
    touching = {"contacts": [Contact("lower_top", "upper_bottom")]}
    bounds = limit_bounds(column(ground(25.0), steel, **touching))
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(62.787423, rel=1e-4)
    assert bounds.upper.value == pytest.approx(62.787423, rel=1e-4)
    assert_proven(bounds, path)
    found = interior_point(column(ground(0.0), ground(25.0), **touching))
    assert found.lower == pytest.approx(40, rel=1e-4)
    assert found.upper == pytest.approx(40, rel=1e-4)


def test_strength_is_a_unit() -> None:
    """Bounds do not change beside cohesions 1e6 times as large, and in other units."""
    touching = {"contacts": [Contact("lower_top", "upper_bottom")]}
    exact = 62.787423e-3
    strong = MohrCoulomb(1e4, 0.3, 2e4, 30.0)
    found = interior_point(column(ground(25.0, 0.02), strong, **touching))
    assert found.lower == pytest.approx(exact, rel=1e-4)
    assert found.upper == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(("angle", "exact"), [(0.0, 27.725887), (10.0, 28.761942)])
def test_thick_spheres_by_their_sections(read: Read, angle: float, exact: float) -> None:
    """C cot φ ((b/a)^m − 1), m = 4 sin φ/(1 + sin φ), and 4c ln(b/a), for the mesh."""
    mesh = read(write_thick_tube, outer=2.0, size=0.15, order=2).turned()
    found = interior_point(
        Problem(
            mesh,
            dict.fromkeys(mesh.volumes, ground(angle, 10.0)),
            [Support("y0", "y")],
            [Pressure("inner", 1.0)],
            degree=2,
        )
    )
    assert found.lower == pytest.approx(exact, rel=2e-3)
    assert found.upper == pytest.approx(exact, rel=2e-3)


@pytest.mark.long(but=["20.0-20.077"])
@pytest.mark.parametrize(("angle", "exact"), [(0.0, 5.6894), (10.0, 9.987), (20.0, 20.077)])
def test_smooth_circular_footings(read: Read, angle: float, exact: float) -> None:
    """A strong punch acts; exact values by characteristics (A. D. Cox, G. Eason, H. G. Hopkins)."""
    mesh = read(write_strip_footing, size=0.2, punch=True).turned()
    found = interior_point(
        Problem(
            mesh,
            {"ground": ground(angle, 1.0), "punch": Elastic(1e7, 0.3)},
            [Support("side", "x"), Support("bottom")],
            [Pressure("top", 1.0)],
            [Contact("ground_footing", "punch_footing")],
            degree=2,
        )
    )
    assert found.upper == pytest.approx(exact, rel=2e-2)
    assert found.lower == pytest.approx(exact, rel=2e-2)


@pytest.mark.parametrize("cut", [False, True])
def test_moduli_are_those_of_the_linear_system(cut: bool) -> None:
    """Stress, rates and multipliers of one step satisfy each part of the equations at a point."""
    from perfplast_fenicsx.arrays import matrices
    from perfplast_fenicsx.limit_analysis.conic.cone import Borne
    from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import (
        PrincipalCones,
        PrincipalPoints,
    )
    from perfplast_fenicsx.limit_analysis.discrete.standard_cones import never_yields

    random = np.random.default_rng(3)
    frame = never_yields(6, 3).frame
    sines = np.array([0.0, 0.4, 0.4])
    bounds, tensions = np.array([2.0, 3.0, 1.0]), np.full(3, np.inf)
    if cut:
        tensions[1:] = 0.1, 0.5
    cones = PrincipalCones(np.arange(3), bounds, sines, tensions, matrices(frame.T))
    blocks = PrincipalPoints(cones, np.ones(3))
    p, s, t = random.normal(size=3), random.normal(size=(3, 5)), random.normal(size=3)
    stress = p[:, None, None] * np.eye(3) + cones.deviators(s)
    values = np.linalg.eigvalsh(stress)
    borne = Borne(p, s, np.zeros(0))
    # with the middle t, both matrices are at the same distance from yield
    without = np.linalg.eigvalsh(blocks.static(borne, np.zeros(3)))[:, :, 0]
    X = blocks.static(borne, (without[:, 1] - without[:, 0]) / 2)
    room = np.linalg.eigvalsh(X)[:, :, 0]
    assert room.shape == (3, 3 if cut else 2)
    assert np.allclose(room[:, 0], room[:, 1], rtol=0, atol=1e-7)
    used = (1 + sines) * values[:, 2] - (1 - sines) * values[:, 0]
    ratios = used / bounds
    if cut:
        assert np.allclose(room[1:, 2], tensions[1:] - values[1:, 2])
        ratios[1:] = np.maximum(ratios, values[:, 2] / tensions)[1:]
    assert np.allclose(cones.ratios(p, s), ratios)
    assert np.allclose(2 * room[:, 0], cones.bounds - used, rtol=0, atol=1e-7)
    # works are the transpose of changes, and so are those of the least z
    Z = matrices(random.normal(size=(3, room.shape[1], 6)))
    works = blocks.works(Z)
    y = np.column_stack([t, p, s])
    changes = np.einsum("nkab,nkab->n", blocks.changes(y), Z)
    theirs = np.einsum("ni,ni->n", works, y)
    assert np.allclose(changes, theirs)
    wanted = random.normal(size=works.shape)
    wanted[0, 1] = 0.0  # nothing limits the mean stress there
    assert np.allclose(blocks.works(blocks.least(wanted)), wanted)
