"""Representation of objects in a notebook: a short line, without arrays."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    BorderedNewton,
    Newton,
    Pressure,
    Problem,
    Support,
    VonMises,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.io.case.case_reader import read_case
from tests.models import l_plate_problem, punch_problem
from tests.stones import box, stones

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
    assert short(problem.laws).startswith("(LawOnCells(VonMisesLaw: bulk, shear, yield_radius; ")
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


def test_tables_of_a_notebook(comm: MPI.Intracomm) -> None:
    """A cell's last line shows a problem, a level and bounds, with what is strict."""
    problem = punch_problem(2, comm=comm)
    shown = problem._repr_html_()
    assert "<th style='text-align:left'>material of base</th>" in shown
    assert shown.count(">support</th>") == len(problem.given.supports)
    assert shown.count(">contact</th>") == 1
    level = Newton(problem).solve(100.0)._repr_html_()
    assert "duality_gap</th>" in level
    square = Problem(
        stones(comm, [box([0, 0], [1, 1])], (1, 1)),
        {"0": VonMises(young=1e4, poisson=0.3, yield_stress=1.0)},
        [Support("0_y0", "y"), Support("0_x0", "x")],
        [Pressure("0_y1", 1.0)],
        degree=2,
    )
    bounds = limit_bounds(square)
    assert bounds.strict
    assert bounds._repr_html_().count(", strict</td>") == 2
    assert bounds.in_words() in bounds._repr_html_()


def test_a_case(comm: MPI.Intracomm) -> None:
    demos = Path(__file__).parents[2] / "demos"
    assert "Two blocks" in short(read_case(demos / "two_blocks.toml", comm))
    assert short(read_case(demos / "punch_limit.toml", comm)).endswith("until the limit load)")
