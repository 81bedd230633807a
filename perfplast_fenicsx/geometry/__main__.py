"""Mesh a file: ``python3 -m perfplast_fenicsx.geometry SOURCE TARGET.msh OPTIONS SURVEY``.

:mod:`kept_mesh` starts this program in a separate process, because damaged geometry may make gmsh
crash. The program does not import MPI.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

from perfplast_fenicsx.environment import REFUSED
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.mesher import mesh_file
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.mesh.gmsh_reader import gmsh_session


def main(argv: Sequence[str]) -> int:
    """Mesh a geometry, write the mesh and its survey, and return the exit status."""
    source, target, options, survey = argv
    try:
        with gmsh_session() as gmsh:
            gmsh.logger.start()
            gmsh.option.setNumber("General.Terminal", 1)
            read = msgspec.json.decode(options, type=MeshingOptions)
            found = mesh_file(Path(source), Path(target), read)
    except InputError as error:
        print(error, file=sys.stderr)
        return REFUSED
    Path(survey).write_bytes(msgspec.json.encode(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
