"""What a notebook shows of the objects: a short line, without arrays."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import AugmentedLagrangian, BorderedNewton, Newton, limit_load
from perfplast_fenicsx.io.case.case_reader import read_case
from tests.models import l_plate_problem, punch_problem

SOLVERS = (Newton, BorderedNewton, AugmentedLagrangian)


def short(thing: object) -> str:
    text = repr(thing)
    assert len(text) < 200
    assert "\n" not in text
    assert "array(" not in text
    assert "object at 0x" not in text
    return text


def test_a_problem_and_its_level(comm: MPI.Intracomm) -> None:
    problem = punch_problem(2, comm=comm)
    assert short(problem).startswith("Problem(base, punch; ")
    assert "P1, " in short(problem)
    assert "4 contact pairs)" in short(problem)
    tagged_mesh = short(problem.tagged_mesh)
    assert tagged_mesh.startswith("TaggedMesh(")
    assert "; volumes base, punch; surfaces base_top, bottom, punch_bottom, " in tagged_mesh
    assert short(problem.constraints).startswith("Constraints(")
    solver = Newton(problem)
    level = solver.solve(100.0)
    assert short(level).startswith("Level(zeta=100, alpha=")
    assert "4/4 contacts" in short(level)
    assert short(level.report).startswith("LevelReport(zeta=100, alpha=")
    assert short(level.state).startswith("State(zeta=100, alpha=")
    assert short(level.iterations[0]).startswith("Iteration(1: zeta=100, ")
    failed = solver.solve(1000.0)
    assert "no solution" in repr(failed)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solver(solver: type, comm: MPI.Intracomm) -> None:
    name = solver.__name__
    assert short(solver(l_plate_problem(1, comm))).startswith(f"{name}(Problem(plate; ")


def test_a_limit_load(comm: MPI.Intracomm) -> None:
    text = repr(limit_load(l_plate_problem(1, comm), rtol=1e-2))
    assert text.startswith("LimitLoad(lower=1.")
    assert "array(" not in text


def test_a_case(comm: MPI.Intracomm) -> None:
    demos = Path(__file__).parents[2] / "demos"
    assert "Two blocks" in short(read_case(demos / "two_blocks.toml", comm))
    assert short(read_case(demos / "punch_limit.toml", comm)).endswith("until the limit load)")
