"""Test where a loading curve begins, and its pieces on a logarithmic axis."""

import numpy as np
import pytest

from perfplast_fenicsx.pictures.path_points import between, from_rest
from tests.io.results.test_result_folder import report

pytestmark = pytest.mark.serial


def test_where_it_begins() -> None:
    assert from_rest([]) == ([0.0], [0.0])
    solved = [report(2.0, alpha=1.0), report(3.0, alpha=4.0)]
    assert from_rest(solved) == ([0.0, 1.0, 4.0], [0.0, 2.0, 3.0])
    constant = [report(0.0, alpha=0.5), *solved]  # constant loads have done work before
    assert from_rest(constant) == ([0.5, 1.0, 4.0], [0.0, 2.0, 3.0])


def test_pieces_are_straight() -> None:
    x, y = between([0.0, 1.0, 1000.0, 10.0], [0.0, 2.0, 3.0, 4.0])
    assert len(x) == len(y) == 1 + 3 * 24
    first = np.array(x) <= 1.0
    assert np.array(y)[first] == pytest.approx(2 * np.array(x)[first])
    assert y[24:49] == pytest.approx([2 + (a - 1) / 999 for a in x[24:49]])
    assert (x[-1], y[-1]) == pytest.approx((10.0, 4.0))
    assert np.ptp(np.diff(np.log10(x[24:49]))) < 1e-9
