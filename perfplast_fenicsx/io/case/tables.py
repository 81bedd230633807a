"""Define dataclasses for tables of a case file.

The dataclasses for materials, contacts, obstacles, loadings and algorithms are in the modules that
use them.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class Document:
    """The top level of a case file.

    Args:
        mesh: Mesh of the bodies. With a geometry, omit this table, or give only ``adapt``.
        geometry: A CAD file that is meshed for the run, or the meshing options for drawn ground.
        region: Ground that is drawn in the case; each table is a polygon.
        stratum: Ground that is drawn in the case as layers; the order is from the surface
            downwards.
        line: Lines in drawn ground; mesh edges follow them, and they name parts of the boundary.
        material: The material law of each body; NAME is the name of the body's physical volume.
        load: Loads. The load factor ζ multiplies all loads except constant ones.
        loading: How the bodies are loaded, and which quantity is prescribed. Omit this table with
            stages.
        stage: A loading history, instead of [loading]. Plastic strains remain from stage to stage.
        model: Meaning of the coordinates of a plane mesh.
        title: Title of the case; the default is the name of the file.
        gravity: The weight of the bodies, from their densities.
        earthquake: A horizontal force on all bodies with a weight.
        water: Hydrostatic water in the pores of the ground and above the ground, from a water
            table.
        seepage: Steady flow of water through the ground.
        combination: Loads that act together, each with a factor. Each combination is solved
            separately; results include a table that lists the worst combination first.
        design: Partial factors on strengths.
        support: Supports of the bodies.
        temperature: Changes of temperature.
        initial_stress: Stress of bodies before any load acts.
        bolt: Bolts that are tightened before any load acts.
        contact: Pairs of surfaces that touch or may touch each other.
        obstacle: Rigid obstacles, which may move.
        tie: Pairs of surfaces that are glued together.
        rigid_surface: Surfaces that each move as a rigid body.
        element: The finite elements.
        solve: The solution algorithm and its options.
        output: Files that a run writes.
        report: Document data for the head of the report.
        units: Units of the numbers.
    """

    material: dict[str, Table]
    mesh: Table = field(default_factory=dict)
    geometry: Table | None = None
    region: list[Table] = field(default_factory=list)
    stratum: list[Table] = field(default_factory=list)
    line: list[Table] = field(default_factory=list)
    loading: Table | None = None
    stage: list[Table] = field(default_factory=list)
    model: Table = field(default_factory=dict)
    title: str = ""
    load: list[Table] = field(default_factory=list)
    gravity: Table | None = None
    earthquake: Table | None = None
    water: Table | None = None
    seepage: Table | None = None
    combination: list[Table] = field(default_factory=list)
    design: Table = field(default_factory=dict)
    support: list[Table] = field(default_factory=list)
    temperature: list[Table] = field(default_factory=list)
    initial_stress: list[Table] = field(default_factory=list)
    bolt: list[Table] = field(default_factory=list)
    contact: list[Table] = field(default_factory=list)
    obstacle: list[Table] = field(default_factory=list)
    tie: list[Table] = field(default_factory=list)
    rigid_surface: list[Table] = field(default_factory=list)
    element: Table = field(default_factory=dict)
    solve: Table = field(default_factory=dict)
    output: Table = field(default_factory=dict)
    report: Table = field(default_factory=dict)
    units: Table = field(default_factory=dict)


@dataclass(frozen=True)
class OutputOptions:
    """Files that a run writes in addition to ``summary.json`` and ``path.csv``.

    Args:
        fields: Whether to write ``fields.vtkhdf.series`` and the folder ``fields``.
        pictures: Whether to draw ``path.png``, and with fields also ``fields.png`` and
            ``mechanism.png``.
        points: Whether to write stress, yield ratio, a plastic flag and volume at the quadrature
            points: ``points.vtkhdf.series`` and ``mechanism_points.vtkhdf``. The key has an effect
            only with fields.
    """

    fields: bool = True
    pictures: bool = True
    points: bool = False


@dataclass(frozen=True)
class ReportHead:
    """Document data for the head of the report and for ``summary.json``.

    The report has signature lines, each with a date, if one of the keys from ``client`` to
    ``approved`` is given.

    Args:
        project: Project of the case.
        number: Number of the case or the document, as a string such as ``"2026-17 b"``.
        author: Person who is responsible for the computation.
        client: Recipient of the report.
        revision: Revision of the document, as a string such as ``"B"``.
        prepared: Name of the person who prepared the document.
        checked: Name of the person who checks the document.
        approved: Name of the person who approves the document.
    """

    project: str = ""
    number: str = ""
    author: str = ""
    client: str = ""
    revision: str = ""
    prepared: str = ""
    checked: str = ""
    approved: str = ""

    @property
    def given(self) -> dict[str, str]:
        """Return the texts that are not empty, by their keys."""
        return {key: text for key, text in vars(self).items() if text}


@dataclass(frozen=True)
class ModelOptions:
    """Meaning of the coordinates of a mesh of triangles.

    In axisymmetry x is the radius (x ≥ 0), y is the axis of revolution, and the stress component zz
    is the hoop stress, also in an initial stress. Points on the axis do not move radially, even
    without a support. Loads are per area and per volume, as in other models. All forces and works
    in results refer to the full turn. The column r of a force is the sum of outward forces around
    the axis, not a vector resultant.

    In plane stress, triangles are sheets whose thickness is free to change. The law must be von
    Mises, Hill or elastic. All forces and works in results are per unit of thickness.

    Args:
        kind: Kind of the plane model; the default is plane strain.
        thickness: Thickness of sheets in plane stress (length); the default is 1. Forces and
            moments on a whole surface are divided by the thickness.
    """

    kind: Literal["plane-strain", "plane-stress", "axisymmetric"] | None = None
    thickness: float | None = None

    def __post_init__(self) -> None:
        if self.thickness is not None and self.kind != "plane-stress":
            raise InputError(
                f"thickness = {self.thickness} applies only to kind = 'plane-stress', but kind is"
                f" '{self.kind or 'plane-strain'}'; change kind, or remove thickness."
            )

    def of(self, tagged_mesh: TaggedMesh) -> TaggedMesh:
        """Return the mesh as a mesh of this kind of model. Collective.

        Raises:
            InputError: If the mesh consists of tetrahedra or reaches negative radii, or if the
                thickness is not positive.
        """
        if self.kind == "axisymmetric":
            return tagged_mesh.turned()
        if self.kind == "plane-stress":
            return tagged_mesh.thin(1.0 if self.thickness is None else self.thickness)
        if self.kind is not None and tagged_mesh.mesh.geometry.dim == 3:
            raise InputError(
                f"kind = '{self.kind}' applies only to meshes of triangles, but this mesh has "
                "tetrahedra; remove kind."
            )
        return tagged_mesh


@dataclass(frozen=True)
class ElementOptions:
    """The finite element.

    Args:
        degree: Polynomial degree of the displacements, 1 or 2. The default is 1, but with control =
            "bounds" the mechanisms have degree 2 by default.
    """

    degree: Literal[1, 2] = 1


@dataclass(frozen=True)
class MeshFile:
    """A gmsh mesh file with tetrahedra, or with triangles in a plane z = const.

    Args:
        file: Path of the file, relative to the folder of the case file. Bodies and surfaces must be
            named physical groups.
        adapt: Options for bounds on successively finer meshes, with control = "bounds" or
            "strength".
    """

    file: str
    adapt: Table | None = None


@dataclass(frozen=True)
class MeshBuilder:
    """A structured mesh from :mod:`perfplast_fenicsx.mesh.sample_meshes`, with its arguments.

    Args:
        builder: Name of the builder.
        arguments: Arguments of the builder, each as a separate key.
        adapt: See :class:`~perfplast_fenicsx.io.case.tables.MeshFile`.
    """

    builder: str
    arguments: dict[str, Any]
    adapt: Table | None = None
