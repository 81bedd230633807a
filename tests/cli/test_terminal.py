"""Test the lines that the terminal prints about bounds."""

import io
from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

import pytest

from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import Round

pytestmark = pytest.mark.serial


def test_next_steps_are_told_behind_what_is_proven() -> None:
    bounds, stream = SimpleNamespace(in_words=lambda: "Bounds."), io.StringIO()
    terminal = Terminal(MPI.COMM_SELF, stream, live=False)
    terminal.body(bounds, ["make it finer"])  # type: ignore[arg-type]
    assert stream.getvalue() == "Bounds.\nMake it finer.\n"


def test_rounding_errors_of_forces_are_printed_as_zero() -> None:
    """The larger of two small components is also a rounding error, next to the largest one."""
    reactions = {"loads": [-1.13687e-13, 0.0, -1e3], "support floor": [2e-5, -1.1e-13, 1e3]}
    report = SimpleNamespace(reactions=reactions, factors={}, zeta=2.0, balance=1e-16)
    kinematics = SimpleNamespace(whole=True, forces="")
    units = SimpleNamespace(table=lambda whole: {"force": "N"})
    stream = io.StringIO()
    terminal = Terminal(MPI.COMM_SELF, stream, live=False)
    terminal.reactions(report, SimpleNamespace(kinematics=kinematics), units)  # type: ignore[arg-type]
    head, *rows = stream.getvalue().splitlines()
    assert head == "Forces (N) at zeta = 2, in balance to 1.0e-16:"
    assert [row.split()[-3:] for row in rows] == [["0", "0", "-1000"], ["2e-05", "0", "1000"]]


def test_control_characters_are_shown_and_not_obeyed() -> None:
    """Names and titles may contain control characters; only line ends of the program remain."""
    stream = io.StringIO()
    terminal = Terminal(MPI.COMM_SELF, stream, live=False)
    terminal.say("\x1b]0;mine\x07\x1b[2J\rgood\u202e:\nnext")
    assert stream.getvalue() == "\\x1b]0;mine\\x07\\x1b[2J\\rgood\\u202e:\nnext\n"


@pytest.mark.parametrize("goes_on", [False, True])
def test_checkpoints_are_results_where_a_run_goes_on_from_them(
    tmp_path: Path, goes_on: bool
) -> None:
    folder, stream = ResultFolder(MPI.COMM_SELF, tmp_path), io.StringIO()
    for name in ("summary.json", "checkpoint.h5", "checkpoint_before.h5"):
        folder.file(name).touch()
    Terminal(MPI.COMM_SELF, stream, live=False).results(folder, goes_on)
    assert "summary.json" in stream.getvalue()
    assert ("checkpoint.h5" in stream.getvalue()) == goes_on


@pytest.mark.parametrize(
    ("round_", "words"),
    [
        (
            Round(1, 90, 1.5, 2.0, 1 / 3, 0.5),
            "lower bound 1.5, upper bound 2, ",
        ),
        (
            Round(2, 90, 4.5, None, None, 0.5, (None, 4.33334)),
            "bound 4.5, upper bound none (4.33334 is not proven)",
        ),
        (Round(3, 90, None, None, None, 0.5), "lower bound none, upper bound none, 0.5 s"),
    ],
)
def test_a_value_that_is_not_proven_is_no_bound(round_: Round, words: str) -> None:
    stream = io.StringIO()
    Terminal(MPI.COMM_SELF, stream, live=False).mesh(round_)
    assert words in stream.getvalue()
