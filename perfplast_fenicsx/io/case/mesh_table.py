"""Read ``[mesh]``, ``[geometry]`` or drawn ground, and the options for mesh adaptation."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround, DrawnLine, Region, Stratum
from perfplast_fenicsx.geometry.dxf_file import DxfDrawing, read_dxf
from perfplast_fenicsx.geometry.kept_mesh import drawn_in, glued_in, keep_mesh
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, NamedFace
from perfplast_fenicsx.io.case.schema import T, Table, at, convert
from perfplast_fenicsx.io.case.tables import Document, MeshBuilder, MeshFile
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.mesh.overlapping_bodies import check_bodies
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh


def _kept(comm: MPI.Intracomm, mesh: Path, keep: Callable[[], object]) -> TaggedMesh:
    """Return the mesh in a file, which rank 0 makes first if necessary. Collective.

    The mesh also has the names of surfaces that are glued, and the areas of surfaces in the
    drawing.
    """
    on_rank0(comm, keep)
    glued, drawn = comm.bcast(on_rank0(comm, lambda: (glued_in(mesh), drawn_in(mesh))))
    return replace(read_gmsh(comm, mesh), glued=tuple(glued), drawn=drawn)


@dataclass(frozen=True)
class GeometryFile:
    """A STEP, BREP, IGES or gmsh ``.geo`` file, whose bodies are meshed for the run.

    A ``.geo`` file is a script that may execute any command; it is run only with ``--trust``. A
    ``.dxf`` file draws ground in the plane: each closed line is a ``[[region]]`` and each other
    line a ``[[line]]``, named after its layer.

    The mesh is stored next to the case file, as ``case.msh`` for ``case.toml``. It is made again if
    the geometry file or this table has changed. ``perfplast mesh`` writes a first case file with
    the names of all bodies and faces.

    Args:
        file: Path of the file, relative to the folder of the case file.
        options: The meshing options, from the other keys.
        adapt: See :class:`~perfplast_fenicsx.io.case.tables.MeshFile`.
    """

    file: str
    options: MeshingOptions
    adapt: Table | None = None

    def mesh(self, comm: MPI.Intracomm, case: Path, trust: bool = False) -> TaggedMesh:
        """Return the mesh of a case; rank 0 makes the mesh if necessary. Collective.

        Args:
            comm: The ranks of the run.
            case: The case file.
            trust: Whether to run a script.

        Raises:
            InputError: If the file cannot be read or meshed, or if it is a script without
                ``trust``.
        """
        source, mesh = case.parent / self.file, case.with_suffix(".msh")
        return _kept(comm, mesh, lambda: keep_mesh(source, mesh, self.options, trust))


@dataclass(frozen=True)
class GroundInCase:
    """Ground that a case draws by ``[[region]]``, ``[[stratum]]``, ``[[line]]`` or a DXF file.

    The mesh is stored next to the case file, as for a geometry file.

    Args:
        ground: The drawn ground.
        options: Mesh options.
        adapt: See :class:`~perfplast_fenicsx.io.case.tables.MeshFile`.
    """

    ground: DrawnGround
    options: MeshingOptions
    adapt: Table | None = None

    def mesh(self, comm: MPI.Intracomm, case: Path, trust: bool = False) -> TaggedMesh:
        """Return the mesh of a case; rank 0 makes the mesh if necessary. Collective.

        Args:
            comm: The ranks of the run.
            case: The case file.
            trust: Not used, because the program writes the script itself.

        Raises:
            InputError: If the ground cannot be meshed.
        """
        mesh = case.with_suffix(".msh")
        found = _kept(comm, mesh, lambda: self._keep(case, mesh))
        return replace(found, remarks=(*found.remarks, *self.ground.remarks()))

    def _keep(self, case: Path, mesh: Path) -> None:
        """Make the mesh if it does not exist or is out of date. Not collective."""
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / "ground.geo"
            script.write_text(self.ground.script(), encoding="utf-8")
            try:
                keep_mesh(script, mesh, self.options, trust=True)
            except InputError as error:
                raise InputError(str(error).replace(str(script), case.name)) from error


def is_dxf(table: Table) -> bool:
    """Return whether ``[geometry]`` names a DXF file, which draws ground in the plane."""
    file = table.get("file")
    return isinstance(file, str) and file.lower().endswith(".dxf")


def read_ground(top: Document, case: Path) -> DrawnGround | None:
    """Return the ground that a case draws; None if the case draws no ground.

    Args:
        top: The case.
        case: The case file; the path of a DXF file is relative to its folder.

    Raises:
        InputError: If a key or value is not valid, if a DXF file cannot be read, or if the drawing
            is not valid ground.
    """
    name, geometry = case.name, top.geometry or {}
    regions, strata, lines = top.region, top.stratum, top.line
    of_file = DxfDrawing([], [])
    if is_dxf(geometry):
        with at(f"{name}, [geometry]"):
            of_file = read_dxf(case.parent / geometry["file"])
    if not (regions or strata or lines or of_file.regions or of_file.lines):
        return None
    if not (regions or strata or of_file.regions):
        raise InputError(
            f"{name}, [[line]]: a line needs ground, but the case has no [[region]] or "
            "[[stratum]]; draw the ground, or name faces of a geometry file with "
            "[[geometry.face]]."
        )

    def read(key: str, kind: type[T], tables: Sequence[Table]) -> list[T]:
        places = (f"{name}, [[{key}]] number {number}" for number in range(1, len(tables) + 1))
        return [convert(table, kind, place) for table, place in zip(tables, places, strict=True)]

    drawn = [*of_file.regions, *read("region", Region, regions)]
    layers, named = read("stratum", Stratum, strata), read("line", DrawnLine, lines)
    with at(name):
        return DrawnGround(drawn, layers, [*of_file.lines, *named], notes=of_file.remarks)


def read_geometry(
    table: Table, mesh: Table, place: str, ground: DrawnGround | None = None
) -> GeometryFile | GroundInCase:
    """Return the geometry from which the mesh of a case is made.

    Args:
        table: ``[geometry]``.
        mesh: The table ``[mesh]``, which may contain only ``adapt``.
        place: Place of the table in the input, for messages.
        ground: The ground that the case draws, if any.

    Raises:
        InputError: If ``[mesh]`` defines a mesh as well, or if a key or value is not valid.
    """
    other_file = "file" in table and not is_dxf(table)
    if ground is not None and (mesh.keys() - {"adapt"} or other_file):
        other = "[geometry] file" if other_file else "[mesh] file or builder"
        raise InputError(
            f"{place}: the case draws ground with [[region]] or [[stratum]], but also has a "
            f"{other}; remove one of them."
        )
    if mesh.keys() - {"adapt"}:
        raise InputError(
            f"{place}: the case also has [mesh], but the mesh is made from the geometry file; "
            "remove one of the two tables."
        )
    named = {key: table[key] for key in ("file", "face") if key in table}
    file = {} if ground is None else {"file": ""}
    top = convert(named | mesh | file, _Named, place)
    of_face = f"{place.removesuffix('[geometry]')}[[geometry.face]] number"
    faces = [
        convert(face, NamedFace, f"{of_face} {number}")
        for number, face in enumerate(top.face, start=1)
    ]
    rest = {key: value for key, value in table.items() if key not in named}
    options = convert(rest, MeshingOptions, place)
    options = replace(options, face=faces)
    if ground is not None:
        return GroundInCase(ground, options, top.adapt)
    return GeometryFile(top.file, options, top.adapt)


@dataclass(frozen=True)
class _Named:
    """Keys of ``[geometry]`` and ``[mesh]`` that are not passed to the mesher."""

    file: str
    face: list[Table] = field(default_factory=list)
    adapt: Table | None = None


CaseMesh = MeshFile | MeshBuilder | GeometryFile | GroundInCase
"""The mesh of a case, or the data from which it is made."""


def read_mesh(
    table: Table, geometry: Table | None, name: str, ground: DrawnGround | None = None
) -> CaseMesh:
    """Return the mesh of a case, or the data from which the mesh is made.

    Args:
        table: ``[mesh]``.
        geometry: ``[geometry]``; None if this table is missing.
        name: Name of the case file.
        ground: The ground that the case draws, if any.

    Raises:
        InputError: If the case does not have exactly one source of the mesh, or if a key or value
            is not valid.
    """
    place = f"{name}, [mesh]"
    if geometry is not None or ground is not None:
        return read_geometry(geometry or {}, table, f"{name}, [geometry]", ground)
    if ("builder" in table) == ("file" in table):
        what = "both a builder and a file" if "builder" in table else "neither a builder nor a file"
        raise InputError(
            f"{place}: the case has {what}; give only one of these: a builder with its arguments "
            "(such as builder = 'two_blocks'), a mesh file (file = 'assembly.msh'), a [geometry] "
            "table, or ground drawn by [[region]]."
        )
    if "file" in table:
        return convert(table, MeshFile, place)
    arguments = {key: value for key, value in table.items() if key not in ("builder", "adapt")}
    named = {key: table[key] for key in ("builder", "adapt") if key in table}
    return convert(named | {"arguments": arguments}, MeshBuilder, place)


def load_mesh(
    comm: MPI.Intracomm,
    mesh: CaseMesh,
    case: Path,
    contacts: Sequence[Contact],
    trust: bool,
) -> TaggedMesh:
    """Return the mesh of a case after a check of its bodies. Collective.

    Args:
        comm: The ranks of the run.
        mesh: The mesh, or the data from which it is made.
        case: The case file.
        contacts: The contacts; bodies may overlap if a contact has an interference that is measured
            on the mesh.
        trust: Whether to run a script that makes the mesh.

    Raises:
        InputError: If the builder or file does not exist, if its arguments or content are not
            valid, or if bodies overlap or have cuts through their interior.
    """
    if isinstance(mesh, MeshBuilder):
        return build(comm, mesh.builder, **mesh.arguments)
    if isinstance(mesh, GeometryFile | GroundInCase):
        found = mesh.mesh(comm, case, trust)
    else:
        found = read_gmsh(comm, case.parent / mesh.file)
    meant = any(contact.interference and contact.gap is None for contact in contacts)
    return replace(found, remarks=(*found.remarks, *check_bodies(found, meant)))


def read_adaptation(table: Table | None, loading: Control, place: str) -> Adaptation | None:
    """Return the options for the adaptation of the mesh; None if the mesh is not adapted.

    Raises:
        InputError: If the control computes no bounds for the body, or if a key or value is not
            valid.
    """
    if table is None:
        return None
    if not loading.of_body:
        raise InputError(
            f"{place}: adapt needs bounds; give control = 'bounds' or 'strength' under [loading], "
            "or remove adapt."
        )
    adaptation = convert(table, Adaptation, place)
    with at(place):
        adaptation.check_design(loading.design)
    return adaptation
