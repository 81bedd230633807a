"""Determine the kind of a geometry file from its name and its first bytes, without gmsh."""

import re
from pathlib import Path

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.gmsh_reader import windows_path

SCRIPTS = (".geo", ".geo_unrolled")
"""Suffixes of gmsh's scripts. A script may contain named physical groups, and may execute any
command."""

STEP = b"ISO-10303-21"

IGES = re.compile(rb"^.{72}[SBC][ 0]{6}1", re.MULTILINE)
"""In the first line of an IGES file, column 73 has the letter of the section, and the line number
follows."""

IMPORTED = {
    ".step": re.compile(STEP),
    ".stp": re.compile(STEP),
    ".brep": re.compile(b"CASCADE Topology"),
    ".iges": IGES,
    ".igs": IGES,
}
"""Patterns for the beginning of files that OpenCASCADE reads, by suffix."""


def is_script(path: Path) -> bool:
    """Return whether gmsh would run a file as a script, according to its name."""
    return path.suffix.lower() in SCRIPTS


def check_trust(path: Path, trust: bool) -> None:
    """Raise an error for a script that the user has not allowed.

    Args:
        path: A geometry file.
        trust: Whether the user allows scripts.

    Raises:
        InputError: If the file is refused; the message names it.
    """
    if is_script(path) and not trust:
        raise InputError(
            f"'{path}' is a script, through which gmsh may execute any command and write any file; "
            "give --trust if you know its contents, or export the geometry as STEP."
        )


def check_file(path: Path) -> None:
    """Raise an error for a file that is not a geometry file.

    Raises:
        InputError: If the file is refused; the message names it.
    """
    suffix = path.suffix.lower()
    # suffixes of programs, which may create geometries, but are never run
    programs = (".py", ".m", ".jl", ".exe", ".sh", ".bat")
    if suffix in programs:
        raise InputError(
            f"'{path}' is a program, which perfplast never runs; run it yourself if you know its "
            "contents, and give the geometry file that it writes."
        )
    if suffix == ".msh":
        raise InputError(
            f"'{path}' is already a mesh; give it in a case, as file = '{path.name}' under [mesh]."
        )
    if suffix == ".dxf":
        raise InputError(
            f"'{path}' is a 2D drawing of ground; give it in a case, as file = '{path.name}' under "
            "[geometry], with materials and supports for the names of its layers."
        )
    if suffix not in (*IMPORTED, *SCRIPTS):
        known = ", ".join((*IMPORTED, *SCRIPTS))
        raise InputError(
            f"'{path}' does not have the suffix of a geometry file; give a file that ends in one "
            f"of {known}. perfplast mesh also reads models with a mesh, such as .inp, .bdf, .med, "
            ".unv or .vtu."
        )
    if path.exists() and not path.is_file():
        raise InputError(f"'{path}' is not a regular file; give a geometry file.")
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
            f"'{path}' is not in {kind} format, although its suffix says so; export the parts as "
            f"{kind}."
        )


def _begins_as(suffix: str, head: bytes) -> bool:
    """Return whether a file begins as its suffix requires; true for all scripts."""
    return suffix in SCRIPTS or IMPORTED[suffix].search(head) is not None
