"""Describe the environment of a run: versions, PETSc's packages, BLAS, ranks, threads."""

import os
import platform
from importlib import metadata

from mpi4py import MPI
from petsc4py import PETSc

import dolfinx
import numpy as np
from threadpoolctl import threadpool_info

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.extensions import extensions

LIBRARIES = {
    "basix": "fenics-basix",
    "FFCx": "fenics-ffcx",
    "UFL": "fenics-ufl",
    "mpi4py": "mpi4py",
    "numpy": "numpy",
    "scipy": "scipy",
    "h5py": "h5py",
    "gmsh": "gmsh",
    "matplotlib": "matplotlib",
    "pyvista": "pyvista",
}
"""Common names of libraries, and those of their Python distributions."""

PETSC_PACKAGES = ("mumps", "hypre", "superlu_dist", "ptscotch", "parmetis", "ml", "cuda", "hip")
"""Solvers, partitioners and devices that PETSc may have been built with."""


def versions() -> dict[str, str]:
    """Return versions by name, in order of interest; "none" for missing libraries."""
    found = {
        "perfplast": __version__,
        "DOLFINx": dolfinx.__version__,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
    }
    for name, distribution in LIBRARIES.items():
        try:
            found[name] = metadata.version(distribution)
        except metadata.PackageNotFoundError:
            found[name] = "none"
    found["extensions"] = extensions()
    found["Python"] = platform.python_version()
    found["MPI"] = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\0 ")
    return found


def petsc_packages() -> list[str]:
    """Return the entries of :data:`PETSC_PACKAGES` that PETSc has."""
    return [name for name in PETSC_PACKAGES if PETSc.Sys.hasExternalPackage(name)]


def petsc_options() -> str:
    """Return the options in PETSc's database, in the form of a command line."""
    options = PETSc.Options().getAll()
    return " ".join(f"-{key} {options[key]}" for key in options)


def blas() -> str:
    """Return the loaded BLAS libraries, each with version and threads."""
    found = (
        f"{library['filepath']} ({library['internal_api']} {library['version']},"
        f" {library['num_threads']} threads)"
        for library in threadpool_info()
        if library["user_api"] == "blas"
    )
    return ", ".join(sorted(found)) or "unknown"


def threads() -> str:
    """Return the number of cores that this process may use, and its thread limit."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    # Variables that set the number of threads.
    variables = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
    limits = [f"{name}={os.environ[name]}" for name in variables if name in os.environ]
    return (
        f"{cores} core{'s' if cores != 1 else ''} a rank, {' '.join(limits) or 'no limit is set'}"
    )


def ranks(comm: MPI.Intracomm) -> str:
    """Return the number of ranks and their hosts. Collective."""
    hosts = comm.allgather(MPI.Get_processor_name())
    counts: Longs
    names, counts = np.unique(hosts, return_counts=True)
    return ", ".join(f"{n} on {host}" for host, n in zip(names, counts, strict=True))


def surroundings(comm: MPI.Intracomm) -> dict[str, str]:
    """Return all data except the versions, in words by name. Collective."""
    return {
        "PETSc packages": ", ".join(petsc_packages()) or "none",
        "PETSc scalars": f"{np.dtype(PETSc.ScalarType)}, indices {np.dtype(PETSc.IntType)}",
        "BLAS": blas(),
        "ranks": ranks(comm),
        "threads": threads(),
        "system": platform.platform(),
    }
