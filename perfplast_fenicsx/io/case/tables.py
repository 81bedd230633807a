"""Define the tables of a case file: one dataclass for a table, or several to choose from.

Tables of materials, contacts, obstacles, loadings and algorithms are in the modules that use them.
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
        mesh: Mesh of the bodies; with a geometry the table is missing, or contains only ``adapt``.
        geometry: A CAD file that is meshed for the run, or how drawn ground is meshed.
        region: Ground that is drawn in the case, each part as a polygon.
        stratum: Ground that is drawn in the case as layers, from the surface downwards.
        line: Lines of drawn ground that name parts of its boundary, and that the mesh follows.
        material: The law of each body; NAME is the name of its physical volume.
        load: Loads, at least one unless control = "displacement". The load factor ζ multiplies all
            loads except constant ones.
        loading: How the bodies are loaded and what controls the loading; missing with stages.
        stage: A loading history instead of [loading]: the bodies then remember plastic flow.
        model: Meaning of the coordinates of a plane mesh.
        title: Title of the case; by default the name of the file.
        gravity: The weight of bodies, by their densities.
        earthquake: A horizontal force on everything with a weight.
        water: Water in the pores of ground and above the ground, from its table.
        seepage: Water that flows through the ground.
        combination: Loads that act together with factors, each combination solved separately;
            results include a table with the worst one first.
        design: Partial factors on strengths.
        support: Supports of the bodies.
        temperature: Changes of temperature.
        initial_stress: Stress of bodies before any deformation.
        bolt: Bolts that are tightened before any load acts.
        contact: Surfaces of bodies that touch, or may touch, each other.
        obstacle: Rigid obstacles, which may move.
        tie: Surfaces of bodies that are glued together.
        rigid_surface: Surfaces that move as rigid bodies.
        element: The finite elements.
        solve: The algorithm and its options.
        output: Files that a run writes.
        report: Heading of the report.
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
    """Files of a run in addition to ``summary.json`` and ``path.csv``.

    Args:
        fields: Write ``fields.vtkhdf.series`` and the folder ``fields``.
        pictures: Draw ``path.png``, and with fields also ``fields.png`` and ``mechanism.png``.
        points: With the fields, write stress at the quadrature points, where the solver evaluates
            it, and the volume of each point: ``points.vtkhdf.series`` and
            ``mechanism_points.vtkhdf``.
    """

    fields: bool = True
    pictures: bool = True
    points: bool = False


@dataclass(frozen=True)
class ReportHead:
    """Document data at the head of the report, with the date, and in ``summary.json``.

    With any key from ``client`` on, the report has signature lines with a date next to each.

    Args:
        project: Project of the case.
        number: Number of the case or the document, as text, such as ``"2026-17 b"``.
        author: Person responsible for the computation.
        client: Recipient of the report.
        revision: Revision of the document, as text, such as ``"B"``.
        prepared: Name of the person who prepared the document.
        checked: Name of the person who checks it.
        approved: Name of the person who approves it.
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
        """Return the given texts by their keys."""
        return {key: text for key, text in vars(self).items() if text}


@dataclass(frozen=True)
class ModelOptions:
    """Meaning of the coordinates of a mesh of triangles.

    In axisymmetry x is the radius (x ≥ 0), y the axis of revolution, and zz the hoop direction, as
    in an initial stress. On the axis no point moves radially, even without a support. Loads are per
    area and volume, as in other models. All forces and works in results are those of the full turn.
    The column r of a force is the sum of outward forces around the axis, not a vector resultant.

    In plane stress, triangles are sheets whose thickness is free to change; laws are von Mises,
    Hill or elastic. All forces and works in results are per unit of thickness.

    Args:
        kind: Kind of the model; the default is plane strain.
        thickness: Thickness of sheets in plane stress (length), 1 by default. Forces and moments on
            a whole surface are spread over it.
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
        """Return the mesh with this meaning. Collective.

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
                f"kind = '{self.kind}' is for meshes of triangles, but this mesh has "
                "tetrahedra; remove it."
            )
        return tagged_mesh


@dataclass(frozen=True)
class ElementOptions:
    """The finite element.

    Args:
        degree: Degree of the displacements, 1 or 2; for mechanisms (control = "bounds") 2 by
            default.
    """

    degree: Literal[1, 2] = 1


@dataclass(frozen=True)
class MeshFile:
    """A gmsh file of tetrahedra, or of triangles in a plane z = const for plane strain.

    Args:
        file: Its path, relative to the folder of the case file. Bodies and surfaces have physical
            names.
        adapt: With ``control = "bounds"``: bound the limit load on successively finer meshes.
    """

    file: str
    adapt: Table | None = None


@dataclass(frozen=True)
class MeshBuilder:
    """A structured builder of :mod:`perfplast_fenicsx.mesh.sample_meshes` and its arguments.

    Args:
        builder: Name of the builder.
        arguments: Arguments of the builder, each as a separate key.
        adapt: See :class:`~perfplast_fenicsx.io.case.tables.MeshFile`.
    """

    builder: str
    arguments: dict[str, Any]
    adapt: Table | None = None
