"""Read a .msh file as arrays. Gmsh runs in a separate process, because it may crash."""

import json
import signal
import stat
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.child_process import environment_for_gmsh
from perfplast_fenicsx.errors import InputError

NO_GMSH = (
    "gmsh's Python module cannot be loaded; install it (pip install gmsh, or Debian's"
    " python3-gmsh), and see perfplast doctor"
)


CONVERT = "convert it by meshio, as docs/howto/mesh.md shows under 'Other formats'"
MODEL = "convert it to a mesh and a case by perfplast mesh"

REMEDIES = {
    **dict.fromkeys((".e", ".exo"), CONVERT),
    **dict.fromkeys((".inp", ".med", ".unv", ".bdf", ".nas", ".fem", ".vtu", ".vtk"), MODEL),
    **dict.fromkeys((".xdmf", ".h5"), "convert it by meshes/from_xdmf.py (docs/howto/mesh.md)"),
    **dict.fromkeys(
        (".step", ".stp", ".brep", ".iges", ".igs", ".geo"),
        "give it as file of a [geometry] instead of a [mesh], or mesh it by perfplast mesh",
    ),
    ".py": "it is a program, which perfplast never runs; run it, and give the mesh that it writes",
}
"""Remedies for files of other kinds, by suffix."""


@dataclass(frozen=True)
class Block:
    """Elements of one entity and type: nodes (gmsh's tags), shape (num_elements, ·)."""

    dim: int
    entity: int
    groups: list[int]
    kind: int
    nodes: Longs


@dataclass(frozen=True)
class Content:
    """The content of a mesh file, read by :mod:`perfplast_fenicsx.mesh.gmsh_dump`.

    Attributes:
        blocks: Its elements.
        groups: Dimension, tag and name of the physical groups.
        types: Name and number of nodes of each element type.
        tags: Tags of the nodes, shape (num_nodes,).
        coordinates: Coordinates of the nodes, shape (num_nodes, 3).
    """

    blocks: list[Block]
    groups: list[tuple[int, int, str]]
    types: dict[int, tuple[str, int]]
    tags: Longs
    coordinates: Floats


def read_content(path: Path) -> Content:
    """Let gmsh read a file in a separate process.

    Raises:
        InputError: If the file is missing or not gmsh's, or if gmsh is not installed, finds a fault
            or crashes.
    """
    _check_header(path)
    program = Path(__file__).with_name("gmsh_dump.py")
    with tempfile.TemporaryDirectory() as folder:
        # Gmsh selects the format by the file's name, and runs the options of a script FILE.msh.opt
        # next to it.
        alone, target = Path(folder) / "mesh.msh", Path(folder) / "mesh.npz"
        alone.symlink_to(path.absolute())
        command = [sys.executable, "-P", str(program), str(alone), str(target)]
        try:
            done = subprocess.run(
                command,
                env=environment_for_gmsh(Path(folder)),
                cwd=folder,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
            )
        except OSError as error:
            raise InputError(f"gmsh cannot be started to read '{path}': {error}") from error
        if b"    import gmsh" in done.stderr:  # the line at which it crashed
            raise InputError(NO_GMSH)
        if not target.exists() or done.returncode:
            end = f"exit status {done.returncode}"
            if done.returncode < 0:
                end = signal.strsignal(-done.returncode) or end
            raise InputError(
                f"gmsh cannot read '{path}': it crashed ({end.lower()}), so the file is damaged;"
                " save the mesh again"
            )
        with np.load(target) as arrays:
            about = json.loads(str(arrays["about"]))
            if about["fault"] is not None:
                fault = about["fault"].replace(str(alone), str(path))
                raise InputError(f"gmsh cannot read '{path}': {fault}")
            blocks = [
                Block(dim, entity, groups, kind, arrays[f"block_{number}"].astype(np.int64))
                for number, (dim, entity, groups, kind) in enumerate(about["blocks"])
            ]
            types = {int(kind): tuple(properties) for kind, properties in about["types"].items()}
            nodes = (arrays["tags"].astype(np.int64), arrays["coordinates"])
            return Content(blocks, about["groups"], types, *nodes)


def windows_path(path: Path) -> str:
    """Return the remedy for a missing file of this name."""
    name = str(path)
    if not name.isprintable():  # "C:\temp\new.msh" contains a tab and a new line
        return (
            "in double quotes \\ is an escape: write / in the path, or put the path in "
            "single quotes"
        )
    return "write / for \\ in the path" if "\\" in name else "check the path"


def _check_header(path: Path) -> None:
    # Gmsh would run any other text file as a script, and wait at a FIFO.
    try:
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise InputError(f"mesh file '{path}' is not a regular file; save the mesh from gmsh")
        with path.open("rb") as file:
            head = file.read(11)
    except FileNotFoundError as error:
        raise InputError(f"mesh file '{path}' does not exist; {windows_path(path)}") from error
    except (OSError, ValueError) as error:  # ValueError occurs for names that no file can have
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"mesh file '{path}' cannot be read: {reason}") from error
    if not head.startswith((b"$MeshFormat", b"$Comments")):
        remedy = REMEDIES.get(path.suffix.lower(), "save the mesh from gmsh as .msh")
        raise InputError(f"'{path}' is not a gmsh .msh file; {remedy}")
