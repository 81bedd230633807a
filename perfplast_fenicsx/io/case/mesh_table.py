"""Read ``[mesh]``, ``[geometry]`` or drawn ground, and how the mesh is adapted."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround
from perfplast_fenicsx.io.case.geometry_table import (
    GeometryFile,
    GroundInCase,
    read_geometry,
)
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.io.case.tables import MeshBuilder, MeshFile
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.mesh.overlapping_bodies import check_bodies
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh

CaseMesh = MeshFile | MeshBuilder | GeometryFile | GroundInCase
"""The mesh of a case, or the data from which it is made."""


def read_mesh(
    table: Table, geometry: Table | None, name: str, ground: DrawnGround | None = None
) -> CaseMesh:
    """Return the mesh, or the data from which it is made.

    Args:
        table: ``[mesh]``.
        geometry: ``[geometry]``, if there is one.
        name: Name of the case file.
        ground: The ground that the case draws, if any.

    Raises:
        InputError: If there is not exactly one of a file and a builder, or if keys are wrong.
    """
    place = f"{name}, [mesh]"
    if geometry is not None or ground is not None:
        return read_geometry(geometry or {}, table, f"{name}, [geometry]", ground)
    if ("builder" in table) == ("file" in table):
        what = "both a builder and a file" if "builder" in table else "neither a builder nor a file"
        raise InputError(
            f"{place}: there is {what}; give either builder = 'two_blocks' or another builder"
            " with its arguments, or file = 'assembly.msh', or a [geometry] instead, or draw"
            " ground by [[region]]."
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
    """Build the mesh of a case, or read it and check its bodies. Collective.

    Args:
        comm: The ranks of the run.
        mesh: The mesh, or its data.
        case: The case file.
        contacts: The contacts; for a measured interference, bodies may overlap.
        trust: Whether to run a script that makes it.

    Raises:
        InputError: If the builder or file does not exist, if its arguments or content are wrong, or
            if bodies overlap or are cut inside.
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
    """Return the adaptation of the mesh; None without one.

    Raises:
        InputError: If no bounds of the body are sought, or if keys are wrong.
    """
    if table is None:
        return None
    if not loading.of_body:
        raise InputError(
            f"{place}: meshes are adapted to bounds, which need control = 'bounds' or "
            "'strength' under [loading]; choose one of these, or remove adapt."
        )
    adaptation = convert(table, Adaptation, place)
    with at(place):
        adaptation.check_design(loading.design)
    return adaptation
