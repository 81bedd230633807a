"""Compile C kernels with cffi on first use, and cache them beside DOLFINx's compiled forms."""

import hashlib
import importlib.util
import os
import platform
import re
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
from cffi import FFI, VerificationError
from dolfinx.jit import get_options, mpi_jit_decorator

from perfplast_fenicsx.arrays import Floats


def compiled(comm: MPI.Intracomm, source: str) -> tuple[Any, FFI]:
    """Return the library of a C source, compiled on first use for this processor, and its FFI.

    Collective.

    Files for other processors in the same folder remain. A rank that does not see the first rank's
    file compiles the source too.

    Args:
        comm: The ranks.
        source: C definitions; functions that are not static begin at the left margin.

    Returns:
        The cffi module with the functions, and the object that converts arrays to arguments.
    """
    module = _load(comm, source)
    return module.lib, module.ffi


@mpi_jit_decorator
def _load(source: str) -> Any:
    """Return the module from its file, which is created atomically if it is missing."""
    folder = Path(get_options()["cache_dir"])
    of = "\0".join([source, _processor(), sysconfig.get_config_var("SOABI") or ""])
    name = f"perfplast_kernels_{hashlib.sha1(of.encode()).hexdigest()}"
    path = folder / f"{name}{sysconfig.get_config_var('EXT_SUFFIX')}"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix="perfplast_") as made:
            os.replace(_compile(name, source, made), path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compile(name: str, source: str, folder: str) -> str:
    """Compile a source for this processor, or for any processor if that fails; return the file."""
    heads = re.findall(r"^(?!static)\w+ \w+\([^{;]*\)(?= \{)", source, re.MULTILINE)
    flags = ["-O3", "-fno-math-errno", "-g0"]
    for own in (["-march=native"], []):
        ffi = FFI()
        ffi.cdef("".join(f"{head};" for head in heads))
        ffi.set_source(name, source, extra_compile_args=[*flags, *own], libraries=["m"])
        try:
            return str(ffi.compile(tmpdir=folder))
        except VerificationError:
            if not own:
                raise
    raise AssertionError("unreachable")


def _processor() -> str:
    """Return a text that differs between processors that need different files."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text().splitlines() if told.exists() else []
    flags = [line for line in lines if line.startswith(("flags", "Features"))]
    return f"{platform.machine()} {platform.processor()} {flags[:1]}"


def aligned(size: int) -> Floats:
    """Return an uninitialised array that begins at a cache line, shape (size,)."""
    line = 8  # entries in a cache line
    room = np.empty(size + line)
    first = -(room.ctypes.data // room.itemsize) % line
    return room[first : first + size]
