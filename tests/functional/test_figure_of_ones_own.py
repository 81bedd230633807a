"""Test a figure from outside the package, as one file and one entry point, in a whole run."""

import base64
import sys
from pathlib import Path

import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results import result_files as registry
from perfplast_fenicsx.io.results.result_files import FIGURES, Figure, figures
from tests.installed_package import ROOT, install, perfplast
from tests.models import steel_blocks_case

pytestmark = pytest.mark.serial

OWN = """
from perfplast_fenicsx.io.results.result_files import Figure

STEPS = Figure("steps.png", "Newton steps <of each level>", "own_figure:steps")


def steps(reader):
    if not reader.reports:
        return None

    def draw(path):
        from matplotlib.figure import Figure as Canvas

        canvas = Canvas()
        canvas.subplots().plot([report.newton_iterations for report in reader.reports])
        canvas.savefig(path)
        return "steps.png has the Newton steps."

    return draw
"""


def test_a_figure_is_drawn_listed_and_shown(tmp_path: Path) -> None:
    install(tmp_path, "own_figure", OWN, registry.GROUP, "steps = own_figure:STEPS")
    case, results = tmp_path / "case.toml", tmp_path / "results"
    case.write_text(
        steel_blocks_case(
            '[loading]\ncontrol = "load"\nvalues = [100.0]\n[output]\nfields = false\n'
        )
    )
    run = perfplast("run", str(case), "-o", str(results), "--report", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "steps.png" in next(line for line in run.stdout.splitlines() if "Results in" in line)
    drawn = (results / "steps.png").read_bytes()
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "<h3>Newton steps &lt;of each level&gt;</h3>" in page
    assert base64.b64encode(drawn).decode() in page
    again = perfplast("plot", str(results), "-o", str(tmp_path / "pictures"), folder=tmp_path)
    assert again.stdout.splitlines()[-2:] == [
        str(tmp_path / "pictures" / "steps.png"),
        "steps.png has the Newton steps.",
    ]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("own_figure:steps", "must be a Figure"),
        ("own_figure:CURVE", "cannot be loaded"),
        ("no_such_module:STEPS", "cannot be loaded"),
        ("own_figure:TAKEN", "an unused file name"),
    ],
)
def test_a_figure_that_is_none_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: str, says: str
) -> None:
    install(tmp_path, "own_figure", OWN, registry.GROUP, f"steps = {entry}")
    with (tmp_path / "own_figure.py").open("a", encoding="utf-8") as module:
        module.write('\nTAKEN = Figure("path.png", "The curve", "own_figure:steps")\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "own_figure", raising=False)
    figures.cache_clear()
    try:
        with pytest.raises(InputError, match=says):
            figures()
    finally:
        figures.cache_clear()


@pytest.mark.long
def test_ranks_refuse_a_figure_together(tmp_path: Path) -> None:
    """Only rank 0 looks into the folder, and the other rank does not wait for ever."""
    install(tmp_path, "own_figure", OWN, registry.GROUP, "steps = own_figure:CURVE")
    case = str(ROOT / "demos" / "block_on_plane.toml")
    run = perfplast("run", case, "-o", str(tmp_path / "out"), ranks=2, folder=tmp_path)
    assert run.returncode == 2
    assert run.stderr.count("the figure 'steps' cannot be loaded from own_figure:CURVE") == 1


def test_figures_have_names_and_functions_of_their_own() -> None:
    """The function of each entry exists, and no two entries share a file."""
    assert len({figure.file for figure in FIGURES}) == len(FIGURES)
    for figure in FIGURES:
        module, function = figure.source.split(":")
        assert callable(getattr(__import__(module, fromlist=[function]), function))
        assert isinstance(figure, Figure)
