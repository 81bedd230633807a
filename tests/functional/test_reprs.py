"""Test the representation of objects in a notebook: a short line, without arrays."""

import dataclasses
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Adaptation,
    AdaptiveBounds,
    AugmentedLagrangian,
    BorderedNewton,
    Contact,
    InputError,
    LoadDomain,
    LoadingPath,
    Newton,
    Pressure,
    Problem,
    ShakedownLoad,
    Support,
    VonMises,
    adaptive_bounds,
    envelope,
    factor_of_safety,
    limit_bounds,
    limit_load,
    load_path,
    shakedown_load,
    stacked_blocks,
)
from perfplast_fenicsx.errors import UNLISTED
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.problem import LevelReport
from perfplast_fenicsx.tables import NotebookResult
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
    """The last line of a cell shows a problem, a level and bounds, and which bounds are strict."""
    problem = punch_problem(2, comm=comm)
    shown = problem._repr_html_()
    assert "<th style='text-align:left'>material of base</th>" in shown
    assert shown.count(">support</th>") == len(problem.given.supports)
    assert shown.count(">contact</th>") == 1
    level = Newton(problem).solve(100.0)._repr_html_()
    assert "duality_gap</th>" in level
    bounds = limit_bounds(square(comm))
    assert bounds.strict
    assert bounds._repr_html_().count("<td>True</td>") == 2
    assert bounds.in_words() in bounds._repr_html_()


def square(comm: MPI.Intracomm, constant: bool = False, side: float = 0.25) -> Problem:
    """Return a square under two pressures, from above and, half as large, from the side."""
    return Problem(
        stones(comm, [box([0, 0], [1, 1])], (1, 1)),
        {"0": VonMises(young=1e4, poisson=0.3, yield_stress=1.0)},
        [Support("0_y0", "y"), Support("0_x0", "x")],
        [
            Pressure("0_y1", 0.5, constant=constant, name="push"),
            Pressure("0_x1", side, constant=constant, name="side"),
        ],
        degree=2,
    )


@pytest.fixture
def plots(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Return a backend for plots without a window, and close the plots afterwards."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setattr(pyplot.rcParams, "backend", "agg", raising=False)
    yield
    pyplot.close("all")


EXACT = 4 / np.sqrt(3) * 2
"""Load factor of the square: σ₁ − σ₂ = 2/√3 in plane strain, with a difference of 0.25."""


def of_levels(comm: MPI.Intracomm) -> NotebookResult:
    return LoadingPath(load_path(Newton(punch_problem(2, comm=comm)), [50.0, 100.0]))


def of_bounds(comm: MPI.Intracomm) -> NotebookResult:
    return limit_bounds(square(comm))


def of_bounds_in_space(comm: MPI.Intracomm) -> NotebookResult:
    mesh, steel = stacked_blocks(comm, 1), VonMises(2e5, 0.3, 400.0)
    held = [Support("bottom"), Support("x0", "x"), Support("y0", "y")]
    bodies, contacts = {"lower": steel, "upper": steel}, [Contact("upper_bottom", "lower_top")]
    return limit_bounds(Problem(mesh, bodies, held, [Pressure("top", 1.0)], contacts, degree=2))


def of_meshes(comm: MPI.Intracomm) -> NotebookResult:
    return adaptive_bounds(square(comm), Adaptation(until=0.5))


def of_safety(comm: MPI.Intracomm) -> NotebookResult:
    return factor_of_safety(square(comm, constant=True), tolerance=0.05)


def of_load(comm: MPI.Intracomm) -> NotebookResult:
    return limit_load(square(comm))


def of_shakedown(comm: MPI.Intracomm) -> NotebookResult:
    domain = LoadDomain.of_ranges({"push": [0.0, 1.0], "side": [0.0, 1.0]})
    return shakedown_load(square(comm), domain, rtol=1e-3)


def of_envelope(comm: MPI.Intracomm) -> NotebookResult:
    problem = square(comm, side=-0.25)
    return envelope(problem, [[load] for load in problem.given.loads], until=0.5)


@pytest.mark.usefixtures("plots")
@pytest.mark.parametrize(
    ("result", "columns", "words"),
    [
        (of_levels, {"level", "zeta", "alpha", "converged", "reason"}, "levels are solved"),
        (of_bounds, {"bound", "value", "strict", "of", "why not"}, "collapses"),
        (of_bounds_in_space, {"bound", "value", "strict", "of", "why not"}, "collapses"),
        (of_meshes, {"number", "cells", "lower", "upper", "gap", "seconds"}, "collapses"),
        (of_safety, {"factor", "lower", "upper"}, "stands with F"),
        (of_load, {"number", "load", "gap"}, "limit load of this mesh"),
        (of_shakedown, {"push", "side", "push at shakedown"}, "Shakedown to"),
        (of_envelope, {"angle", "carried", "not carried from"}, "carried"),
    ],
)
def test_a_result_is_a_table_and_a_plot(
    comm: MPI.Intracomm,
    result: Callable[[MPI.Intracomm], NotebookResult],
    columns: set[str],
    words: str,
) -> None:
    """Each result gives a data frame, a plot and a notebook cell, equal on all ranks."""
    pandas = pytest.importorskip("pandas")
    found = result(comm)
    frame = found.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert columns <= set(frame.columns)
    assert len(frame) == len(found.rows()) > 0
    shown = found._repr_html_()
    assert shown.count("<tr>") == len(frame) + 1
    assert words in shown
    assert "array(" not in shown
    axes = found.plot()
    axes.figure.canvas.draw()
    assert axes.has_data()
    assert found.plot(axes) is axes


def test_numbers_of_frames_are_those_of_results(comm: MPI.Intracomm) -> None:
    pytest.importorskip("pandas")
    bounds = limit_bounds(square(comm))
    values = bounds.to_dataframe().set_index("bound").value
    assert values["lower"] == bounds.lower.value == pytest.approx(EXACT, rel=1e-3)
    assert values["upper"] == bounds.upper.value == pytest.approx(EXACT, rel=1e-3)
    path = LoadingPath(load_path(Newton(punch_problem(2, comm=comm)), [50.0, 100.0, 1000.0]))
    frame = path.to_dataframe()
    assert len(path) == len(frame)
    assert list(frame.zeta) == [level.report.zeta for level in path]
    assert list(frame.converged) == [*[True] * (len(path) - 1), False]
    assert f"{len(path) - 1} of {len(path)} levels are solved; the last one" in path.in_words()


def test_a_row_has_no_tables() -> None:
    report = LevelReport(*[0.0] * len(dataclasses.fields(LevelReport)))
    table = {"push": 0.5}
    row = dataclasses.replace(report, factors=table, works={}, reactions={"left": (1, 2)}).row()
    assert row["factor_push"] == 0.5
    assert row["reaction_left"] == (1, 2)
    assert "factors" not in row
    assert "works" not in row


@pytest.mark.parametrize(("module", "method"), [("pandas", "to_dataframe"), ("matplotlib", "plot")])
def test_what_is_optional(monkeypatch: pytest.MonkeyPatch, module: str, method: str) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=f"{module}, which is not installed") as refused:
        getattr(LoadingPath([]), method)()
    assert refused.value.code != UNLISTED
    assert LoadingPath([]).rows() == []


@pytest.mark.usefixtures("plots")
def test_titles_of_plots_mark_values_that_are_not_proven(comm: MPI.Intracomm) -> None:
    found = of_meshes(comm)
    assert isinstance(found, AdaptiveBounds)
    assert "not strict" not in found.plot().get_title()
    doubtful = dataclasses.replace(found.high.upper, doubts=("a test doubts it",))
    high = dataclasses.replace(found.high, upper=doubtful)
    for result in (high, dataclasses.replace(found, high=high)):
        assert result.plot().get_title().endswith(f"… {doubtful.shown} (not strict)")


def test_domains_of_three_loads_have_no_plot(comm: MPI.Intracomm) -> None:
    domain = LoadDomain(("a", "b", "c"), np.eye(3))
    found = of_shakedown(comm)
    assert isinstance(found, ShakedownLoad)
    with pytest.raises(InputError, match=r"but 3 loads vary; to_dataframe\(\)"):
        dataclasses.replace(found, domain=domain).plot()


def test_a_case(comm: MPI.Intracomm) -> None:
    demos = Path(__file__).parents[2] / "demos"
    assert "Two blocks" in short(read_case(demos / "two_blocks.toml", comm))
    assert short(read_case(demos / "punch_limit.toml", comm)).endswith("until the limit load)")
