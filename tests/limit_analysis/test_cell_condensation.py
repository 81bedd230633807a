"""Test the elimination of inner unknowns by compiled kernels against NumPy."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import compiled_kernels
from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.limit_analysis.facets.stress_cells import (
    CellLayout,
    cell_layout,
    ring_layout,
)
from perfplast_fenicsx.limit_analysis.stress.condensed_stiffness import CellCondensation

pytestmark = pytest.mark.serial

LAYOUTS = {"plane": (cell_layout(2), 3), "space": (cell_layout(3), 6), "ring": (ring_layout(), 4)}


@pytest.mark.parametrize("count", [1, 4, 7])
@pytest.mark.parametrize("kind", LAYOUTS)
def test_what_is_left_and_solutions_are_those_of_the_whole_matrix(kind: str, count: int) -> None:
    """Any number of cells works, also if it is not a multiple of four."""
    layout, m = LAYOUTS[kind]
    outer, inner, rows = layout.outer, layout.inner, _rows(layout)
    of = np.random.default_rng(count)
    matrices = of.normal(size=(count, *rows.shape, m))
    roots = of.normal(size=(count, len(rows), m, m))
    more, ridge = of.uniform(5, 50, size=(count, inner)), of.uniform(size=count)
    K = np.zeros((count, outer + inner, outer + inner))
    for p, at in enumerate(rows):
        scaled = matrices[:, p] @ roots[:, p]
        K[:, at[:, None], at] += scaled @ scaled.swapaxes(1, 2)
    diagonal = np.arange(outer)
    told = K[:, diagonal, diagonal].copy()
    K[:, np.arange(outer, len(K[0])), np.arange(outer, len(K[0]))] += more
    inside, across = K[:, outer:, outer:], K[:, outer:, :outer]
    expected = K[:, :outer, :outer] - across.swapaxes(1, 2) @ np.linalg.solve(inside, across)
    expected[:, diagonal, diagonal] += ridge[:, None] * told

    cells = CellCondensation(MPI.COMM_SELF, rows, matrices, outer)
    left, done = cells.condense(roots, more, ridge)
    assert done
    np.testing.assert_allclose(left, expected, atol=1e-10 * np.abs(expected).max())
    forces, known = of.normal(size=(count, inner)), of.normal(size=(count, outer))
    onto = cells.push_out(forces)
    found = cells.bring_in(known)
    pushed = across.swapaxes(1, 2) @ np.linalg.solve(inside, forces[:, :, None])
    np.testing.assert_allclose(onto, -pushed[:, :, 0], atol=1e-10 * np.abs(pushed).max())
    right = forces[:, :, None] - across @ known[:, :, None]
    expected = np.linalg.solve(inside, right)[:, :, 0]
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def test_a_cell_that_cannot_be_solved_is_told() -> None:
    """One singular cell suffices, and so does one cell with nan."""
    layout, m = LAYOUTS["plane"]
    rows, count = _rows(layout), 6
    of = np.random.default_rng(3)
    matrices = of.normal(size=(count, *rows.shape, m))
    roots = of.normal(size=(count, len(rows), m, m))
    more, ridge = np.zeros((count, layout.inner)), np.zeros(count)
    cells = CellCondensation(MPI.COMM_SELF, rows, matrices, layout.outer)
    assert cells.condense(roots, more, ridge)[1]
    roots[4] = 0.0
    assert not cells.condense(roots, more, ridge)[1]
    roots[4, -1, -1] = np.nan
    assert not cells.condense(roots, more, ridge)[1]


def test_a_source_is_compiled_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only one file remains after the compilation."""
    monkeypatch.setattr(compiled_kernels, "get_options", lambda: {"cache_dir": str(tmp_path)})
    source = "static int two = 2;\n\ndouble twice(double x) { return two * x; }\n"
    for number in (3.0, 5.0):
        lib, _ = compiled(MPI.COMM_SELF, source)
        assert lib.twice(number) == pytest.approx(2 * number)
        monkeypatch.setattr(compiled_kernels, "_compile", None)
    assert len(list(tmp_path.iterdir())) == 1


def _rows(layout: CellLayout) -> Longs:
    parts, corners = layout.rows.shape[:2]
    return layout.rows.reshape(parts * corners, -1)
