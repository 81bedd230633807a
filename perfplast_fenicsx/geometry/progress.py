"""Report the progress of the meshing program as lines of its output, in case of a timeout."""

import re
from dataclasses import dataclass, field

import msgspec

BEGINS = "perfplast "
"""First word of a line that reports a stage."""

SURFACE = re.compile(r"Meshing surface (\d+) ")
"""Gmsh's message when it begins a face."""

VOLUMES = re.compile(r"Meshing 3D")
"""Gmsh's message after all faces are meshed."""


@dataclass(frozen=True)
class Stage:
    """A stage that the program begins.

    Attributes:
        doing: Description of the stage.
        faces: Names of bodies by face, during meshing.
    """

    doing: str
    faces: dict[int, str] = field(default_factory=dict)


def begin(stage: Stage) -> None:
    """Report the beginning of a stage."""
    print(BEGINS + msgspec.json.encode(stage).decode(), flush=True)


def last_of(output: str) -> str:
    """Return the last stage of a program that ended, with the body's name if there is one."""
    stage, doing = Stage("beginning"), "beginning"
    for line in output.splitlines():
        if line.startswith(BEGINS):
            stage = msgspec.json.decode(line.removeprefix(BEGINS), type=Stage)
            doing = stage.doing
        elif (found := SURFACE.search(line)) and int(found[1]) in stage.faces:
            doing = f"meshing a face of '{stage.faces[int(found[1])]}'"
        elif stage.faces and VOLUMES.search(line):
            doing = "filling its bodies with tetrahedra"
    return doing
