"""A mesh with groups as a model: groups of solids are bodies, those of their faces surfaces."""

from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.models.element_types import Block
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel
from perfplast_fenicsx.models.outer_facets import ElementFacets, NamedSurfaces, OuterFacets
from perfplast_fenicsx.models.solid_cells import SolidCells, solid_cells


@dataclass
class GroupedMesh:
    """The content of a file with groups; :func:`model_of` turns it into a model.

    Attributes:
        points: Coordinates of the points, shape (n, 3).
        blocks: Blocks of elements; their numbers continue from block to block.
        groups: Numbers of elements by group name.
        node_groups: Numbers of points by group name.
        materials: Materials by the name of their group of elements.
        left_out: Number of elements of unsupported types, by type.
        turned: Whether a plane mesh is half a section about an axis; None if the file does not say
            so.
        remarks: Remarks on parts without a counterpart, a sentence each.
    """

    points: Floats
    blocks: list[Block]
    groups: dict[str, Longs] = field(default_factory=dict)
    node_groups: dict[str, Longs] = field(default_factory=dict)
    materials: dict[str, ForeignMaterial] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    turned: bool | None = None
    remarks: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Total number of elements."""
        return sum(len(block.nodes) for block in self.blocks)

    def dimensions(self) -> Longs:
        """Return the dimension of each element, shape (count,)."""
        dims = [np.full(len(block.nodes), block.kind.shape.dim) for block in self.blocks]
        return np.concatenate([np.zeros(0, dtype=np.int64), *dims])


def model_of(mesh: GroupedMesh) -> ForeignModel:
    """Return the model of a mesh with its bodies and surfaces.

    Raises:
        InputError: If there are no solids.
    """
    solid = solid_cells(mesh.points, mesh.blocks, mesh.left_out)
    remarks = mesh.remarks + solid.remarks
    if solid.dim == 2 and mesh.turned is None:
        remarks.append(
            'the plane mesh is taken as plane strain; with kind = "axisymmetric" under [model] it'
            " is half a section about the y axis"
        )
    bodies, body, groups = _bodies(mesh, solid, remarks)
    outer = OuterFacets(solid.cells, len(mesh.points))
    names, facets, surface = _surfaces(mesh, solid, outer, bodies, body, remarks)
    return ForeignModel(
        dim=solid.dim,
        turned=bool(mesh.turned),
        points=mesh.points,
        cells=solid.cells,
        body=body,
        bodies=bodies,
        facets=outer.corners[facets],
        surface=surface,
        surfaces=names,
        materials={
            name: mesh.materials[group]
            for name, group in zip(bodies, groups, strict=True)
            if group in mesh.materials
        },
        remarks=remarks,
    )


def _bodies(
    mesh: GroupedMesh, solid: SolidCells, remarks: list[str]
) -> tuple[list[str], Longs, list[str]]:
    """Return names of bodies, the body of each simplex, and the group of each body.

    Where groups overlap, the smaller one gets the common elements. So a group of all elements is
    not a body if there are groups of parts.
    """
    solids = np.flatnonzero(mesh.dimensions() == solid.dim)
    inside = {name: np.intersect1d(members, solids) for name, members in mesh.groups.items()}
    ordered = sorted((name for name in inside if len(inside[name])), key=lambda n: -len(inside[n]))
    owner = np.full(mesh.count, -1)
    for number, name in enumerate(ordered):
        owner[inside[name]] = number
    for number, name in enumerate(ordered):
        left = int((owner[inside[name]] == number).sum())
        if not left:
            remarks.append(
                f"the group '{name}' consists of smaller ones, and is no body of its own"
            )
        elif left < len(inside[name]):
            remarks.append(
                f"{len(inside[name]) - left} elements of the group '{name}' are also in smaller"
                " groups, and belong to the bodies of these"
            )
    there, body = np.unique(owner[solid.parents], return_inverse=True)
    rest = "rest"  # body of the elements without a group
    groups = [ordered[number] if number >= 0 else rest for number in there]
    return unique_names(groups), body.ravel(), groups


def _surfaces(
    mesh: GroupedMesh,
    solid: SolidCells,
    outer: OuterFacets,
    bodies: list[str],
    body: Longs,
    remarks: list[str],
) -> tuple[list[str], Longs, Longs]:
    """Return names of surfaces, their facets, and the surface of each facet."""
    find = ElementFacets(mesh.points, mesh.blocks, outer, solid.dim)
    dims = mesh.dimensions()
    named, inner, lower, no_surface = NamedSurfaces(), [], [], []
    for name, members in mesh.groups.items():
        flat = members[dims[members] == solid.dim - 1]
        facets = find.of_flat_elements(flat)
        if len(facets):
            named.add(name, facets)
        if find.count_of_flat(flat) > len(facets):
            inner.append(name)
        if len(members) and (dims[members] < solid.dim - 1).all():
            lower.append(name)
    for name, nodes in mesh.node_groups.items():
        facets = find.of_nodes(nodes)
        if name in mesh.groups and len(facets):
            continue  # the nodes of a group of elements
        if find.covered(nodes, facets):
            named.add(name, facets)
        else:
            no_surface.append(name)
    _without_skins(named, body[outer.cells], set(mesh.node_groups) - set(mesh.groups), remarks)
    most_shown = 5  # number of names that a remark shows
    for what, names in (
        ("groups of faces that lie inside the bodies, or on no body, are left out there", inner),
        ("groups of edges or points have no counterpart and are left out", lower),
        ("groups of nodes that are no surface are left out", no_surface),
    ):
        if names:
            shown = ", ".join(repr(name) for name in names[:most_shown])
            more = f" and {len(names) - most_shown} more" if len(names) > most_shown else ""
            remarks.append(f"{what}: {shown}{more}")
    plain, facets, surface, stands = named.divided(bodies)
    for name, some in stands.items():
        if len(some) > 1:
            remarks.append(
                f"the surface '{name}' shares faces with others, and is replaced by"
                f" {', '.join(map(repr, some))}"
            )
    return plain, facets, surface


def _without_skins(
    named: NamedSurfaces, skins: Longs, of_nodes: set[str], remarks: list[str]
) -> None:
    """Remove groups of whole skins that contain other groups, which they would only divide.

    Groups of nodes are removed in any case: they are sets of all nodes.

    Args:
        named: Surfaces by the names of their groups.
        skins: Body of each outer facet.
        of_nodes: Names of groups of nodes.
        remarks: List to which a remark on each removed group is appended.
    """
    sizes = np.bincount(skins)
    for name in named.names():
        mine = named.facets(name)
        whole = np.bincount(skins[mine], minlength=len(sizes))
        others = [other for other in named.names() if other != name]
        if (whole == sizes)[whole > 0].all() and (
            name in of_nodes
            or any(
                len(named.facets(other)) < len(mine) and np.isin(named.facets(other), mine).all()
                for other in others
            )
        ):
            named.remove(name)
            remarks.append(
                f"the group '{name}' is the whole skin of bodies, and is no surface of its own"
            )
