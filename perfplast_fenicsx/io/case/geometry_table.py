"""``[geometry]`` of a case file: a CAD file that is meshed for the run."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.geometry.face_choice import NamedFace
from perfplast_fenicsx.geometry.kept_mesh import glued_in, keep_mesh
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh


@dataclass(frozen=True)
class GeometryFile:
    """A STEP, BREP or IGES file, or gmsh's ``.geo``, whose bodies are meshed for the run.

    A ``.geo`` is a script that may run any command: it is run with ``--trust`` alone.

    The mesh is kept beside the case file, as ``case.msh`` for ``case.toml``, and is made again
    after the geometry file or this table has changed. ``perfplast mesh`` writes a first case file
    with the names of all bodies and faces.

    Args:
        file: Its path, relative to the folder of the case file.
        options: The other keys.
        adapt: As for files.
    """

    file: str
    options: MeshingOptions
    adapt: Table | None = None

    def mesh(self, comm: MPI.Intracomm, case: Path, trust: bool = False) -> TaggedMesh:
        """The mesh of a case, which rank 0 makes unless it is there. Collective.

        Args:
            comm: The ranks.
            case: The case file.
            trust: Run a script.

        Raises:
            InputError: If the file cannot be read or meshed, or is a script without trust.
        """
        source, mesh = case.parent / self.file, case.with_suffix(".msh")
        on_rank0(comm, lambda: keep_mesh(source, mesh, self.options, trust))
        glued = comm.bcast(on_rank0(comm, lambda: glued_in(mesh)))
        return replace(read_gmsh(comm, mesh), glued=tuple(glued))


def read_geometry(table: Table, mesh: Table, place: str) -> GeometryFile:
    """The geometry.

    Args:
        table: ``[geometry]``.
        mesh: ``[mesh]``, of which ``adapt`` alone may be there.
        place: Where the table is.

    Raises:
        InputError: If there is a mesh besides, or keys are wrong.
    """
    if mesh.keys() - {"adapt"}:
        raise InputError(
            f"{place}: there is a [mesh] besides; leave out one of them, since the bodies are"
            " meshed from the geometry file."
        )
    named = {key: table[key] for key in ("file", "face") if key in table}
    top = convert(named | mesh, _Named, place)
    of_face = f"{place.removesuffix('[geometry]')}[[geometry.face]] number"
    faces = [
        convert(face, NamedFace, f"{of_face} {number}")
        for number, face in enumerate(top.face, start=1)
    ]
    rest = {key: value for key, value in table.items() if key not in named}
    options = convert(rest, MeshingOptions, place)
    with at(place):
        return GeometryFile(top.file, replace(options, face=faces), top.adapt)


@dataclass(frozen=True)
class _Named:
    """Keys that are not passed on to the mesher."""

    file: str
    face: list[Table] = field(default_factory=list)
    adapt: Table | None = None
