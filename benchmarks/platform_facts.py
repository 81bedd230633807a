"""Find the libraries that this process uses."""

import re
from pathlib import Path

from petsc4py import PETSc

from perfplast_fenicsx.environment import WHEEL, version_of


def libraries() -> dict[str, str]:
    """Return the versions of the libraries, and the BLAS that this process has loaded."""
    return {
        "dolfinx": version_of("fenics-dolfinx") or version_of(WHEEL) or "unknown",
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        "blas": blas(),
    }


def blas() -> str:
    """Return the file names of the BLAS libraries in the memory map of this process."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    paths = {Path(path).resolve() for path in re.findall(r"\S+/lib\w*blas\w*[^/\s]*\.so\S*", maps)}
    return ", ".join(sorted(f"{path.parent.name}/{path.name}" for path in paths)) or "unknown"
