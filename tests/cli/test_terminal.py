"""What is told of bounds on the terminal."""

import io
from types import SimpleNamespace

from mpi4py import MPI

import pytest

from perfplast_fenicsx.cli.terminal import Terminal

pytestmark = pytest.mark.serial


def test_next_steps_are_told_behind_what_is_proven() -> None:
    bounds, stream = SimpleNamespace(in_words=lambda: "Bounds."), io.StringIO()
    terminal = Terminal(MPI.COMM_SELF, stream, live=False)
    terminal.body(bounds, ["make it finer"])  # type: ignore[arg-type]
    assert stream.getvalue() == "Bounds.\nMake it finer.\n"
