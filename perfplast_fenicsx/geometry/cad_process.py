"""Start the meshing program in a separate process, so that a crash of gmsh does no harm."""

import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import msgspec

from perfplast_fenicsx.child_process import (
    REFUSED,
    environment_for_gmsh,
    environment_with_package,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.geometry_file import check_file, check_trust
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.progress import last_of
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.mesh.gmsh_subprocess import NO_GMSH


def mesh_geometry(
    source: str | Path,
    target: str | Path,
    options: MeshingOptions | None = None,
    skin: str | Path | None = None,
    trust: bool = False,
) -> Survey:
    """Mesh a geometry file: touching bodies have matching nodes, but share none.

    Not collective. The program creates all names: of bodies from the file, of faces from their
    positions.

    Args:
        source: A STEP, BREP or IGES file, or gmsh's .geo.
        target: The .msh file to write.
        options: Sizes and degree of the elements.
        skin: An .npz file to write for pictures (:func:`skin.skin_of`); None for none.
        trust: Whether to run gmsh's scripts, which may run any command.

    Raises:
        InputError: If the file cannot be read or meshed, or if it is a script without ``trust``;
            nothing is written in this case.
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
            seen = error.stdout or b""  # bytes, since the encoding is unknown
            doing = last_of(seen if isinstance(seen, str) else seen.decode(errors="replace"))
            raise InputError(
                f"'{source}' was not meshed within {options.patience:g} s, while gmsh was "
                f"{doing}; give a larger size, fewer elements around circles (curvature = "
                "4) or more patience, or simplify the geometry in the CAD system."
            ) from error
        if done.returncode:
            if "    import gmsh\n" in done.stderr:  # the line at which it crashed
                raise InputError(NO_GMSH)
            if done.returncode > 0 and done.returncode != REFUSED:
                raise RuntimeError(f"a fault of the meshing program:\n{done.stderr}")
            raise InputError(_cause(str(source), done.returncode, done.stderr))
        Path(target).write_bytes(mesh.read_bytes())
        if skin is not None:
            Path(skin).write_bytes(mesh.with_suffix(".npz").read_bytes())
        return msgspec.json.decode(survey.read_bytes(), type=Survey)


def _cause(source: str, status: int, complaints: str) -> str:
    if status == REFUSED:
        return complaints.strip().splitlines()[-1]
    how = (signal.strsignal(-status) or f"signal {-status}").lower()
    return (
        f"gmsh crashed while meshing '{source}' ({how}); heal the geometry in the CAD system and"
        " export it again, or give another size."
    )
