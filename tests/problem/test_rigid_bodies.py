"""Test rigid bodies at levels: limit of stiff bodies, forces, moments, supports, refusals."""

from dataclasses import replace
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints, meshtags

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BorderedNewton,
    Contact,
    Elastic,
    Force,
    Level,
    LoadingHistory,
    Newton,
    NewtonOptions,
    Plane,
    Pressure,
    Problem,
    RigidSurface,
    Stage,
    Support,
    TaggedMesh,
    Tie,
    VonMises,
    WorkNewton,
    limit_bounds,
    limit_load,
    stage_path,
)
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import check_elastic
from perfplast_fenicsx.materials.elastic import Rigid
from perfplast_fenicsx.materials.law import Material
from tests.checks import assert_refused
from tests.contact.blocks_apart import blocks_apart
from tests.models import PUNCH_LIMIT, PUNCH_SUPPORTS, punch
from tests.solvers.levels import TIGHT

COMM = MPI.COMM_WORLD
YOUNG = 2e5
STEEL = VonMises(young=YOUNG, poisson=0.3, yield_stress=300.0)
STIFF = Elastic(1e7 * YOUNG, 0.3)
COUNTS = {2: ((5, 3), (3, 2)), 3: ((3, 3, 2), (2, 2, 2))}
FORCE: dict[int, Any] = {2: (0.0, -100.0), 3: (0.0, 0.0, -100.0)}
SHEAR: dict[int, Any] = {2: (20.0, -100.0), 3: (20.0, 10.0, -100.0)}
MOMENT: dict[int, Any] = {2: 12.0, 3: (5.0, -8.0, 12.0)}
POINT: dict[int, Any] = {2: (0.4, 2.0), 3: (0.4, 0.6, 2.0)}


def problem_of(mesh: TaggedMesh, law: Material, **given: Any) -> Problem:
    """Return a block below another block of a given law, ready for levels."""
    laws = {"lower": STEEL, "upper": law}
    supports = [Support("bottom"), *given.pop("supports", [])]
    return Problem(mesh, laws, supports, **given).with_rigid_motions()


def check(problem: Problem, level: Level) -> None:
    """Check equilibrium of all bodies, and zero strain of rigid bodies."""
    report = level.report
    assert report.converged, report.reason
    assert abs(report.duality_gap) < 1e-9
    assert report.balance < 1e-10
    assert report.max_penetration < 1e-12
    assert problem.rigid_bodies is not None
    gdim = problem.bodies.gdim
    nodes = np.flatnonzero(problem.rigid_bodies.of_node >= 0)
    x = problem.V.tabulate_dof_coordinates()[nodes]
    u = level.state.u.x.array.reshape(-1, gdim)[nodes]
    modes = problem.bodies.rigid_modes(x)
    x_all, u_all = (np.concatenate(COMM.allgather(part)) for part in (modes, u))
    flat = x_all.reshape(-1, x_all.shape[2])
    motion = np.linalg.lstsq(flat, u_all.ravel(), rcond=None)[0]
    assert np.abs(flat @ motion - u_all.ravel()).max() < 1e-12 * np.abs(u_all).max()


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_limit_of_stiff_bodies(degree: int) -> None:
    """A stiff punch tends to a rigid one as 1/stiffness, also if the block yields."""
    mesh, base = punch(COMM, 2), VonMises(YOUNG, 0.3, PUNCH_LIMIT)

    def level(law: Material) -> tuple[Problem, Level]:
        load, contact = Pressure("top", 1.0), Contact("punch_bottom", "base_top")
        laws = {"base": base, "punch": law}
        problem = Problem(mesh, laws, PUNCH_SUPPORTS, [load], [contact], degree=degree)
        problem = problem.with_rigid_motions()
        return problem, Newton(problem, TIGHT).solve({1: 2000.0, 2: 1200.0}[degree])

    problem, rigid = level(Rigid())
    check(problem, rigid)
    assert rigid.report.plastic_cells > 0
    works = [level(Elastic(times * YOUNG, 0.3))[1].report.alpha for times in (1e3, 1e4, 1e5)]
    beyond = [work / rigid.report.alpha - 1 for work in works]
    assert 0 < beyond[2] < 1e-4
    assert beyond[0] / beyond[1] == pytest.approx(10.0, rel=0.02)
    assert beyond[1] / beyond[2] == pytest.approx(10.0, rel=0.02)
    if degree == 1:
        found = limit_load(problem, 1e-3, method="interior-point")
        assert found.upper is not None
        assert 2000.0 < found.lower <= found.upper
        assert limit_bounds(Problem.from_given(mesh, problem.given), 1e-2).strict


@pytest.mark.long(
    but=[
        "contact-2",
        "contact-3",
        "friction-2",
        "nodes-2",
        "nodes-3",
        "tie-2",
        "tie-3",
        "tie hosted above-2",
        "tie hosted above-3",
    ]
)
@pytest.mark.mpi2("contact-3")
@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("joint", ["contact", "friction", "nodes", "tie", "tie hosted above"])
def test_force_and_moment(gdim: int, joint: str) -> None:
    """Force and moment act on a body that is in contact or glued, for any order of surfaces."""
    counts = (COUNTS[gdim][0], COUNTS[gdim][0]) if joint == "nodes" else COUNTS[gdim]
    mesh = blocks_apart(COMM, *counts, moved_by=0.0 if joint == "nodes" else 0.5)
    pair = ("upper_bottom", "lower_top")
    given: dict[str, Any] = {"contacts": [Contact(*pair)]}
    if joint == "friction":
        given = {"contacts": [Contact(*pair, tresca=40.0)]}
    elif joint.startswith("tie"):
        given = {"contacts": [Tie(*(pair if joint == "tie" else pair[::-1]))]}
    glued = joint.startswith("tie")
    force = Force("top", SHEAR[gdim] if glued else FORCE[gdim], MOMENT[gdim], POINT[gdim])
    if joint in ("contact", "nodes") and gdim == 3:
        force = replace(force, moment=(*MOMENT[gdim][:2], 0.0))  # nothing resists others
    levels = []
    for law in (Rigid(), STIFF):
        problem = problem_of(mesh, law, loads=[force], **given)
        levels.append(Newton(problem, TIGHT).solve(1.0))
        if law == Rigid():
            check(problem, levels[0])
    rigid, stiff = (level.report for level in levels)
    assert rigid.alpha == pytest.approx(stiff.alpha, rel=1e-5)
    assert rigid.reactions["support bottom"] == pytest.approx(-np.array(force.value), abs=1e-8)


@pytest.mark.parametrize("gdim", [2, 3])
def test_bodies_that_share_nodes(gdim: int) -> None:
    """The rigid part of a block moves with the rest."""
    whole = blocks_apart(COMM, (4,) * gdim, (1,) * gdim, moved_by=0.0)
    mesh = whole.mesh
    count = mesh.topology.index_map(gdim).size_local + mesh.topology.index_map(gdim).num_ghosts
    every = np.arange(count, dtype=np.int32)
    middle = compute_midpoints(mesh, gdim, every)[:, gdim - 1]
    tags = whole.cell_tags.values.copy()
    tags[(middle > 0.5) & (middle < 1.0)] = 7
    parted = replace(
        whole,
        cell_tags=meshtags(mesh, gdim, every, tags),
        volumes={**whole.volumes, "cap": 7},
    )
    force = Force("top", FORCE[gdim], MOMENT[gdim] if gdim == 2 else (5.0, -8.0, 0.0), POINT[gdim])
    levels = []
    for law in (Rigid(), STIFF):
        laws = {"lower": STEEL, "upper": STEEL, "cap": law}
        contact = Contact("upper_bottom", "lower_top")
        problem = Problem(parted, laws, [Support("bottom")], [force], [contact])
        levels.append(Newton(problem.with_rigid_motions(), TIGHT).solve(1.0).report)
    assert levels[0].converged
    assert levels[0].alpha == pytest.approx(levels[1].alpha, rel=1e-5)
    assert levels[0].balance < 1e-10


@pytest.mark.mpi2("symmetry-3")
@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("how", ["symmetry", "pressed", "turned"])
def test_supports(gdim: int, how: str) -> None:
    """Supports hold and move a rigid body consistently, and carry its forces."""
    mesh = blocks_apart(COMM, *COUNTS[gdim])
    given: dict[str, Any] = {"contacts": [Contact("upper_bottom", "lower_top", tresca=40.0)]}
    if how == "symmetry":
        given["supports"] = [Support("upper_x0", "x")]
        given["loads"] = [Force("top", SHEAR[gdim], point=POINT[gdim])]
    elif how == "pressed":
        given["supports"] = [Support("top", "xyz"[gdim - 1], value=-1e-3, constant=False)]
    else:
        turn: Any = 2e-4 if gdim == 2 else (1e-4, -2e-4, 1e-4)
        down = [0.0] * (gdim - 1) + [-1e-3]
        given["supports"] = [RigidSurface("top", POINT[gdim], down, turn, constant=False)]
    reports = []
    for law in (Rigid(), STIFF):
        problem = problem_of(mesh, law, **given)
        level = Newton(problem, TIGHT).solve(1.0)
        reports.append(level.report)
        if law == Rigid():
            check(problem, level)
    rigid, stiff = reports
    size = max(np.abs(force).max() for force in stiff.reactions.values())
    assert size > 1.0
    for name, force in stiff.reactions.items():
        assert rigid.reactions[name] == pytest.approx(force, abs=1e-4 * size)
    if how == "symmetry":
        assert rigid.alpha == pytest.approx(stiff.alpha, rel=1e-5)
    else:
        assert rigid.driving_force == pytest.approx(stiff.driving_force, rel=1e-5)


@pytest.mark.parametrize("algorithm", ["alg1", "alg3", "alg4", "tfeti", "stages"])
def test_every_algorithm(algorithm: str) -> None:
    """All algorithms find the same state."""
    mesh = blocks_apart(COMM, *COUNTS[2])
    given = {
        "loads": [Force("top", FORCE[2], MOMENT[2], POINT[2])],
        "contacts": [Contact("upper_bottom", "lower_top")],
        "supports": [Support("upper_x0", "x")],
    }
    problem = problem_of(mesh, Rigid(), **given)
    known = Newton(problem, TIGHT).solve(2.0).report
    assert known.converged
    if algorithm == "alg1":
        found = AugmentedLagrangian(problem).solve(2.0).report
    elif algorithm == "tfeti":
        tearing = NewtonOptions(tolerance=1e-10, contact_solver="tfeti")
        found = Newton(problem, tearing).solve(2.0).report
    elif algorithm == "stages":
        history = LoadingHistory(problem, [Stage({"top": 2.0})])
        (level,) = stage_path(Newton(problem, TIGHT), history)
        found = level.report
    else:
        of = {"alg3": WorkNewton, "alg4": BorderedNewton}[algorithm]
        found = of(problem, TIGHT).solve(known.alpha).report
    assert found.converged, found.reason
    assert found.zeta * found.alpha == pytest.approx(2.0 * known.alpha, rel=1e-4)


def test_refusals() -> None:
    """Each sentence names the cause and a remedy."""
    mesh = blocks_apart(COMM, *COUNTS[2])
    contact = Contact("upper_bottom", "lower_top")

    def refused(words: list[str], **given: Any) -> None:
        told = {"contacts": [contact], "loads": [Pressure("top", 1.0)], **given}
        assert_refused(lambda: problem_of(mesh, Rigid(), **told), words)

    wall = Plane("upper_x1", (1.5, 0.0), (-1.0, 0.0))
    refused(["obstacle", "'upper_x1'", "rigid", "'elastic'"], obstacles=[wall])
    guide = Support("upper_x0", "normal")
    refused(["'normal'", "'upper_x0'", "letters"], supports=[guide])
    bent = Support("top", "y", value="0.001*x*x", constant=False)
    refused(["rigid", "rigid motion"], supports=[bent], loads=[])
    held = [Support("lower_top")]
    refused(["contact 1", "supports or ties hold"], supports=held)
    even = blocks_apart(COMM, (3, 2), (3, 2), moved_by=0.0)
    pressed = {"supports": held, "contacts": [contact], "loads": [Pressure("top", 1.0)]}
    assert_refused(
        lambda: problem_of(even, Rigid(), **pressed), ["contact 1", "law = 'rigid' at nodes"]
    )
    both = {"lower": Rigid(), "upper": Rigid()}
    problem = Problem(mesh, both, [Support("bottom")], [Pressure("top", 1.0)], [contact])
    assert_refused(lambda: Newton(problem), ["rigid", "undefined", "control = 'bounds'"])
    beside = Problem(
        mesh,
        {"lower": STEEL, "upper": Rigid()},
        [Support("bottom")],
        [Pressure("top", 1.0)],
        [contact],
    )
    assert_refused(lambda: Newton(beside), ["with_rigid_motions()"])
    assert_refused(lambda: check_elastic(beside.given.materials), ["'upper'", "'shakedown'"])
