"""Test ground that water lifts, against statics: heave between sheet piles, and uplift of clay."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check

CASES = Path(__file__).parents[2] / "demos" / "verification" / "drawn_ground"
LIFTED = {"heave": 20.0 / 9.81, "uplift": 4 * 18.0}
"""Factor at which the water pressure carries the weight."""

RTOL = 1e-4
"""Relative distance of each bound from the optimum on its mesh."""


@pytest.mark.serial
@pytest.mark.parametrize("name", LIFTED)
def test_ground_falls_where_water_carries_its_weight(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.toml"
    path.write_text((CASES / path.name).read_text(encoding="utf-8"), encoding="utf-8")
    bounds = limit_bounds(read_case(path).problem(MPI.COMM_SELF), RTOL)
    assert bounds.strict, (bounds.lower.why_not, bounds.upper.why_not)
    folder = ResultFolder(MPI.COMM_SELF, tmp_path / "out")
    folder.create()
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    low, high = (check(folder.file("bounds.h5"))[side].proven for side in ("lower", "upper"))
    assert low is not None and high is not None
    assert LIFTED[name] * (1 - 1e-3) <= low <= high <= LIFTED[name] * (1 + 1e-3)
    print(f"{name}: {low:.7g} ... {high:.7g}, {LIFTED[name]:.7g} by statics")
