"""Fixtures and marks of the whole suite, which runs on one rank and under mpirun alike."""

from pathlib import Path

from mpi4py import MPI

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Register the marks, and what holds the ranks together."""
    config.addinivalue_line("markers", "mpi3: part of the small choice that also runs on 3 ranks")
    config.pluginmanager.import_plugin("tests.parallel_plugin")


@pytest.fixture
def comm() -> MPI.Intracomm:
    """All ranks of the run."""
    return MPI.COMM_WORLD


@pytest.fixture
def shared_tmp_path(tmp_path: Path) -> Path:
    """A temporary folder, the same one on every rank (``tmp_path`` is another on each)."""
    return MPI.COMM_WORLD.bcast(tmp_path)
