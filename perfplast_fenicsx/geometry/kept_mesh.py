"""Store the mesh of a geometry file next to the case file; a separate process makes the mesh."""

import dataclasses
import hashlib
import re
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.environment import (
    REFUSED,
    environment_for_gmsh,
    environment_with_package,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.geometry_file import check_file, check_trust, is_script
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.mesh.gmsh_reader import NO_GMSH

BEGINS = "perfplast "
"""First word of output lines that report the beginning of a stage."""

SURFACE = re.compile(r"Meshing surface (\d+) ")
"""Gmsh's message when it begins to mesh a face."""

VOLUMES = re.compile(r"Meshing 3D")
"""Gmsh's message when all faces are meshed."""


@dataclass(frozen=True)
class Stage:
    """A stage of the meshing program.

    Attributes:
        doing: Description of the stage, which continues "while gmsh was".
        faces: Names of bodies by tag of the face; empty except in the stage of meshing.
    """

    doing: str
    faces: dict[int, str] = field(default_factory=dict)


def begin(stage: Stage) -> None:
    """Print a line that reports the beginning of a stage."""
    print(BEGINS + msgspec.json.encode(stage).decode(), flush=True)


def last_of(output: str) -> str:
    """Return a description of the last stage in the output of the meshing program."""
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


def mesh_geometry(
    source: str | Path,
    target: str | Path,
    options: MeshingOptions | None = None,
    skin: str | Path | None = None,
    trust: bool = False,
) -> Survey:
    """Mesh a geometry file; bodies share no nodes, but their nodes match where the bodies touch.

    Not collective. With ``meshed = "apart"`` the nodes do not match. Names of bodies come from the
    file, and names of faces from their labels, colours and positions.

    Args:
        source: A STEP, BREP, IGES or gmsh .geo file.
        target: The .msh file to write.
        options: Meshing options; None for the defaults.
        skin: An .npz file to write for pictures (:func:`mesher.skin_of`); None writes no such file.
        trust: Whether to run gmsh scripts, which may execute any command.

    Raises:
        InputError: If the file cannot be read or meshed, or if it is a script without ``trust``.
            In these cases no file is written.
    """
    check_file(Path(source))
    check_trust(Path(source), trust)
    options = options or MeshingOptions()
    with tempfile.TemporaryDirectory() as folder:
        mesh, survey = Path(folder) / "mesh.msh", Path(folder) / "survey.json"
        program = [sys.executable, "-P", "-m", "perfplast_fenicsx.geometry"]
        arguments = [
            Path(source).absolute(),
            mesh,
            msgspec.json.encode(options).decode(),
            survey,
        ]
        try:
            done = subprocess.run(
                [*program, *map(str, arguments)],
                env=environment_with_package(environment_for_gmsh(Path(folder))),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=options.patience,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            seen = error.stdout or b""  # bytes here, although an encoding is set
            doing = last_of(seen if isinstance(seen, str) else seen.decode(errors="replace"))
            raise InputError(
                f"'{source}' was not meshed within {options.patience:g} s, while gmsh was {doing}; "
                "give a larger size, fewer elements around circles (curvature = 4) or a longer "
                "time limit (patience), or simplify the geometry in the CAD system."
            ) from error
        if done.returncode:
            if "    import gmsh\n" in done.stderr:  # the traceback shows this line
                raise InputError(NO_GMSH)
            fault = "Traceback (most recent call last)" in done.stderr
            if fault and done.returncode > 0 and done.returncode != REFUSED:
                raise RuntimeError(f"a fault of the meshing program:\n{done.stderr}")
            raise InputError(_cause(str(source), done.returncode, done.stderr))
        Path(target).write_bytes(mesh.read_bytes())
        if skin is not None:
            Path(skin).write_bytes(mesh.with_suffix(".npz").read_bytes())
        return msgspec.json.decode(survey.read_bytes(), type=Survey)


def _cause(source: str, status: int, complaints: str) -> str:
    if status == REFUSED:
        return complaints.strip().splitlines()[-1]
    if status > 0:  # gmsh has ended the program
        error = re.search(r"^Error\s*: (.*)$", complaints, re.MULTILINE)
        why = error[1].strip().rstrip(".") if error else f"status {status}"
        return (
            f"gmsh could not mesh '{source}' ({why}); repair the geometry in the CAD system and "
            "export it again, or give another size."
        )
    how = (signal.strsignal(-status) or f"signal {-status}").lower()
    return (
        f"gmsh crashed while meshing '{source}' ({how}); repair the geometry in the CAD system and "
        "export it again, or give another size."
    )


READS_OTHERS = re.compile(rb"\b(Merge|Include|ShapeFromFile)\b")
"""Commands with which a gmsh script reads other files; changes of these files are not detected."""

MARK = b"$Comments\nmade by perfplast of "
"""Beginning of the last section in a .msh file, which identifies the origin of the mesh."""

GLUED = b"$Comments\nglued unless contacts or ties say otherwise: "
"""Beginning of the section in a .msh file with the pairs of surfaces that share faces in the
drawing."""

DRAWN = b"$Comments\nareas in the drawing: "
"""Beginning of the section in a .msh file with the areas of surfaces in the drawing."""

KIND = "single faces, shared ones, areas of the drawing, facets along cylinders"
"""Version of the content of mesh files; the program replaces a file of another version."""

END = b"\n$EndComments\n"


def keep_mesh(source: Path, mesh: Path, options: MeshingOptions, trust: bool = False) -> None:
    """Make a mesh if none exists for the same geometry and options. Not collective.

    Args:
        source: The geometry file.
        mesh: The .msh file.
        options: Options of the mesher.
        trust: Whether to run a script; not necessary if the existing mesh is still valid.

    Raises:
        InputError: If the file cannot be read or meshed, if the mesh cannot be written, if a mesh
            of another origin exists, or if the file is a script without ``trust``. In these cases
            no file is written.
    """
    check_file(source)
    try:
        content = source.read_bytes()
        before = _made_of(mesh)
    except OSError as error:
        raise InputError(
            f"'{error.filename}' cannot be read ({error.strerror}); check its permissions."
        ) from error
    if mesh.exists() and before is None:
        raise InputError(
            f"'{mesh}' would be generated from '{source}', but a mesh file of another origin "
            "already has this name; move this mesh file, or give it as file under [mesh] instead "
            "of [geometry]."
        )
    scripted = is_script(source) and READS_OTHERS.search(content)
    if before != _fingerprint(content, options) or scripted:
        check_trust(source, trust)
        make_mesh(source, mesh, options, trust=trust)


def make_mesh(
    source: Path,
    mesh: Path,
    options: MeshingOptions,
    skin: Path | None = None,
    trust: bool = False,
) -> Survey:
    """Make a mesh file that identifies its origin, and return the survey. Not collective.

    Args:
        source: The geometry file.
        mesh: The .msh file; it is replaced as a whole.
        options: Options of the mesher.
        skin: An .npz file to write for pictures; None writes no such file.
        trust: Whether to run a script.

    Returns:
        The survey of the geometry.

    Raises:
        InputError: If the file cannot be read or meshed, or if the mesh cannot be written. In
            these cases no file is written.
    """
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.msh"
        survey = mesh_geometry(source, made, options, skin, trust)
        try:
            glued = [it.surfaces for it in survey.joints if it.shared and options.shared == "glued"]
            mark = GLUED + msgspec.json.encode(glued) + END if glued else b""
            mark += DRAWN + msgspec.json.encode(survey.drawn_areas()) + END
            mark += MARK + _fingerprint(source.read_bytes(), options) + END
            replace(mesh, made.read_bytes() + mark)
        except OSError as error:
            raise InputError(
                f"'{mesh}' cannot be written ({error.strerror or error}); free some "
                "space, or allow writing in its folder."
            ) from error
    return survey


def glued_in(mesh: Path) -> list[tuple[str, str]]:
    """Return the pairs of surfaces that are glued unless the case names them. Not collective."""
    return msgspec.json.decode(_section(mesh, GLUED) or b"[]", type=list[tuple[str, str]])


def drawn_in(mesh: Path) -> dict[str, float]:
    """Return the areas of surfaces in the drawing, as far as they are known. Not collective."""
    return msgspec.json.decode(_section(mesh, DRAWN) or b"{}", type=dict[str, float])


def _section(mesh: Path, head: bytes) -> bytes:
    """Return the text of the last section with a heading; empty if there is no such section."""
    _, found, rest = mesh.read_bytes().rpartition(head)
    return rest.partition(END)[0] if found else b""


def _fingerprint(content: bytes, options: MeshingOptions) -> bytes:
    """Return a hash of a geometry file, the options except patience, and the program's version."""
    told = msgspec.json.encode(dataclasses.replace(options, patience=1.0))
    version = f"{__version__}, {KIND}".encode()
    parts = [hashlib.sha256(part).digest() for part in (content, told, version)]
    return hashlib.sha256(b"".join(parts)).hexdigest().encode()


def _made_of(mesh: Path) -> bytes | None:
    """Return the hash at the end of a .msh file; None if the file or the hash is missing."""
    if not mesh.exists():
        return None
    with mesh.open("rb") as file:
        file.seek(0, 2)
        file.seek(max(0, file.tell() - 200))
        end = file.read()
    _, mark, rest = end.rpartition(MARK)
    return rest.removesuffix(END) if mark else None
