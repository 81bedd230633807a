"""Packages of one module that are installed by hand, and commands that find them."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def install(folder: Path, module: str, code: str, group: str, entry: str) -> None:
    """Install a package of one module with one entry point, as pip does it.

    Args:
        folder: That Python is to find it in.
        module: Its name, which is that of the package too.
        code: The module.
        group: Of the entry point.
        entry: The name of the entry point, and what it names, as in "steps = module:STEPS".
    """
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    about, name = folder / f"{module}-1.5.dist-info", module.replace("_", "-")
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")


def perfplast(
    *arguments: str, ranks: int = 1, folder: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own.

    Args:
        arguments: Of ``perfplast``.
        ranks: In how many processes, by mpirun; 1 without it.
        folder: With packages that it finds.
        variables: Of the environment.
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
