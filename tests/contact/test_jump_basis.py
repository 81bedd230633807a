"""Test the basis in which contact is a bound, for rows with one guest and with many guests."""

import math
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Problem, TaggedMesh, stacked_blocks
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints, named
from perfplast_fenicsx.contact.rows.jump_basis import JumpBasis, make_basis
from perfplast_fenicsx.problem.assembled.spaces import make_spaces
from tests.checks import assert_refused, largest
from tests.models import touching_blocks, wedge_problem


def assert_inverse(basis: JumpBasis) -> None:
    """Check that M T y = y."""
    product = basis.M.matMult(basis.T)
    y, image = product.createVecs()
    y.setRandom(PETSc.Random().create(y.comm))
    product.mult(y, image)
    assert largest(y.comm.tompi4py(), (image - y).array) < 1e-12


def body_of(problem: Problem, volume: str) -> int:
    """Return the index of the body to which a volume belongs."""
    nodes = problem.V.dofmap.list[problem.tagged_mesh.cells(volume)]
    found = problem.comm.allgather(problem.bodies.of_node[nodes[:1, 0]].tolist())
    return next(body for bodies in found for body in bodies)


@pytest.mark.mpi3
def test_basis_is_inverted_and_its_unknowns_are_jumps(wedge: TaggedMesh) -> None:
    problem = wedge_problem(wedge)
    assert_inverse(problem.basis)
    assert problem.num_pairs > 20
    slope = math.atan2(0.5, 2.0)
    assert np.allclose(problem.constraints.normal, [-math.sin(slope), 0, math.cos(slope)])
    # a rigid lift of the upper body opens each pair by the z component of the normal
    u = problem.create_vector()
    owned = problem.V.dofmap.index_map.size_local
    lifted = problem.bodies.of_node[:owned] == body_of(problem, "upper")
    u.array.reshape(-1, 3)[lifted, 2] = 1.0
    y = u.duplicate()
    problem.basis.M.mult(u, y)
    assert np.allclose(y.array[problem.basis.index], -math.cos(slope))


def test_a_node_has_the_conditions_of_one_contact() -> None:
    contacts = [Contact("lower_top", "upper_bottom")] * 2
    assert_refused(
        lambda: touching_blocks(contacts=contacts),
        ["contact 2", "has the same surfaces as contact 1"],
    )


# --- rows of any kind -------------------------------------------------------------------------


def random_constraints(seed: int, comm: MPI.Intracomm) -> tuple[Any, Constraints, Any]:
    """Return rows of random nodes; one third each are hosts, hosts and guests, and guests.

    Chains of rows therefore have at most two links. Some hosts have two rows with perpendicular
    normals. Supports hold guests in some components. They hold hosts with one row in the component
    in which the normal is smallest.
    """
    V = make_spaces(stacked_blocks(comm, 3).mesh, 1).V
    index_map = V.dofmap.index_map
    generator = np.random.default_rng(seed)  # equal on every rank, for all nodes
    count = index_map.size_global
    kind = generator.integers(3, size=count)
    normal = generator.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    second = np.cross(normal, generator.normal(size=(count, 3)))
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    twice = generator.random(count) < 0.3
    fixed = generator.random((count, 3)) < 0.3
    smallest = np.abs(normal) <= np.abs(normal).min(axis=1, keepdims=True)
    fixed[kind < 2] &= (smallest & ~twice[:, None])[kind < 2]
    number_of_guests = np.where(kind < 2, generator.integers(6, size=count), 0)
    guests = [
        generator.choice(np.flatnonzero(kind > kind[k]), number_of_guests[k], replace=False)
        for k in range(count)
    ]
    weights = [generator.normal(size=m) for m in number_of_guests]

    first, last = index_map.local_range
    mine = np.arange(first, last)[kind[first:last] < 2]
    hosts = np.concatenate([mine, mine[twice[mine]]])
    normals = np.concatenate([normal[mine], second[mine[twice[mine]]]])
    every = np.arange(len(hosts))
    row = np.repeat(every, number_of_guests[hosts])
    node = np.concatenate([np.zeros(0, dtype=np.int64), *(guests[k] for k in hosts)])
    weight = np.concatenate([np.zeros(0), *(weights[k] for k in hosts)])
    constraints = make_constraints(
        V,
        (hosts - first).astype(np.int32),
        generator.random(count)[hosts],
        normals,
        np.zeros(len(hosts), dtype=np.int32),
        [(every, hosts, normals), (row, node, -weight[:, None] * normals[row])],
    )
    local = index_map.local_to_global(np.arange(index_map.size_local + index_map.num_ghosts))
    return V, constraints, fixed[local]


@pytest.mark.mpi3("0")
@pytest.mark.parametrize("seed", range(5))
def test_any_rows_become_bounds(seed: int, comm: MPI.Intracomm) -> None:
    V, constraints, fixed = random_constraints(seed, comm)
    basis = make_basis(V, constraints, fixed)
    assert_inverse(basis)
    y, u = basis.T.createVecs()
    y.setRandom(PETSc.Random().create(comm))
    supported = fixed[: V.dofmap.index_map.size_local].ravel()
    y.array[supported] = 0
    basis.T.mult(y, u)
    # supports hold u, and K_h is a bound on y
    assert largest(comm, u.array[supported]) < 1e-15
    assert constraints.jumps(u) == pytest.approx(y.array[basis.index], abs=1e-11)
    back = y.duplicate()
    basis.M.mult(u, back)
    assert largest(comm, (back - y).array) < 1e-11
    # at supports, gradients in y and u are equal: supported components do not change the basis
    gradient, transformed = u.duplicate(), y.duplicate()
    gradient.setRandom(PETSc.Random().create(comm))
    basis.T.multTranspose(gradient, transformed)
    assert transformed.array[supported] == pytest.approx(gradient.array[supported], abs=1e-15)
    assert len(np.unique(basis.index)) == len(basis.index) == len(constraints.host)


def test_rows_in_a_ring_fade_where_normals_turn(comm: MPI.Intracomm) -> None:
    """Three nodes where three bodies meet, each the guest of the previous node."""
    V = make_spaces(stacked_blocks(comm, 1).mesh, 1).V
    first, owned = V.dofmap.index_map.local_range[0], V.dofmap.index_map.size_local
    host = np.array([k for k in range(3) if 0 <= k - first < owned], dtype=np.int64)
    every, normal = np.arange(len(host)), (np.eye(3) + 0.2)[host]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    constraints = make_constraints(
        V,
        (host - first).astype(np.int32),
        np.zeros(len(host)),
        normal,
        np.zeros(len(host), dtype=np.int32),
        [(every, host, normal), (every, (host + 1) % 3, -normal)],
    )
    fixed = np.zeros((owned + V.dofmap.index_map.num_ghosts, 3), bool)
    basis = make_basis(V, constraints, fixed)
    assert_inverse(basis)
    y, u = basis.T.createVecs()
    y.setRandom(PETSc.Random().create(comm))
    basis.T.mult(y, u)
    assert constraints.jumps(u) == pytest.approx(y.array[basis.index], abs=1e-12)


def test_rows_in_a_ring_are_refused(comm: MPI.Intracomm) -> None:
    """Each of the first two nodes is the guest of the other, along the same normal."""
    V = make_spaces(stacked_blocks(comm, 1).mesh, 1).V
    first = V.dofmap.index_map.local_range[0]
    host = np.array([k for k in (0, 1) if 0 <= k - first < V.dofmap.index_map.size_local])
    host = host.astype(np.int64)
    every, normal = np.arange(len(host)), np.tile([0.0, 0.0, 1.0], (len(host), 1))
    constraints = make_constraints(
        V,
        (host - first).astype(np.int32),
        np.zeros(len(host)),
        normal,
        np.zeros(len(host), dtype=np.int32),
        [(every, host, normal), (every, 1 - host, -0.9 * normal)],
    )
    fixed = np.zeros((V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts, 3), bool)
    assert_refused(lambda: make_basis(V, constraints, fixed), ["ring", "remove one"])


def test_more_rows_than_freedom_are_refused(comm: MPI.Intracomm) -> None:
    """Four normals at one node."""
    V = make_spaces(stacked_blocks(comm, 1).mesh, 1).V
    index_map = V.dofmap.index_map
    host = np.zeros(4 if index_map.local_range[0] == 0 else 0, dtype=np.int64)
    every, normal = np.arange(len(host)), np.vstack([np.eye(3), np.full((1, 3), 3**-0.5)])
    normal = normal[: len(host)]
    kind = np.zeros(len(host), dtype=np.int32)
    terms = [(every, host, normal)]
    constraints = make_constraints(V, host.astype(np.int32), kind * 1.0, normal, kind, terms)
    fixed = np.zeros((index_map.size_local + index_map.num_ghosts, 3), bool)
    words = ["at 1 node: contact in three directions", "perfplast mesh --glued"]
    assert_refused(lambda: make_basis(V, constraints, fixed), words)
    whole = named(comm, constraints)
    words = ["at 1 node of surface 0: contact"]
    assert_refused(lambda: make_basis(V, whole, fixed), words)
