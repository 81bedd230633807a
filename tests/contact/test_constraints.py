"""Test rows with one host and three guests, as between surfaces whose nodes do not match."""

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx import fem

from perfplast_fenicsx import Contact, Newton, OutputFields, Pressure, Problem, Support, TaggedMesh
from perfplast_fenicsx.contact.rows.constraints import Constraints, joined, make_constraints
from perfplast_fenicsx.contact.surfaces.surface_facets import surface_nodes
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.problem import problem as problem_module
from tests.checks import assert_solved, largest
from tests.contact.test_jump_basis import assert_inverse
from tests.models import STEEL

COARSE = 3
"""Squares along each side of the lower block's top, which contains the guests."""


def unlike_blocks(comm: MPI.Intracomm) -> TaggedMesh:
    """Return two stacked unit cubes whose nodes do not match."""
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (COARSE, COARSE, 2)),
            Box("upper", (0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (4, 5, 3)),
        ],
        [
            Surface("bottom", ("lower",), lambda x: np.isclose(x[2], 0)),
            Surface("top", ("upper",), lambda x: np.isclose(x[2], 2)),
            Surface("lower_top", ("lower",), lambda x: np.isclose(x[2], 1)),
            Surface("upper_bottom", ("upper",), lambda x: np.isclose(x[2], 1)),
            Surface("x0", ("lower", "upper"), lambda x: np.isclose(x[0], 0)),
            Surface("y0", ("lower", "upper"), lambda x: np.isclose(x[1], 0)),
        ],
    )


def interpolated_rows(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
) -> Constraints:
    """Interpolate each lower node of the upper block in the triangle below; weights sum to 1."""
    comm = V.mesh.comm
    hosts = surface_nodes(V, tagged_mesh, "upper_bottom", fixed)
    guests = surface_nodes(V, tagged_mesh, "lower_top", fixed)
    guests = np.concatenate(comm.allgather(guests))
    grid = np.zeros((COARSE + 1, COARSE + 1), dtype=np.int64)
    place = np.rint(guests["x"][:, :2] * COARSE).astype(int)
    grid[place[:, 0], place[:, 1]] = guests["number"]

    x = hosts["x"][:, :2] * COARSE
    corner = np.minimum(np.floor(x + 1e-12).astype(int), COARSE - 1)
    s, t = (x - corner).T
    far = s + t > 1
    i, j = (corner + far[:, None]).T
    step, s, t = np.where(far, -1, 1), np.where(far, 1 - s, s), np.where(far, 1 - t, t)
    every, normal = np.arange(len(hosts)), np.tile([0.0, 0.0, -1.0], (len(hosts), 1))
    terms = [(every, hosts["number"], normal)]
    corners = ((i, j, 1 - s - t), (i + step, j, s), (i, j + step, t))
    terms += [(every, grid[k, m], -weight[:, None] * normal) for k, m, weight in corners]
    number = np.zeros(len(hosts), dtype=np.int32)
    return make_constraints(V, hosts["node"], np.zeros(len(hosts)), normal, number, terms)


@pytest.fixture
def pressed(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a problem of the two blocks, in which only the rows support the upper block."""

    def find_constraints(V: Any, mesh: Any, contacts: Any, obstacles: Any, fixed: Any) -> Any:
        return interpolated_rows(V, mesh, fixed)

    monkeypatch.setattr(problem_module, "find_constraints", find_constraints)

    def make(comm: MPI.Intracomm) -> Problem:
        return Problem(
            unlike_blocks(comm),
            {"lower": STEEL, "upper": STEEL},
            [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
            [Pressure("top", 1.0)],
            [Contact("upper_bottom", "lower_top")],
        )

    return make


def test_many_guests_become_bounds(pressed: Any, comm: MPI.Intracomm) -> None:
    problem = pressed(comm)
    basis, constraints, V = problem.basis, problem.constraints, problem.V
    assert problem.num_pairs == 5 * 6
    entries = np.diff(constraints.B.getValuesCSR()[0])
    assert comm.allreduce(int(entries.max(initial=0)), MPI.MAX) == 1 + 3
    assert_inverse(basis)
    # u and y describe the same set K_h
    u = problem.create_vector()
    u.setRandom(PETSc.Random().create(comm))
    u.array[:] -= 0.5
    u.array[problem.fixed[: V.dofmap.index_map.size_local].ravel()] = 0
    y = u.duplicate()
    basis.M.mult(u, y)
    assert y.array[basis.index] == pytest.approx(constraints.jumps(u), abs=1e-14)
    admissible = y.array[basis.index] <= basis.gap
    assert 0 < comm.allreduce(int(admissible.sum())) < problem.num_pairs
    again = u.duplicate()
    basis.T.mult(y, again)
    assert largest(comm, (again - u).array) < 1e-13


def test_forces_of_rows_are_in_balance(pressed: Any, comm: MPI.Intracomm) -> None:
    """Bᵀλ does no work on a rigid motion of both blocks: resultant force and moment vanish."""
    problem = pressed(comm)
    B, V = problem.constraints.B, problem.V
    forces, on_nodes = B.createVecLeft(), B.createVecRight()
    forces.setRandom(PETSc.Random().create(comm))
    B.multTranspose(forces, on_nodes)
    owned = V.dofmap.index_map.size_local
    modes = problem.bodies.rigid_modes(V.tabulate_dof_coordinates()[:owned])
    work = comm.allreduce(np.einsum("nim,ni->m", modes, on_nodes.array.reshape(-1, 3)))
    assert work == pytest.approx(np.zeros(6), abs=1e-13)
    # the forces on both sides agree
    shares = problem.constraints.shares
    ones, twice = shares.createVecRight(), shares.createVecLeft()
    ones.set(1.0)
    shares.mult(ones, twice)
    assert twice.array == pytest.approx(2.0)


@pytest.mark.mpi3
def test_blocks_that_do_not_match_are_pressed_together(pressed: Any, comm: MPI.Intracomm) -> None:
    """The certificate, the resultant and the pressure agree with a solution on one rank."""
    levels, peaks = [], []
    for problem in (pressed(comm), pressed(MPI.COMM_SELF)):
        level = Newton(problem).solve(100.0)
        assert_solved(level)
        assert level.report.active_contacts > 20
        output = OutputFields(problem)
        pressure = output.update(level)["contact_pressure"]
        # on the primary surface, pointing into the upper block
        assert output.resultants == pytest.approx(np.array([[0.0, 0.0, 100.0]]), abs=1e-8)
        peaks.append(largest(problem.comm, pressure.x.array))
        tagged_mesh = problem.tagged_mesh
        ds = ufl.Measure("ds", tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
        for surface in ("upper_bottom", "lower_top"):
            total = fem.assemble_scalar(fem.form(pressure * ds(tagged_mesh.surfaces[surface])))
            assert problem.comm.allreduce(total) == pytest.approx(100.0, rel=1e-9)
        levels.append(level)
    assert levels[0].report.alpha == pytest.approx(levels[1].report.alpha, rel=1e-9)
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-6)


def test_parts_are_joined_row_by_row(comm: MPI.Intracomm) -> None:
    """On each rank, the rows of the second part follow the rows of the first part completely."""
    tagged_mesh = unlike_blocks(comm)
    V = fem.functionspace(tagged_mesh.mesh, ("P", 1, (3,)))
    index_map = V.dofmap.index_map
    fixed = np.zeros((index_map.size_local + index_map.num_ghosts, 3), dtype=bool)
    single = interpolated_rows(V, tagged_mesh, fixed)
    u = single.B.createVecRight()
    u.setRandom(PETSc.Random().create(comm))
    of_single = single.jumps(u)
    count = len(single.host)
    second = Constraints(
        *(-2.0 * single.B, single.host, single.gap + 1, -single.normal, single.surface + 1),
        single.shares.copy(),
        single.weights.copy(),
        single.area,
    )
    both = joined(V, [single, second])
    expected = np.concatenate([of_single, -2 * of_single])
    assert both.jumps(u) == pytest.approx(expected, abs=1e-15)
    assert both.host.tolist() == 2 * both.host[:count].tolist()
    assert both.surface.tolist() == [0] * count + [1] * count
    assert both.gap == pytest.approx(np.repeat([0.0, 1.0], count))
    assert both.normal[count:] == pytest.approx(-both.normal[:count])


def test_no_parts_are_no_rows(comm: MPI.Intracomm) -> None:
    V = fem.functionspace(unlike_blocks(comm).mesh, ("P", 1, (3,)))
    none = joined(V, [])
    assert none.B.getSize() == (0, V.dofmap.index_map.size_global * 3)
    assert none.normal.shape == (0, 3)
