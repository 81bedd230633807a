"""Test ``[earthquake]``: critical seismic coefficient, and factors of safety with a given one."""

import re
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import InputError
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.proof import check
from tests.case_runs import run_case
from tests.models import SLOPE_TABLES


def slope(loading: str, earthquake: str) -> str:
    """Return the case of a slope in an earthquake.

    Args:
        loading: The key of the loading.
        earthquake: Keys of [earthquake].
    """
    return (
        f'title = "Slope in an earthquake"\n{loading}\n{SLOPE_TABLES}[earthquake]\n{earthquake}\n'
    )


SEISMIC = 'loading.control = "seismic"'
STRENGTH = 'loading.control = "strength"'
LEFT = "direction = [-2.0, 0.0]"


@pytest.mark.long
def test_at_the_critical_coefficient_the_factor_of_safety_is_one(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Loukidis' first slope, on one mesh: log spirals give k_c = 0.432."""
    found = run_case(
        comm, shared_tmp_path, slope(loading=SEISMIC, earthquake=LEFT), capsys, "--report"
    )
    assert found.status == 0, found.err
    printed = re.search(r"stable at k = ([\d.]+) .* collapse at k = ([\d.]+) at", found.out)
    assert printed is not None
    lower, upper = (float(text) for text in printed.groups())
    assert 0.3 < lower < 0.432 < upper < 0.5
    assert found.summary["limit"]["answer"] in found.out
    if comm.rank == 0:
        page = (found.folder / "report.html").read_text(encoding="utf-8")
        assert "under a horizontal force of k times their weight" in page
        proven = check(found.folder / "bounds.h5")
        assert proven["lower"].proven == pytest.approx(lower, rel=1e-4)
        assert proven["upper"].proven == pytest.approx(upper, rel=1e-4)
    for k, side, sign in ((lower, "lower", 1), (upper, "upper", -1)):
        text = slope(loading=STRENGTH, earthquake=f"{LEFT}\ncoefficient = {k!r}")
        run = run_case(comm, shared_tmp_path, text, capsys, "--force")
        assert run.status == 0, run.err
        factor = run.summary["limit"]["strength"][side]
        assert sign * (factor - 1) > -2e-3  # within the tolerance of F
        assert factor == pytest.approx(1, abs=0.02)


@pytest.mark.serial
def test_water_in_the_weight_is_pushed_too(tmp_path: Path) -> None:
    wet = "[water]\ntable = [[-50, 10], [150, 10]]\nsaturated = { ground = 21.0 }\n"
    path = tmp_path / "case.toml"
    text = slope(loading=STRENGTH, earthquake=f"{LEFT}\ncoefficient = 0.1") + wet
    path.write_text(text, encoding="utf-8")
    loads = [load for load in read_case(path).loads if load.name == "earthquake"]
    assert all(load.constant for load in loads)
    assert np.array([load.value for load in loads]) == pytest.approx(
        np.array([[-2.0, 0.0], [-0.1, 0.0]])
    )


@pytest.mark.serial
@pytest.mark.parametrize(
    ("loading", "earthquake", "words"),
    [
        (SEISMIC, f"{LEFT}\ncoefficient = 0.1", r"0.1 is given, but control = 'seismic'"),
        (STRENGTH, LEFT, r"\[earthquake\]: coefficient is missing; give it"),
        (STRENGTH, f"{LEFT}\ncoefficient = -0.1", r"-0.1 is not positive"),
        (SEISMIC, "direction = [-1.0, 0.1]", r"is not perpendicular to the acceleration"),
        (SEISMIC, "direction = [0.0, 0.0]", r"is not valid; give 2 numbers"),
        (SEISMIC, "direction = [1.0, 0.0, 0.0]", r"is not valid; give 2 numbers"),
        (
            f"{SEISMIC}\ngravity.constant = false",
            LEFT,
            r"'gravity' would grow with the coeff",
        ),
        (f"{SEISMIC}\nloading.design = 1.0", LEFT, r"no key 'design'"),
    ],
)
def test_what_cannot_be(tmp_path: Path, loading: str, earthquake: str, words: str) -> None:
    text = slope(loading=loading, earthquake=earthquake)
    if "gravity.constant" in loading:
        text = text.replace("gravity.constant = false\n", "")
        text = text.replace("[0.0, -1.0],", "[0.0, -1.0], constant = false,")
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_case(path)


@pytest.mark.serial
def test_a_coefficient_that_is_sought_needs_its_table_and_a_weight(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    text = slope(loading=SEISMIC, earthquake=LEFT)
    path.write_text(text.replace(f"[earthquake]\n{LEFT}\n", ""), encoding="utf-8")
    with pytest.raises(InputError, match=r"\[earthquake\] is missing, but control = 'seismic'"):
        read_case(path)
    lines = [line for line in text.splitlines() if not line.startswith("gravity")]
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=r"but \[gravity\] is missing"):
        read_case(path)
