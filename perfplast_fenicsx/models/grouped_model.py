"""Make a model from a mesh with groups of solids (bodies) and groups of faces (surfaces)."""

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
    """A mesh with groups, from which :func:`model_of` makes a model.

    Attributes:
        points: Coordinates of the points, shape (n, 3).
        blocks: Blocks of elements; the numbers of elements continue from block to block.
        groups: Numbers of elements by group name.
        node_groups: Numbers of points by group name.
        materials: Materials by name of the group of elements.
        left_out: Number of elements of unsupported types, by type.
        turned: Whether a plane mesh is the half section of bodies of revolution; None if the file
            does not define this.
        remarks: Remarks on parts of the file without a counterpart, each a sentence.
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
        """Return the total number of elements."""
        return sum(len(block.nodes) for block in self.blocks)

    def dimensions(self) -> Longs:
        """Return the dimension of each element, shape (count,)."""
        dims = [np.full(len(block.nodes), block.kind.shape.dim) for block in self.blocks]
        return np.concatenate([np.zeros(0, dtype=np.int64), *dims])


def model_of(mesh: GroupedMesh) -> ForeignModel:
    """Return the model that a mesh with groups defines.

    Raises:
        InputError: If there are no solid elements.
    """
    solid = solid_cells(mesh.points, mesh.blocks, mesh.left_out)
    remarks = mesh.remarks + solid.remarks
    if solid.dim == 2 and mesh.turned is None:
        remarks.append(
            'the plane mesh is read as plane strain; give kind = "axisymmetric" under [model] if'
            " it is the half section of bodies of revolution about the y axis"
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
    """Return the names of the bodies, the body of each simplex, and the group of each body.

    Where groups overlap, the smaller group gets the common elements. So a group of all elements is
    not a body if its parts are also groups.
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
                f"the group '{name}' consists of smaller groups, so it is not a separate body"
            )
        elif left < len(inside[name]):
            remarks.append(
                f"{len(inside[name]) - left} elements of the group '{name}' are also in smaller "
                "groups, so they belong to the bodies of these groups"
            )
    there, body = np.unique(owner[solid.parents], return_inverse=True)
    rest = "rest"  # name of the body of elements without a group
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
    """Return the names of the surfaces, the named facets, and the surface of each facet."""
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
            continue  # this group contains the nodes of the group of elements with the same name
        if find.covered(nodes, facets):
            named.add(name, facets)
        else:
            no_surface.append(name)
    _without_skins(named, body[outer.cells], set(mesh.node_groups) - set(mesh.groups), remarks)
    most_shown = 5  # largest number of names in a remark
    for what, names in (
        ("groups contain faces inside bodies or outside all bodies, which are ignored", inner),
        ("groups of edges or points have no counterpart and are ignored", lower),
        ("groups of nodes that do not form a surface are ignored", no_surface),
    ):
        if names:
            shown = ", ".join(repr(name) for name in names[:most_shown])
            more = f" and {len(names) - most_shown} more" if len(names) > most_shown else ""
            remarks.append(f"{what}: {shown}{more}")
    plain, facets, surface, stands = named.divided(bodies)
    for name, some in stands.items():
        if len(some) > 1:
            remarks.append(
                f"the surface '{name}' shares faces with other surfaces and is replaced by "
                f"{', '.join(map(repr, some))}"
            )
    return plain, facets, surface


def _without_skins(
    named: NamedSurfaces, skins: Longs, of_nodes: set[str], remarks: list[str]
) -> None:
    """Remove groups of the whole surface of bodies, which would only divide other groups.

    Such a group of elements is removed only if it contains other groups. Such a group of nodes is
    always removed, because it usually contains all nodes of the mesh.

    Args:
        named: Surfaces by names of the groups.
        skins: Index of the body of each outer facet.
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
                f"the group '{name}' is the whole surface of bodies, so it is not a separate "
                "surface"
            )
