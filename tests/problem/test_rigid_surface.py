"""Test rigid surfaces: forces and moments, the same motion prescribed, contact, refusals."""

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.footing import write_footing
from meshes.ring import write_ring
from perfplast_fenicsx import (
    Contact,
    Force,
    InputError,
    Level,
    Newton,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    TaggedMesh,
    VonMises,
    limit_load,
)
from tests.checks import largest
from tests.contact.blocks_apart import blocks_apart
from tests.models import Read
from tests.solvers.levels import TIGHT

STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=300.0)
COUNTS = {2: ((5, 3), (3, 2)), 3: ((3, 3, 2), (2, 2, 2))}
POINT = {2: (0.3, 1.5), 3: (0.3, 0.6, 1.5)}
FORCE = {2: (20.0, -100.0), 3: (20.0, 10.0, -100.0)}
MOMENT: dict[int, Any] = {2: 12.0, 3: (5.0, -8.0, 12.0)}


def stacked(mesh: TaggedMesh, degree: int, *loads: Force, **motion: Any) -> Problem:
    """Return a block with a rigid top, on which another block is pressed and slides."""
    gdim = mesh.mesh.geometry.dim
    sides = [Support(f"upper_{axis}0", axis) for axis in "xyz"[: gdim - 1]]
    return Problem(
        mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), *sides, RigidSurface("lower_top", POINT[gdim], **motion)],
        [Pressure("top", 30.0, constant=True), *loads],
        [Contact("lower_top", "upper_bottom")],
        degree=degree,
    )


def on_top(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the local nodes of the rigid surface, and their positions relative to the point."""
    fdim = problem.tagged_mesh.mesh.topology.dim - 1
    nodes = fem.locate_dofs_topological(problem.V, fdim, problem.tagged_mesh.facets("lower_top"))
    gdim = fdim + 1
    return nodes, problem.V.tabulate_dof_coordinates()[nodes, :gdim] - POINT[gdim]


def fitted(problem: Problem, level: Level) -> tuple[np.ndarray, np.ndarray, float]:
    """Return displacement and rotation of the plate, and the relative deviation of its nodes."""
    comm, (nodes, arms) = problem.comm, on_top(problem)
    gdim = arms.shape[1]
    u = level.state.u.x.array.reshape(-1, gdim)[nodes]
    arms, u = (np.concatenate(comm.allgather(part)) for part in (arms, u))
    if gdim == 2:
        turns = [np.column_stack([-arms[:, 1], arms[:, 0]])]
    else:
        turns = [np.cross(axis, arms) for axis in np.eye(3)]
    shifts = [np.tile(axis, (len(arms), 1)) for axis in np.eye(gdim)]
    modes = np.array([*shifts, *turns]).reshape(-1, u.size).T
    found = np.linalg.lstsq(modes, u.ravel(), rcond=None)[0]
    apart = np.abs(modes @ found - u.ravel()).max() / np.abs(u).max()
    return found[:gdim], found[gdim:], float(apart)


def check(level: Level) -> None:
    report = level.report
    assert report.converged, report.reason
    assert abs(report.duality_gap) < 1e-9
    assert report.equilibrium < 1e-8
    assert report.balance < 1e-10
    assert report.max_penetration < 1e-12


@pytest.mark.mpi3("lower_top")
@pytest.mark.parametrize("rigid", ["lower_top", "upper_bottom"])
def test_nodes_follow_nodes_that_follow(rigid: str) -> None:
    """A rigid surface is in contact with matching nodes: the matrix has enough entries."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, (1, 2), (1, 2)),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("top", "x"), RigidSurface(rigid)],
        [Pressure("top", 30.0)],
        [Contact("lower_top", "upper_bottom", formulation="nodes")],
    )
    check(Newton(problem, TIGHT).solve(1.0))


@pytest.mark.mpi2("2-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("gdim", [2, 3])
def test_loaded_or_moved(gdim: int, degree: int) -> None:
    """Force and moment move the plate; the same motion causes the same force and moment."""
    force = Force("lower_top", FORCE[gdim], MOMENT[gdim], POINT[gdim])
    mesh = blocks_apart(MPI.COMM_WORLD, *COUNTS[gdim])  # one, as parts may differ
    loaded = stacked(mesh, degree, force)
    level = Newton(loaded, TIGHT).solve(1.2)
    check(level)
    shift, turn, apart = fitted(loaded, level)
    assert apart < 1e-12
    down = np.eye(gdim)[-1] * -30.0
    assert level.report.reactions["loads"] == pytest.approx(1.2 * np.array(FORCE[gdim]) + down)
    assert level.report.active_contacts > 0
    known = {"displacement": shift, "rotation": turn, "constant": False}
    moved = stacked(mesh, degree, **known)
    again = Newton(moved, TIGHT).solve(1.0)
    check(again)
    assert again.report.reactions["rigid surface lower_top"] == pytest.approx(
        1.2 * np.array(FORCE[gdim]), rel=1e-6
    )
    work = 1.2 * (shift @ FORCE[gdim] + turn @ np.atleast_1d(MOMENT[gdim]))
    assert again.report.driving_force == pytest.approx(work, rel=1e-6)
    assert 1.2 * level.state.alpha == pytest.approx(work, rel=1e-9)
    size = largest(loaded.comm, level.state.u.x.array)
    gap = level.state.u.x.array - again.state.u.x.array
    assert largest(loaded.comm, gap) < 1e-6 * size


@pytest.mark.parametrize("gdim", [2, 3])
def test_held_across_planes_of_symmetry(gdim: int) -> None:
    """The surface moves along shared symmetry planes; the same motion causes the same force."""
    sides = [Support(f"upper_{axis}0", axis) for axis in "xyz"[: gdim - 1]]

    mesh = blocks_apart(MPI.COMM_WORLD, *COUNTS[gdim])  # one, as parts may differ

    def pressed(loads: list[Force], **motion: Any) -> Problem:
        return Problem(
            mesh,
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom"), *sides, RigidSurface("top", **motion)],
            loads,
            [Contact("lower_top", "upper_bottom")],
        )

    force = Force("top", FORCE[gdim])
    level = Newton(problem := pressed([force], held="xyz"[: gdim - 1]), TIGHT).solve(1.2)
    check(level)
    aside = np.sum([level.report.reactions[name] for name in problem.support_names[1:]], axis=0)
    assert abs(aside[-1]) < 1e-9 * np.abs(FORCE[gdim]).max()
    shift = level.state.alpha / FORCE[gdim][-1]
    moved = {"displacement": np.eye(gdim)[-1] * shift, "constant": False}
    again = Newton(pressed([], **moved), TIGHT).solve(1.0)
    check(again)
    found = again.report.reactions["rigid surface top"]
    assert found[-1] == pytest.approx(1.2 * FORCE[gdim][-1], rel=1e-6)
    gap = level.state.u.x.array - again.state.u.x.array
    assert largest(problem.comm, gap) < 1e-6 * largest(problem.comm, level.state.u.x.array)


def test_a_disc_is_pressed_along_the_axis(read: Read) -> None:
    """The force is for the full turn; a moving support has the same reaction."""
    disc = read(write_ring, inner=0.0, outer=1.0, size=0.5).turned()
    held, force = [Support("bottom", "y")], [Force("top", (0.0, -500.0))]

    def problem(supports: list[Support], loads: list[Force], *rigid: RigidSurface) -> Problem:
        materials = {"ring": STEEL}
        return Problem(disc, materials, [*held, *supports, *rigid], loads, degree=2)

    loaded = Newton(problem([], force, RigidSurface("top", held="x")), TIGHT).solve(1.0)
    check(loaded)
    shift = Support("top", "y", loaded.state.alpha / -500.0, constant=False, name="along")
    moved = Newton(problem([Support("top", "x"), shift], []), TIGHT).solve(1.0)
    check(moved)
    assert moved.report.reactions["support along"][1] == pytest.approx(-500.0, rel=1e-6)
    for rigid in (RigidSurface("top"), RigidSurface("top", held="y")):
        with pytest.raises(InputError, match="only along the axis"):
            problem([], force, rigid)


@pytest.fixture
def ground(read: Read) -> TaggedMesh:
    return read(write_footing, size=1.0)


def footing(ground: TaggedMesh, across: float, moment: float, held: str = "") -> Problem:
    return Problem(
        ground,
        {"ground": STEEL},
        [Support("bottom"), Support("sides", "x"), RigidSurface("footing", held=held)],
        [Force("footing", (across, -1.0), moment)],
        degree=2,
    )


def test_footings(ground: TaggedMesh) -> None:
    """The load is central, or eccentric to either side."""
    central = limit_load(footing(ground, 0.0, 0.0), 1e-3)
    prandtl = (2 + np.pi) * STEEL.yield_stress / np.sqrt(3) * 2
    assert prandtl < central.lower < 1.07 * prandtl  # the mesh is coarse
    straight = limit_load(footing(ground, 0.0, 0.0, held="x"), 1e-3)
    assert straight.estimate == pytest.approx(central.estimate, rel=1e-3)
    one, other = (limit_load(footing(ground, sign * 0.2, sign * 0.2), 1e-3) for sign in (1, -1))
    assert one.lower == pytest.approx(other.lower, rel=1e-8)
    assert one.upper == pytest.approx(other.upper, rel=1e-8)
    assert one.lower < 0.8 * central.lower


@pytest.mark.parametrize(
    ("rigid", "loads", "words"),
    [
        ([RigidSurface("bottom")], [], "'bottom' shares nodes with a support"),
        ([RigidSurface("top"), RigidSurface("top")], [], "'top' shares nodes with"),
        ([RigidSurface("tp")], [], "'tp'"),
        ([RigidSurface("top", displacement=(0.0, 1.0, 0.0))], [], "displacement of the rigid"),
        ([RigidSurface("top", rotation=(1.0, 1.0))], [], "rotation of the rigid surface 'top'"),
        ([RigidSurface("top", components="y")], [], "only to a prescribed motion"),
        ([RigidSurface("top", rotation=0.1)], [Force("top", (0.0, -1.0))], "motion is prescribed"),
        ([RigidSurface("top")], [Force("top", (0.0, 1.0, 0.0))], "value of the force on 'top'"),
        ([RigidSurface("top")], [Force("top", (0.0, 1.0), (1.0, 0.0))], "moment of the force"),
        ([RigidSurface("top", held="x")], [Force("top", (0.0, 1.0), 1.0)], "from rotating"),
        ([RigidSurface("top", rotation=0.1, held="x")], [], "and a prescribed motion"),
        ([RigidSurface("bottom", held="x")], [], "'bottom' shares nodes with a support"),
        ([RigidSurface("top", held="z")], [], "= 'z' of the rigid surface 'top'"),
        ([RigidSurface("top", held="x")], [Force("top", (1.0, 0.0))], "in which held = 'x' fixes"),
        ([RigidSurface("top", held="x")], [Force("top", (), 1.0)], "has a moment, but"),
    ],
)
def test_what_is_refused(rigid: list[RigidSurface], loads: list[Force], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Problem(
            blocks_apart(MPI.COMM_WORLD, *COUNTS[2]),
            {"lower": STEEL, "upper": STEEL},
            [Support("bottom"), Support("upper_bottom"), *rigid],
            loads or [Force("top", (0.0, -1.0))],
        )
