"""Each piece of the bodies is in balance by itself, or its stress proves nothing."""

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Problem, Support, Traction
from perfplast_fenicsx.limit_analysis import strict_lower_bound
from perfplast_fenicsx.limit_analysis.facets.bound_body import bound_body
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress import static_bound
from perfplast_fenicsx.limit_analysis.stress.piece_balance import Pieces, largest_left
from perfplast_fenicsx.limit_analysis.stress.static_certificate import certify_stress
from perfplast_fenicsx.limit_analysis.stress.static_form import static_form
from perfplast_fenicsx.limit_analysis.stress.static_program import static_program
from tests.models import STEEL, two_blocks

COMM = MPI.COMM_WORLD


def blocks(on_upper: float) -> Problem:
    """Two cantilevers beside each other: 1 pulls at the lower one, little at the upper one."""
    loads = [Traction("lower_top", (1.0, 0.0, 0.0))]
    if on_upper:
        loads.append(Traction("top", (on_upper, 0.0, 0.0)))
    return Problem(
        two_blocks(COMM, 1), {"lower": STEEL, "upper": STEEL}, [Support("left")], loads, degree=2
    )


@pytest.mark.mpi2
def test_pieces_hang_together_by_facets() -> None:
    problem = blocks(0.0)
    mesh, body = problem.tagged_mesh.mesh, bound_body(problem)
    pieces = Pieces.of(mesh, body.numbers)
    assert pieces.count == 2
    owned = mesh.topology.index_map(2).size_local
    cells = len(body.numbers.facets)
    sums = pieces.sums(np.zeros((owned, 1)), np.ones((cells, 1)))
    assert sums.sum() == pytest.approx(mesh.topology.index_map(3).size_global)
    above = body.vertices.mean(axis=1)[:, -1] > 1.0
    of_upper = pieces.sums(np.zeros((owned, 1)), above[:, None].astype(np.float64))
    assert sorted(of_upper) == pytest.approx([0.0, sums[np.argmax(of_upper)]])


@pytest.mark.serial
def test_what_is_left_of_one_piece_is_relative_to_its_own_loads() -> None:
    forces, plenty = np.array([1e-9, 1e-12, 1e-3]), np.full(3, np.inf)
    assert largest_left(forces, np.array([1.0, 0.0, 0.0]), plenty) == pytest.approx(1e-9, rel=2e-3)
    both = np.array([1.0, 1e-12, 0.0])
    assert largest_left(forces, both, plenty) == pytest.approx(1e-9, rel=2e-3)
    weak = np.array([np.inf, 0.0, 0.0])  # its cells bear nothing that rounding could be
    assert largest_left(forces, both, weak) == pytest.approx(1.0)


def test_a_piece_on_which_little_acts_is_not_left_on_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without stress in the upper block what is left is rounding beside all loads and strengths."""
    seen: list[tuple[Any, ...]] = []

    def noted(*given: Any) -> Any:
        seen.append(given)
        return certify_stress(*given)

    monkeypatch.setattr(static_bound, "certify_stress", noted)
    found = strict_lower_bound(blocks(0.0), 1e-3)
    assert found.certificate is not None
    assert found.certificate.holds
    assert found.certificate.left_of_piece < 1e-13
    _, pressure, deviator, load, aside = seen[-1]
    form = static_form(blocks(2e-11))
    static = static_program(form, Question.LIMIT, 0.0)
    certificate = certify_stress(static, 1e-2 * pressure, 1e-2 * deviator, 1e-2 * load, aside)
    static.destroy()
    form.destroy()
    assert certificate.left_of_load < 5e-11
    assert certificate.left_of_piece > 1e-9
    assert not certificate.holds
