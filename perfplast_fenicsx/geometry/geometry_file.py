"""Determine the kind of a geometry file from its name and beginning, without gmsh."""

import re
from pathlib import Path

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.gmsh_reader import windows_path

SCRIPTS = (".geo", ".geo_unrolled")
"""Gmsh's own files. They may contain named physical groups, and may run any command."""

STEP = b"ISO-10303-21"

IGES = re.compile(rb"^.{72}[SBC][ 0]{6}1", re.MULTILINE)
"""The first line of an IGES file has the letter of its section in column 73, followed by its
number."""

IMPORTED = {
    ".step": re.compile(STEP),
    ".stp": re.compile(STEP),
    ".brep": re.compile(b"CASCADE Topology"),
    ".iges": IGES,
    ".igs": IGES,
}
"""Formats that OpenCASCADE reads, with a pattern for the beginning of the file."""


def is_script(path: Path) -> bool:
    """Return whether gmsh would run a file as a script, judged by its name."""
    return path.suffix.lower() in SCRIPTS


def check_trust(path: Path, trust: bool) -> None:
    """Refuse a script without the user's permission.

    Args:
        path: A geometry file.
        trust: Whether the user allows the script.

    Raises:
        InputError: Naming the file.
    """
    if is_script(path) and not trust:
        raise InputError(
            f"'{path}' is a script, with which gmsh may run any command and write any "
            "file; give --trust if you know its contents, or export the geometry as STEP."
        )


def check_file(path: Path) -> None:
    """Refuse files that are not geometry files.

    Raises:
        InputError: Naming the file.
    """
    suffix = path.suffix.lower()
    # Programs that would create geometries or meshes, but are never run.
    programs = (".py", ".m", ".jl", ".exe", ".sh", ".bat")
    if suffix in programs:
        raise InputError(
            f"'{path}' is a program, which perfplast never runs; run it yourself if you "
            "know its contents, and give the geometry that it writes."
        )
    if suffix == ".msh":
        raise InputError(
            f"'{path}' is already a mesh; give it in a case, as file = '{path.name}' under [mesh]."
        )
    if suffix == ".dxf":
        raise InputError(
            f"'{path}' draws ground in the plane; give it in a case, as file = '{path.name}' "
            "under [geometry], with materials and supports for the names of its layers."
        )
    if suffix not in (*IMPORTED, *SCRIPTS):
        known = ", ".join((*IMPORTED, *SCRIPTS))
        raise InputError(
            f"'{path}' does not have the name of a geometry file; it must end in one of {known};"
            " perfplast mesh also takes models with a mesh, such as .inp, .bdf, .med, .unv or .vtu."
        )
    if path.exists() and not path.is_file():
        raise InputError(f"'{path}' is not a regular file; give the file of the geometry.")
    try:
        with path.open("rb") as file:
            head = file.read(2000)
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror}; {windows_path(path)}."
        ) from error
    if not head.strip():
        raise InputError(f"'{path}' is empty; export the geometry again.")
    if not _begins_as(suffix, head):
        kind = suffix[1:].upper()
        raise InputError(
            f"'{path}' is not in {kind} format despite its name; export the parts as {kind}."
        )


def _begins_as(suffix: str, head: bytes) -> bool:
    """Return whether a file begins as its suffix requires; scripts have no fixed beginning."""
    return suffix in SCRIPTS or IMPORTED[suffix].search(head) is not None
