"""Define fixtures and marks for the whole suite, which runs on one rank and under mpirun."""

import functools
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import basix.ufl
import gmsh
import pytest
import ufl
from ffcx.codegeneration import jit

from perfplast_fenicsx import TaggedMesh, read_gmsh
from perfplast_fenicsx.mesh import gmsh_dump, gmsh_reader
from tests.models import Read


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin that synchronises the ranks, and the marks of this plugin."""
    config.pluginmanager.import_plugin("tests.parallel_plugin")
    keep_compiled_forms()
    keep_cells()


def keep_compiled_forms() -> None:
    """Make FFCx load each compiled form once per process.

    For each form of each problem (20 in a solver), FFCx lists the cache folder, which contains
    thousands of files. This takes more time than the solution of a small problem: 0.11 of 0.19 s.
    """
    found: dict[tuple[str, ...], Any] = {}
    load = jit.get_cached_module

    def load_once(module: str, objects: Sequence[str], folder: Any, *more: Any) -> Any:
        key = (module, *objects, str(folder))
        if key in found:
            return found[key]
        loaded = load(module, objects, folder, *more)
        if loaded[0] is not None:  # otherwise it must be compiled
            found[key] = loaded
        return loaded

    jit.get_cached_module = load_once


def keep_cells() -> None:
    """Make Basix create each kind of cell once per process.

    For each query about an element, Basix creates a cell with its faces and edges: 75 objects for a
    tetrahedron, thousands of times in a problem.
    """
    made = functools.cache(ufl.Cell)
    basix.ufl._ElementBase.cell = property(lambda element: made(element.cell_type.name))


@pytest.fixture
def comm() -> MPI.Intracomm:
    """Return the communicator of all ranks."""
    return MPI.COMM_WORLD


@pytest.fixture
def shared_tmp_path(tmp_path: Path) -> Path:
    """Return a temporary folder that is the same on every rank, unlike ``tmp_path``."""
    return MPI.COMM_WORLD.bcast(tmp_path)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Prevent run, check and mesh from drawing pictures, which takes 2 to 4 s each."""
    monkeypatch.setattr("perfplast_fenicsx.cli.run.draw", lambda folder: True)
    monkeypatch.setattr("perfplast_fenicsx.cli.commands.draw_case", lambda *of: False)
    monkeypatch.setattr("perfplast_fenicsx.cli.mesh_command.draw_parts", lambda *of: None)


@pytest.fixture
def read(shared_tmp_path: Path) -> Read:
    """Return a function that writes a mesh, and reads it on all ranks or on each rank."""

    def read(
        write: Callable[..., None], comm: MPI.Intracomm = MPI.COMM_WORLD, **arguments: Any
    ) -> TaggedMesh:
        path = shared_tmp_path / f"{write.__name__}.msh"
        MPI.COMM_WORLD.barrier()  # another rank may still be reading the old file
        if MPI.COMM_WORLD.rank == 0:
            write(path, **arguments)
        MPI.COMM_WORLD.barrier()
        with pytest.MonkeyPatch.context() as patch:
            patch_reader(patch)
            return read_gmsh(comm, path)

    return read


READ_APART = ("mesh/", "hostile", "fuzz")
"""Parts of the paths, relative to ``tests``, of tests that read mesh files as users do."""


@pytest.fixture(autouse=True)
def mesh_files_read_here(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read mesh files in this process, except in tests of damaged files.

    Damaged files may make gmsh crash, so these tests keep the separate process. Their fixture
    ``read`` reads valid files in this process.
    """
    path = request.path.relative_to(Path(__file__).parent).as_posix()
    if not any(part in path for part in READ_APART):
        patch_reader(monkeypatch)


def patch_reader(patch: pytest.MonkeyPatch) -> None:
    """Let gmsh read in this process, because a separate process needs 0.35 s to load gmsh."""
    here = SimpleNamespace(run=read_here, DEVNULL=subprocess.DEVNULL)
    patch.setattr(gmsh_reader, "subprocess", here)


def read_here(command: Sequence[str], **_: Any) -> subprocess.CompletedProcess[bytes]:
    """Run :func:`gmsh_dump.dump` in this process instead of a command that starts it."""
    gmsh_dump.dump(*command[-2:])
    gmsh.finalize()
    return subprocess.CompletedProcess(command, 0, b"", b"")
