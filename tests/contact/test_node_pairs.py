"""Pairing, the contact basis with general normals, rigid bodies, and what is refused."""

import math
import sys
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    InputError,
    Newton,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    read_gmsh,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.contact.node_matching import match_rows
from perfplast_fenicsx.mesh.box_mesh import Box, Surface, structured_assembly
from perfplast_fenicsx.parallel import send_rows

sys.path.insert(0, str(Path(__file__).parents[2] / "meshes"))
from wedge import write_wedge

STEEL = VonMises(2e5, 0.3, 400.0)


@pytest.fixture
def wedge(shared_tmp_path: Path) -> TaggedMesh:
    """Two blocks that meet on an inclined plane."""
    comm = MPI.COMM_WORLD
    path = shared_tmp_path / "wedge.msh"
    if comm.rank == 0:
        write_wedge(path, 0.4)
    comm.barrier()
    return read_gmsh(comm, path)


def wedge_problem(assembly: TaggedMesh, **changes: object) -> Problem:
    arguments: dict[str, object] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [Support("bottom"), Support("x0", "x"), Support("y0", "y")],
        "loads": [Pressure("top", 1.0)],
        "contacts": [Contact("lower_seam", "upper_seam")],
    }
    return Problem(assembly, **(arguments | changes))  # type: ignore[arg-type]


@pytest.mark.mpi3
def test_points_find_their_partners_wherever_they_are() -> None:
    comm = MPI.COMM_WORLD
    generator = np.random.default_rng(0)
    points = generator.random((200, 3)) * (3, 1, 1)
    numbered = np.column_stack([points, np.arange(200), np.tile([0.0, 0.0, 1.0], (200, 1))])
    normals = slice(4, 7)
    first = numbered[np.arange(200) % comm.size == comm.rank]
    shuffled = numbered[generator.permutation(200)]
    shuffled[:, :3] += 1e-9 * generator.normal(size=(200, 3))
    shuffled[:, normals] *= -1
    second = shuffled[np.arange(200) % comm.size == comm.rank]
    matching = match_rows(comm, first, second, normals, 1e-7)
    assert (matching.first[:, 3] == matching.second[:, 3]).all()
    assert comm.allreduce(len(matching.first)) == 200
    assert (matching.alone, matching.farthest) == (0, 0.0)

    missing = match_rows(comm, first, second[1:], normals, 1e-7)
    assert missing.alone == comm.size
    assert missing.farthest > 1e-7
    twice = match_rows(comm, first, np.concatenate([second, second]), normals, 1e-7)
    assert twice.alone == 200


@pytest.mark.mpi3
def test_rows_arrive_where_they_are_sent() -> None:
    comm = MPI.COMM_WORLD
    rows = np.column_stack([np.full(comm.size, comm.rank), np.arange(comm.size)]).astype(float)
    arrived = send_rows(comm, rows, np.arange(comm.size))
    assert (arrived == [[rank, comm.rank] for rank in range(comm.size)]).all()


def assert_inverse(problem: Problem) -> None:
    basis = problem.basis
    product = basis.M.matMult(basis.T)
    vector, image = product.createVecs()
    free = ~problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
    vector.setRandom(PETSc.Random().create(problem.comm))
    vector.array[~free] = 0
    product.mult(vector, image)
    assert (
        problem.comm.allreduce(float(np.abs((image - vector).array[free]).max(initial=0))) < 1e-12
    )


@pytest.mark.mpi3
def test_basis_is_inverted_and_its_unknowns_are_jumps(wedge: TaggedMesh) -> None:
    problem = wedge_problem(wedge)
    assert_inverse(problem)
    assert problem.num_pairs > 20
    slope = math.atan2(0.5, 2.0)
    assert np.allclose(problem.pairs.normal, [-math.sin(slope), 0, math.cos(slope)])
    # a rigid lift of the upper body opens every pair by the normal's z component
    u = problem.create_vector()
    upper = problem.bodies.of_node == _body_of(problem, "upper")
    lifted = upper[: problem.V.dofmap.index_map.size_local]
    u.array.reshape(-1, 3)[lifted, 2] = 1.0
    y = u.duplicate()
    problem.basis.M.mult(u, y)
    held = ~(problem.pairs.host_free & problem.pairs.guest_free).all(axis=1)
    jumps = y.array[problem.basis.index][~held]
    assert np.allclose(jumps, -math.cos(slope))


def _body_of(problem: Problem, volume: str) -> int:
    nodes = problem.V.dofmap.list[problem.tagged_mesh.cells(volume)]
    found = problem.comm.allgather(problem.bodies.of_node[nodes[:1, 0]].tolist())
    return next(body for bodies in found for body in bodies)


@pytest.mark.mpi3
def test_inclined_contact_is_solved_and_certified(wedge: TaggedMesh) -> None:
    level = Newton(wedge_problem(wedge)).solve(200.0)
    report = level.report
    assert report.converged
    assert report.active_contacts > 0
    assert report.smallest_contact_force > -1e-8
    assert report.max_penetration < 1e-12
    assert abs(report.duality_gap) < 1e-9
    assert report.equilibrium < 1e-7


def test_inclined_contact_gives_the_same_on_one_rank_alone(
    wedge: TaggedMesh, shared_tmp_path: Path
) -> None:
    alone = read_gmsh(MPI.COMM_SELF, shared_tmp_path / "wedge.msh")
    together = Newton(wedge_problem(wedge)).solve(150.0)
    single = Newton(wedge_problem(alone)).solve(150.0)
    assert together.state.alpha == pytest.approx(single.state.alpha, rel=1e-8)
    assert together.report.newton_iterations == single.report.newton_iterations


def test_where_supports_hold_one_side_the_other_one_carries_the_jump() -> None:
    assembly = two_blocks(MPI.COMM_WORLD, 2)
    steel = {"lower": STEEL, "upper": STEEL}
    clamped_hosts = Problem(
        assembly,
        steel,
        [Support("left"), Support("top"), Support("upper_bottom", "z")],
        [BodyForce("lower", (0.0, 0.0, 1.0))],
        [Contact("upper_bottom", "lower_top", "0.001 + 0*x")],
    )
    assert (clamped_hosts.pairs.sign == -1).all()
    assert_inverse(clamped_hosts)
    level = Newton(clamped_hosts).solve(10.0)
    assert level.report.converged
    assert level.report.max_penetration < 1e-12
    assert 0 < level.report.active_contacts < level.report.contact_pairs


def stack(**changes: object) -> Problem:
    arguments: dict[str, object] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        "loads": [Pressure("top", 1.0)],
        "contacts": [Contact("lower_top", "upper_bottom")],
    }
    assembly = stacked_blocks(MPI.COMM_WORLD, 2)
    return Problem(assembly, **(arguments | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contacts": []}, ["rigid body", "translation in z", "add a support"]),
        (
            {"supports": [Support("x0", "x"), Support("bottom", "z")]},
            ["rigid body", "translation in y"],
        ),
        ({"materials": {"lower": STEEL}}, ["volume 'upper' has no material", "lower, upper"]),
        ({"materials": {"lowr": STEEL}}, ["'lowr'", "lower, upper"]),
        ({"loads": []}, ["no load"]),
        ({"loads": [Pressure("top", math.nan)]}, ["pressure on 'top'", "nan"]),
        ({"loads": [Pressure("top", 0.0)]}, ["no work"]),
        ({"loads": [Traction("top", (1.0, 2.0))]}, ["traction on 'top'", "3 finite numbers"]),
        ({"loads": [Traction("tip", (1.0, 2.0, 0.0))]}, ["'tip'", "lower_top"]),
        ({"loads": [BodyForce("top", (1.0, 2.0, 0.0))]}, ["'top'", "lower, upper"]),
        ({"supports": [Support("bottom", "w")]}, ["'w'", "'bottom'", "xyz"]),
        ({"contacts": [Contact("lower_top", "x0")]}, ["contact 1", "no partner", "away"]),
        ({"contacts": [Contact("lower_top", "lower_top")]}, ["contact 1", "itself"]),
        ({"contacts": [Contact("lower_top", "uper_bottom")]}, ["'uper_bottom'"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", -0.1)]}, ["gap = -0.1", "negative"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", "x-1")]}, ["gap = x-1", "negative"]),
        ({"contacts": [Contact("lower_top", "upper_bottom", "open('f')")]}, ["open"]),
        ({"contacts": [Contact("lower_top", "upper_bottom")] * 2}, ["more", "conditions"]),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(
    changes: dict[str, object], words: list[str]
) -> None:
    with pytest.raises(InputError) as refusal:
        stack(**changes)
    sentence = str(refusal.value)
    for word in words:
        assert word in sentence
    assert "\n" not in sentence
    assert len(set(MPI.COMM_WORLD.allgather(sentence))) == 1


def test_surfaces_that_look_the_same_way_are_refused() -> None:
    """Two bodies in the same place: the nodes of their top faces match, the normals do not."""
    corners, cubes = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), (2, 2, 2)
    names = ("one", "other")
    assembly = structured_assembly(
        MPI.COMM_WORLD,
        [Box(name, *corners, cubes) for name in names],
        [Surface(f"{name}_top", (name,), lambda x: x[2] == 1) for name in names]
        + [Surface("bottom", names, lambda x: x[2] == 0)],
    )
    with pytest.raises(InputError, match="point to the same side, so they do not face each other"):
        Problem(
            assembly,
            dict.fromkeys(names, STEEL),
            [Support("bottom")],
            [BodyForce("one", (0.0, 0.0, 1.0))],
            [Contact("one_top", "other_top")],
        )
