"""Test the duality gap with all terms: history, dead loads, u_D, e₀, gaps of both signs."""

from collections.abc import Sequence
from functools import cache

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Flow,
    Hardening,
    InitialStress,
    LoadingHistory,
    Newton,
    NewtonOptions,
    PorePressure,
    Pressure,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Temperature,
    VonMises,
    stacked_blocks,
    stage_path,
)
from perfplast_fenicsx.problem import certify

YOUNG, EXPANSION = 2e5, 1.2e-5


@cache
def blocks(n: int) -> TaggedMesh:
    return stacked_blocks(MPI.COMM_WORLD, n)


def problem(seed: int, degree: int) -> Problem:
    """Return two blocks that overlap in one part of the seam and are apart in another part."""
    random = np.random.default_rng(seed)
    a, b, c, d = random.uniform(0.8, 1.2, 4)
    bodies = [
        VonMises(YOUNG, 0.3, 280.0 * a, EXPANSION),
        Hardening(YOUNG, 0.2, 100.0 * b, 1e4 * c, 8e3 * d, EXPANSION),
    ]
    if seed % 2:
        bodies.reverse()
    return Problem(
        blocks(3 - degree),
        dict(zip(("lower", "upper"), map(Flow, bodies), strict=True)),
        [
            Support("x0", "x", 1e-4 * a),
            Support("y0", "y", -2e-4 * b),
            Support("bottom", "z", 1e-4 * c),
        ],
        [
            Pressure("top", "120 + 20*x", "push"),
            BodyForce("upper", (20.0 * a, -10.0, -30.0), "weight", constant=True),
            PorePressure("lower", "15*y"),
            BodyForce("lower", (-30.0 * d, 20.0, "10 + x"), "side"),
        ],
        [Contact("lower_top", "upper_bottom", "6e-4*(x - 0.4)", interference=True)],
        degree=degree,
        initial=[
            Temperature("lower", f"{30 * a}*z", "heat"),
            Temperature("upper", -20.0 * b),
            InitialStress("upper", ["-10*z", "5*x", 8.0, 0.0, 3.0, -6.0]),
        ],
    )


@pytest.mark.mpi2("1-1")
@pytest.mark.parametrize(
    ("seed", "degree"), [(1, 1), pytest.param(2, 1, marks=pytest.mark.serial), (3, 2)]
)
def test_all_terms_at_once(seed: int, degree: int) -> None:
    random = np.random.default_rng(seed)
    declared = problem(seed, degree)
    names = ("push", "side", "heat")
    ends: Sequence[Sequence[float]] = [
        (1.2, -0.4, 0.0),
        random.uniform(0.2, 1.2, 3).tolist(),
        (1.6, 0.6, 1.0),
    ]
    stages = [Stage(dict(zip(names, end, strict=True))) for end in ends]
    newton = Newton(declared, NewtonOptions(tolerance=1e-12))
    history = LoadingHistory(declared, stages)
    levels = list(stage_path(newton, history))
    for level in levels:
        assert level.report.converged, level.report.reason
        assert abs(level.report.duality_gap) < 1e-11
        assert level.report.equilibrium < 1e-10
        assert level.report.balance < 1e-10
    assert len(levels) == 4
    assert max(level.report.plastic_fraction for level in levels) > 0.02
    assert declared.comm.allreduce(int((declared.constraints.gap < 0).any()), MPI.LOR)
    contacts = [level.report.active_contacts for level in levels]
    assert 0 < min(contacts) < declared.num_pairs

    # an omitted term is noticed
    fields, zeta = newton.iterate.fields, levels[-1].state.zeta
    variables = declared.history
    before = {name: a.x.array.copy() for name, a in variables.items()}
    for name in before:
        variables[name].x.array[:] = 0
        assert abs(certify(declared, fields, zeta).duality_gap) > 1e-4, name
        variables[name].x.array[:] = before[name]
    assert declared.initial_strain is not None
    e0 = declared.initial_strain.x.array.copy()
    declared.initial_strain.x.array[:] = 0
    assert abs(certify(declared, fields, zeta).duality_gap) > 1e-4
    declared.initial_strain.x.array[:] = e0
    declared.prescribed[:] *= -1
    assert abs(certify(declared, fields, zeta).duality_gap) > 1e-4
    declared.prescribed[:] *= -1
    for loads in (declared.loads.dead, declared.loads.live):
        loads.scale(0.5)
        assert abs(certify(declared, fields, zeta).duality_gap) > 1e-4
        loads.scale(2.0)
    assert abs(certify(declared, fields, zeta).duality_gap) < 1e-11
