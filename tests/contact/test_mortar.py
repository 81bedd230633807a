"""Test dual mortar contact: patch tests on blocks with separate meshes, and refusals."""

from itertools import product
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Newton, OutputFields, Pressure, Problem, Support, VonMises
from tests.checks import assert_refused, assert_solved, largest
from tests.contact.blocks_apart import blocks_apart
from tests.contact.test_jump_basis import assert_inverse

SOFT = VonMises(young=1e5, poisson=0.3, yield_stress=1e4)
HARD = VonMises(young=3e5, poisson=0.25, yield_stress=1e4)
COUNTS = {2: ((5, 3), (7, 3)), 3: ((3, 3, 2), (4, 4, 2))}


def on_rollers(
    gdim: int, degree: int = 1, comm: MPI.Intracomm = MPI.COMM_WORLD, **contact: Any
) -> Problem:
    """Return two blocks of two materials on rollers; ζ is the pressure on top."""
    vertical = "xyz"[gdim - 1]
    sides = [f"{body}{axis}0" for axis in "xyz"[: gdim - 1] for body in ("", "upper_")]
    return Problem(
        blocks_apart(comm, *COUNTS[gdim]),
        {"lower": SOFT, "upper": HARD},
        [Support("bottom", vertical), *(Support(side, side[-2]) for side in sides)],
        [Pressure("top", 1.0)],
        [Contact("upper_bottom", "lower_top", **contact)],
        degree=degree,
    )


@pytest.mark.parametrize(
    ("gdim", "degree", "hosts"), list(product((2, 3), (1, 2), ("primary", "secondary")))
)
def test_constant_pressure_is_transmitted(
    gdim: int, degree: int, hosts: Any, comm: MPI.Intracomm
) -> None:
    """Patch test by Taylor and Papadopoulos: both blocks have uniform stress."""
    problem = on_rollers(gdim, degree, hosts=hosts)
    assert_inverse(problem.basis)
    assert not problem.has_gaps
    level = Newton(problem).solve(100.0)
    assert_solved(level)
    assert level.report.active_contacts == problem.num_pairs
    height = problem.V.tabulate_dof_coordinates()[:, gdim - 1]
    soft, hard = ((1 - body.poisson**2 * (gdim == 2)) / body.young * 100.0 for body in (SOFT, HARD))
    # Lower nodes on the seam lie at 1; upper nodes differ from them only by their body.
    expected = -soft * np.minimum(height, 1) - hard * np.maximum(height - 1, 0)
    u = level.state.u.x.array.reshape(-1, gdim)[:, -1]
    assert largest(comm, u - expected) < 1e-12 * (soft + hard)
    pressure = OutputFields(problem)
    assert pressure.update(level)["contact_pressure"].x.array.max(initial=0.0) < 100.0 * (1 + 1e-9)
    force = [0.0] * (gdim - 1) + [100.0]
    assert pressure.resultants == pytest.approx(np.array([force]), abs=1e-9)


@pytest.mark.mpi3("2-1")
@pytest.mark.parametrize(("gdim", "degree"), list(product((2, 3), (1, 2))))
def test_forces_and_moments_are_in_balance(gdim: int, degree: int, comm: MPI.Intracomm) -> None:
    problem = on_rollers(gdim, degree)
    B, V = problem.constraints.B, problem.V
    forces, on_nodes = B.createVecLeft(), B.createVecRight()
    forces.set(1.0)
    B.multTranspose(forces, on_nodes)
    owned = V.dofmap.index_map.size_local
    modes = problem.bodies.rigid_modes(V.tabulate_dof_coordinates()[:owned])
    work = comm.allreduce(np.einsum("nim,ni->m", modes, on_nodes.array.reshape(-1, gdim)))
    assert work == pytest.approx(np.zeros(modes.shape[2]), abs=1e-13)
    ones, sums = problem.constraints.shares.createVecs()
    ones.set(1.0)
    problem.constraints.shares.mult(ones, sums)
    assert sums.array == pytest.approx(2.0, abs=1e-12)


@pytest.mark.mpi2("2-1")
@pytest.mark.parametrize(("gdim", "degree"), list(product((2, 3), (1, 2))))
def test_gaps_that_close_in_part_are_certified(gdim: int, degree: int) -> None:
    problem = on_rollers(gdim, degree, gap="2e-3*x")
    assert problem.has_gaps
    level = Newton(problem).solve(50.0)
    assert_solved(level)
    assert 0 < level.report.active_contacts < problem.num_pairs
    assert abs(level.report.duality_gap) < 1e-11


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        ({"hosts": "primary", "gap": -0.1}, ["contact 1", "gap = -0.1", "negative"]),
        ({"formulation": "nodes"}, ["partner", "formulation = 'mortar'"]),
    ],
)
def test_bad_input_is_refused(contact: Any, words: list[str]) -> None:
    assert_refused(lambda: on_rollers(2, **contact), words)


def test_surfaces_must_be_opposite() -> None:
    def make() -> Problem:
        return Problem(
            blocks_apart(MPI.COMM_WORLD, *COUNTS[2]),
            {"lower": SOFT, "upper": HARD},
            [Support("bottom"), Support("upper_x0")],
            [Pressure("top", 1.0)],
            [Contact("bottom", "x0")],
        )

    assert_refused(make, ["contact 1", "nowhere opposite each other"])
