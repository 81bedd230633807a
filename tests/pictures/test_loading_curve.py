"""Test the loading curve as a file."""

from pathlib import Path

import pytest

from tests.io.results.test_result_folder import report

pytestmark = pytest.mark.serial

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("zetas", [[], [1.0], [1.0, 2.0, 3.0]])
@pytest.mark.parametrize("driven", [False, True])
def test_path_png(tmp_path: Path, zetas: list[float], driven: bool) -> None:
    loading_curve = pytest.importorskip("perfplast_fenicsx.pictures.loading_curve")
    of_no_stage: dict[str, object] = {"factors": {}, "works": {}}
    reports = [report(zeta, plastic_cells=0, **of_no_stage) for zeta in zetas]
    reports.append(report(4.0, converged=False, **of_no_stage))
    loading_curve.save_curve(reports, "A title", tmp_path / "path.png", None, driven=driven)
    assert (tmp_path / "path.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize("by", ["works", "driving_forces"])
def test_path_png_of_a_history(tmp_path: Path, by: str) -> None:
    loading_curve = pytest.importorskip("perfplast_fenicsx.pictures.loading_curve")
    none: dict[str, object] = {"works": {}, "driving_forces": {}}
    told = none | {"stage": "push", by: {"push": 0.1, "warm": 0.0}}
    reports = [report(1.0, factors={"push": a, "warm": 0.0}, **told) for a in (0.5, -1.0)]
    loading_curve.save_curve(reports, "A title", tmp_path / "path.png", None)
    assert (tmp_path / "path.png").read_bytes().startswith(PNG)
