"""Install one-module packages by hand, and run commands that find them."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def install(folder: Path, module: str, code: str, group: str, entry: str) -> None:
    """Install a package of one module with one entry point, as pip does.

    Args:
        folder: Folder in which Python finds the package.
        module: Name of the module and of the package.
        code: Source code of the module.
        group: Group of the entry point.
        entry: Name of the entry point and its object, such as "steps = module:STEPS".
    """
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    about, name = folder / f"{module}-1.5.dist-info", module.replace("_", "-")
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")


def perfplast(
    *arguments: str, ranks: int = 1, folder: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a command in a separate process.

    Args:
        arguments: Arguments of ``perfplast``.
        ranks: Number of processes, started by mpirun; 1 runs without mpirun.
        folder: Folder with packages that the command finds.
        variables: Environment variables.
    """
    path = os.pathsep.join(str(place) for place in (ROOT, folder) if place is not None)
    launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*launch, sys.executable, "-m", "perfplast_fenicsx", *arguments],
        env=os.environ | {"PYTHONPATH": path} | variables,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
