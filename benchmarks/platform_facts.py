"""Which libraries a run used."""

import re
from importlib.metadata import version
from pathlib import Path

from petsc4py import PETSc


def libraries() -> dict[str, str]:
    """Versions, and the BLAS that this process has really loaded."""
    return {
        "dolfinx": version("fenics-dolfinx"),
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        "blas": blas(),
    }


def blas() -> str:
    """File names of the BLAS libraries in this process's memory map."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    paths = {Path(path).resolve() for path in re.findall(r"\S+/lib\w*blas\w*[^/\s]*\.so\S*", maps)}
    return ", ".join(sorted(f"{path.parent.name}/{path.name}" for path in paths)) or "unknown"
