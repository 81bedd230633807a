"""Test bounds on the limit load of a body, and the message without bounds."""

import math
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import InputError, Pressure, Problem, Support, VonMises, machine_memory
from perfplast_fenicsx.limit_analysis import (
    BodyBounds,
    InteriorStep,
    bounds_of_mesh,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.limit_analysis.body import limit_bounds as search
from perfplast_fenicsx.problem import LoadCase
from tests.checks import assert_refused
from tests.limit_analysis.test_interior_point import BLOCK, COMM, K, blocks, footing, made
from tests.models import two_blocks_problem


def upper(bounds: BodyBounds) -> float:
    """Return the upper bound, which must exist."""
    assert bounds.upper.strict
    assert bounds.upper.value is not None
    return bounds.upper.value


def test_a_footing(shared_tmp_path: Path) -> None:
    told: list[InteriorStep] = []
    bounds = limit_bounds(footing(shared_tmp_path), monitor=told.append)
    assert 5.17 < upper(bounds) / K < 5.18  # the exact value is 5.1416
    assert bounds.mesh.upper is not None
    assert bounds.mesh.upper < upper(bounds)
    assert bounds.steps == len(told) <= 50
    assert bounds.factorisations <= 35
    assert all(left < 1e-9 for left in bounds.certificates.values())
    assert bounds.strict
    assert bounds.why_not == []
    assert bounds.lower.value is not None
    assert 3 < bounds.lower.value / K < 2 * math.sqrt(3)  # three cells of 60° at the edge
    words = f"between {bounds.lower.shown} and {bounds.upper.shown}; both bounds are strict."
    assert bounds.in_words().endswith(words)
    assert bounds.shares is not None
    gap = upper(bounds) - bounds.lower.value
    assert COMM.allreduce(bounds.shares.sum()) == pytest.approx(gap, rel=1e-9)
    assert COMM.allreduce(float(bounds.shares.min()), MPI.MIN) > -1e-9 * gap


def test_a_limit_load_bounds_that_of_the_body_from_above(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path)
    bounds = bounds_of_mesh(problem, limit_load(problem))
    assert not bounds.strict
    assert bounds.lower.value is None
    assert "lower bound: not computed" in bounds.why_not[0]
    assert f"collapses at {bounds.upper.shown} or less; this bound is strict" in bounds.in_words()


def test_contact_is_not_entered_between_nodes(shared_tmp_path: Path) -> None:
    problem = footing(shared_tmp_path, punch=True)
    bounds = limit_bounds(problem)
    assert bounds.problem is problem
    assert 5.1416 < upper(bounds) / K < 1.02 * 5.1416
    assert bounds.mesh.contact_forces is not None
    pushed = COMM.allreduce(bounds.mesh.contact_forces.sum())
    assert pushed == pytest.approx(bounds.mesh.lower, rel=1e-6)  # half a footing of width 2


def quadratic_blocks() -> Problem:
    """Return two cantilevers in contact, with few cells."""
    problem = two_blocks_problem(1)
    return Problem.from_given(problem.tagged_mesh, replace(problem.given, degree=2))


@pytest.mark.mpi2
def test_tetrahedra_are_split() -> None:
    problem = quadratic_blocks()
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.lower.strict
    assert bounds.lower.value is not None
    assert bounds.lower.value < 96 < upper(bounds)  # on finer meshes it lies between 78 and 96
    assert bounds.shares is not None
    assert bounds.stress is not None
    owned = [a.tagged_mesh.mesh.topology.index_map(3).size_local for a in (problem, bounds.problem)]
    assert [len(bounds.shares), len(bounds.stress)] == owned
    gap = upper(bounds) - bounds.lower.value  # a little is work on contact that opens
    shares = COMM.allreduce(bounds.shares.sum())
    assert 0.9 * gap < shares < (1 + 1e-9) * gap
    cells = [
        a.tagged_mesh.mesh.topology.index_map(3).size_global for a in (problem, bounds.problem)
    ]
    assert cells[1] == 4 * cells[0]
    assert bounds.mechanism.function_space == bounds.problem.V


def test_curved_cells(shared_tmp_path: Path) -> None:
    mesh = made(shared_tmp_path, write_thick_tube, size=0.2, order=2)
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, VonMises(young=70e3, poisson=0.3, yield_stress=250.0)),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        degree=2,
    )
    bounds = limit_bounds(problem)
    assert not bounds.upper.strict
    assert "upper bound: cells are curved" in bounds.why_not
    assert bounds.in_words().startswith("Nothing is proven for the body")


def test_loads_that_no_stress_can_carry() -> None:
    with pytest.raises(InputError, match="no stress can carry the loads"):
        limit_bounds(blocks(BLOCK, BLOCK, pressure=-1.0))


def test_a_search_that_stalls_gives_the_bound_it_has(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = footing(shared_tmp_path)
    monkeypatch.setattr("perfplast_fenicsx.limit_analysis.conic.interior_steps.MOST_STEPS", 6)
    bounds = limit_bounds(problem)
    assert "not met in 6 steps" in bounds.mesh.reason
    assert "is not the best on its mesh" in bounds.in_words()
    assert not bounds.mesh.levelled_off
    assert bounds.mesh.upper is not None
    middle = (bounds.mesh.lower + bounds.mesh.upper) / 2
    assert bounds.mesh.estimate == pytest.approx(middle)
    assert 5.1416 < upper(bounds) / K < 5.3
    assert problem.loads.alpha(bounds.mechanism.x.petsc_vec) == pytest.approx(1)


def test_a_search_in_space_that_stalls(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = quadratic_blocks()
    monkeypatch.setattr("perfplast_fenicsx.limit_analysis.conic.interior_steps.MOST_STEPS", 8)
    bounds = limit_bounds(problem, 1e-6)
    assert bounds.in_words().count("have not met in 8 steps") == 2
    assert bounds.strict
    assert bounds.lower.value is not None
    assert 40 < bounds.lower.value < upper(bounds) < 200
    assert all(left < 1e-9 for left in bounds.certificates.values())


def test_what_does_not_fit_into_memory_in_space(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program says so before the computation."""

    def compute(*_: object) -> None:
        raise AssertionError

    problem = quadratic_blocks()
    monkeypatch.setattr(search, "interior_point", compute)
    monkeypatch.setattr(machine_memory, "physical_memory", lambda: 2**10)
    assert_refused(lambda: limit_bounds(problem), ["unknowns needs", "coarser mesh"])


def test_loads_that_were_replaced_stay_where_they_are() -> None:
    problem = blocks(BLOCK, BLOCK)
    problem.loads = LoadCase(problem.loads.dead, 2.0 * problem.loads.live)
    with pytest.raises(InputError, match="loads of the problem were replaced"):
        limit_bounds(problem)


def test_loads_that_are_formulas() -> None:
    """A quadratic formula has only bounds for the mesh; linear ones have the same as numbers."""
    given = blocks(BLOCK, BLOCK).given

    def under(pressure: str) -> Problem:
        loads = [Pressure("top", pressure)]
        return Problem.from_given(blocks(BLOCK, BLOCK).tagged_mesh, replace(given, loads=loads))

    problem = under("1 + x*(1 - x)")
    bounds = bounds_of_mesh(problem, limit_load(problem))
    assert bounds.upper.value is not None
    assert not bounds.upper.strict
    assert "a formula that is not linear" in bounds.why_not[-1]
    with pytest.raises(InputError, match="tractions and pressures"):
        limit_bounds(problem)
    assert limit_bounds(under("1 + 0*x")).strict
