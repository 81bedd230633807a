"""Store bodies in one mesh with names, and read them from a gmsh file on any number of ranks."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from mpi4py import MPI

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import la
from dolfinx.graph import adjacencylist
from dolfinx.io.utils import cell_perm_gmsh, distribute_entity_data
from dolfinx.mesh import CellType, Mesh, MeshTags, create_mesh, meshtags, meshtags_from_entities

from perfplast_fenicsx.arrays import Ints, Longs
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.mesh.facet_sides import check_sides
from perfplast_fenicsx.mesh.gmsh_reader import GmshMesh, read_msh
from perfplast_fenicsx.mesh.kinematics import KINDS, ON_AXIS, Axisymmetric, Kinematics, PlaneStress
from perfplast_fenicsx.parallel import bounding_box

Tags = int | tuple[int, ...]
"""The tag of a surface; several tags if it shares facets with others or consists of several."""

_CELLS = {1: CellType.interval, 2: CellType.triangle, 3: CellType.tetrahedron}


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """Bodies in one mesh, with names.

    The bodies share no vertex. In a plane mesh the "volumes" are areas and the "surfaces" curves.

    Attributes:
        mesh: Mesh of triangles or tetrahedra.
        cell_tags: Tag of the volume of each local cell, owned and ghost.
        facet_tags: Tags of the named facets.
        volumes: Name to tag, the same on all ranks.
        surfaces: Name to tag, or to several tags, the same on all ranks. Surfaces that have facets
            in common have the tags of these in common.
        section: What the plane of a mesh of triangles is: plane strain, or half a section of bodies
            of revolution (:meth:`turned`), or sheets (:meth:`thin`).
        remarks: Remarks on the mesh for the user, a sentence each.
        glued: Pairs of surfaces of bodies that share faces in the drawing: they are tied where
            neither a contact nor a tie of theirs is given.
        taken: Differences between its bodies and those of the given mesh, in clauses.
        drawn: The area that each surface has in the drawing, in the plane its length, where that is
            known.
    """

    mesh: Mesh
    cell_tags: MeshTags
    facet_tags: MeshTags
    volumes: dict[str, int]
    surfaces: Mapping[str, Tags]
    section: Kinematics = KINDS["plane-strain"]
    remarks: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    glued: tuple[tuple[str, str], ...] = ()
    drawn: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_tags(
        cls,
        mesh: Mesh,
        cell_tags: MeshTags,
        facet_tags: MeshTags,
        volumes: Mapping[str, int],
        surfaces: Mapping[str, Tags],
    ) -> "TaggedMesh":
        """Return a DOLFINx mesh with names for its tags. Collective.

        The sentence in ``remarks`` lists facets whose tag has no name.

        Args:
            mesh: Triangles in the plane, or tetrahedra.
            cell_tags: A tag for each cell; it is enough if one rank with the cell has it.
            facet_tags: Tags of facets, at least of the named ones; one rank is enough as well.
            volumes: The tag of each body.
            surfaces: The tag of each surface; several tags for a surface of several parts.

        Raises:
            InputError: On every rank, if cells or tags have another type or dimension, a tag is not
                an integer, two volumes share a tag, no cell or facet has the tag of a name, or
                cells belong to no volume.
        """
        dim = mesh.topology.dim
        if mesh.geometry.dim != dim:
            raise InputError(
                f"the mesh has cells of dimension {dim} in {mesh.geometry.dim} coordinates; give"
                " one of triangles with gdim=2, or of tetrahedra."
            )
        for what, tags, wanted in (("cell", cell_tags, dim), ("facet", facet_tags, dim - 1)):
            if tags.dim != wanted:
                raise InputError(
                    f"the {what} tags are of entities of dimension {tags.dim}, but {what}s of this"
                    f" mesh have dimension {wanted}; give the tags of {what}s."
                )
        one, several = _numbers("volume", volumes), _numbers("surface", surfaces)
        for name, own in one.items():
            first = next(other for other in one if one[other] == own)
            if len(own) > 1 or first != name:
                what = f"the tag {own[0]} of '{first}'" if first != name else f"the tags {own}"
                raise InputError(
                    f"the volume '{name}' has {what}; give each volume one tag of its own."
                )
        _check_found(mesh, ("volume", "cell"), cell_tags, one)
        _check_found(mesh, ("surface", "facet"), facet_tags, several)
        named = [tag for tags in several.values() for tag in tags]
        unnamed = [tag for tag in _tags_in(mesh, facet_tags) if tag not in named]
        left = f"facets with the tags {str(unnamed)[1:-1]} have no name and are not used"
        tagged_mesh = cls(
            mesh=mesh,
            cell_tags=_on_all_ranks(mesh, cell_tags),
            facet_tags=_on_all_ranks(mesh, facet_tags),
            volumes={name: tags[0] for name, tags in one.items()},
            surfaces={name: tags if len(tags) > 1 else tags[0] for name, tags in several.items()},
            remarks=(left,) if unnamed else (),
        )
        tagged_mesh.check_tagged()
        check_sides(mesh)
        return tagged_mesh

    def __repr__(self) -> str:
        topology = self.mesh.topology
        kind = "triangles" if topology.dim == 2 else "tetrahedra"
        return (
            f"TaggedMesh({topology.index_map(topology.dim).size_global} {kind};"
            f" volumes {', '.join(sorted(self.volumes)) or 'none'};"
            f" surfaces {', '.join(sorted(self.surfaces)) or 'none'})"
        )

    @property
    def kinematics(self) -> Kinematics:
        """Return the meaning of the coordinates."""
        return KINDS["space"] if self.mesh.geometry.dim == 3 else self.section

    @property
    def axisymmetric(self) -> bool:
        """Return whether the mesh is half a section of bodies of revolution."""
        return isinstance(self.section, Axisymmetric)

    @property
    def is_thin(self) -> bool:
        """Return whether bodies are sheets in plane stress."""
        return isinstance(self.kinematics, PlaneStress)

    def turned(self) -> "TaggedMesh":
        """Return the same mesh as half a section of bodies of revolution: x is r, y the axis z.

        Vertices close to the axis are moved onto it. Collective.

        Raises:
            InputError: If the mesh has tetrahedra, or reaches negative radii.
        """
        if self.mesh.geometry.dim == 3:
            raise InputError(
                "axisymmetric bodies need a mesh of triangles, half their section with x "
                "as radius and y along the axis, but this one has tetrahedra; give such a "
                "mesh, or remove kind."
            )
        radii = self.mesh.geometry.x[:, 0]
        low, high = bounding_box(self.mesh.comm, self.mesh.geometry.x.astype(np.float64))
        axis = ON_AXIS * float(np.linalg.norm(high - low))
        if low[0] < -axis:
            raise InputError(
                f"the mesh reaches x = {low[0]:.4g}, but x is the radius in axisymmetry; "
                "give half the section, where x >= 0."
            )
        radii[np.abs(radii) <= axis] = 0.0
        return replace(self, section=KINDS["axisymmetric"], drawn={})  # which are lengths

    def thin(self, thickness: float = 1.0) -> "TaggedMesh":
        """Return the same mesh as sheets in plane stress.

        Args:
            thickness: Thickness over which forces on whole surfaces are spread (length).

        Raises:
            InputError: If the mesh has tetrahedra, or if the thickness is not positive.
        """
        if self.mesh.geometry.dim == 3:
            raise InputError(
                "plane stress needs a mesh of triangles, but this one has tetrahedra; "
                "give a mesh of the middle plane, or remove kind."
            )
        if not (thickness > 0 and math.isfinite(thickness)):
            raise InputError(
                f"thickness = {thickness} is not a positive length; give a positive one."
            )
        return replace(self, section=PlaneStress(thickness))

    def cells(self, name: str) -> Ints:
        """Return local indices of a volume's cells, sorted; empty on ranks without any.

        Raises:
            InputError: If the volume does not exist, on every rank.
        """
        return self.cell_tags.find(_tag("volume", name, self.volumes, self.surfaces))

    def facets(self, name: str) -> Ints:
        """Return local indices of a surface's facets, sorted; empty on ranks without any.

        Raises:
            InputError: If the surface does not exist, on every rank.
        """
        tags = _tag("surface", name, self.surfaces, self.volumes)
        return self.facet_tags.indices[np.isin(self.facet_tags.values, tags)]

    def tags_of(self, names: Iterable[str]) -> tuple[int, ...]:
        """Return the tags of several surfaces, sorted, each once.

        Raises:
            InputError: If a surface does not exist, on every rank.
        """
        tags = [_tag("surface", name, self.surfaces, self.volumes) for name in names]
        return tuple(int(tag) for tag in np.unique(np.concatenate([[], *map(np.atleast_1d, tags)])))

    def left_glued(
        self, named: Iterable[str], cracks: Iterable[str] = ()
    ) -> tuple["TaggedMesh", list[tuple[str, str]]]:
        """Return the glued pairs that contacts and ties do not name, without cracks.

        Args:
            named: The surfaces of contacts and ties; unknown names are ignored.
            cracks: Surfaces that are not glued.

        Returns:
            The mesh, with the names ``A_rest`` and ``B_rest`` for the parts of a pair A and B
            outside cracks; and the pairs.

        Raises:
            InputError: If a contact or tie names a part of a pair.
        """
        used = {*self.tags_of(name for name in named if name in self.surfaces)}
        open_ = {*self.tags_of(cracks)}
        surfaces, pairs = dict(self.surfaces), list[tuple[str, str]]()
        for pair in self.glued:
            own = [{*self.tags_of([name])} - open_ for name in pair]
            taken = [tags & used for tags in own]
            if any(taken) and taken != own:
                raise InputError(
                    f"a contact or tie names a part of '{pair[0]}' or '{pair[1]}', and the rest "
                    "is glued, so the nodes between these parts would belong to both; name both "
                    "sides completely, or give crack = true in the [[line]] of an open crack."
                )
            if any(taken) or not all(own):
                continue
            names = list(pair)
            for k, (name, tags) in enumerate(zip(pair, own, strict=True)):
                if tags != {*self.tags_of([name])}:
                    names[k] = f"{name}_rest"
                    surfaces[names[k]] = tuple(sorted(tags))
            pairs.append((names[0], names[1]))
        return replace(self, surfaces=surfaces), pairs

    def check_tagged(self) -> None:
        """Check that cells are simplices, each of a named volume. Collective.

        Raises:
            InputError: Naming the kind of the cells, or the number of cells outside volumes.
        """
        kind = self.mesh.topology.cell_name()
        if kind not in ("triangle", "tetrahedron"):
            raise InputError(
                f"the mesh has cells of the kind {kind}, but only triangles and tetrahedra "
                "are supported; divide them, for instance by CellType.triangle of DOLFINx."
            )
        tags = list(self.volumes.values())
        named = self.cell_tags.indices[np.isin(self.cell_tags.values, tags)]
        owned = self.mesh.topology.index_map(self.mesh.topology.dim).size_local
        missing = self.mesh.comm.allreduce(owned - np.count_nonzero(named < owned))
        if missing:
            wrong = np.setdiff1d(self.cell_tags.values, tags)
            found = np.unique(np.concatenate(self.mesh.comm.allgather(wrong))).tolist()
            told = (
                f" (the mesh has the tags {str(found)[1:-1]}, which no volume has)" if found else ""
            )
            raise InputError(f"{missing} cells belong to no named volume{told}; name every body")


def _numbers(kind: str, names: Mapping[str, Tags]) -> dict[str, tuple[int, ...]]:
    """Return the tags of each name.

    Raises:
        InputError: If one is not an integer, or if a name has no tag.
    """
    found = {}
    for name, given in names.items():
        tags = np.unique(np.ravel(given))
        if not len(tags) or tags.dtype.kind not in "iu":
            raise InputError(
                f"the {kind} '{name}' has the tag {given!r}; give an integer as the tag."
            )
        found[name] = tuple(int(tag) for tag in tags)
    return found


def _check_found(
    mesh: Mesh, what: tuple[str, str], tags: MeshTags, names: Mapping[str, tuple[int, ...]]
) -> None:
    """Refuse names with tags that no cell or facet has. Collective.

    Args:
        mesh: The mesh.
        what: Kinds of the named and of the tagged objects: ("volume", "cell").
        tags: Tags in the mesh.
        names: The tags of each name.
    """
    there = _tags_in(mesh, tags)
    for name, wanted in names.items():
        if missing := [tag for tag in wanted if tag not in there]:
            known = (
                f"the {what[1]}s have the tags {str(there)[1:-1]}" if there else "there are no tags"
            )
            raise InputError(
                f"the {what[0]} '{name}' has the tag {missing[0]}, which no {what[1]} of the mesh"
                f" has; {known}."
            )


def _tags_in(mesh: Mesh, tags: MeshTags) -> list[int]:
    """Return the tags that any rank has, sorted. Collective."""
    found: list[int] = np.unique(np.concatenate(mesh.comm.allgather(tags.values))).tolist()
    return found


def _on_all_ranks(mesh: Mesh, tags: MeshTags) -> MeshTags:
    """Return tags known to every rank with the entity, if any rank knows them. Collective."""
    mesh.topology.create_entities(tags.dim)
    mesh.topology.create_connectivity(tags.dim, mesh.topology.dim)
    vector = la.vector(mesh.topology.index_map(tags.dim), 2, dtype=np.int64)
    seen = vector.array.reshape(-1, 2)
    seen[:] = 0
    seen[tags.indices] = np.column_stack([np.ones_like(tags.values), tags.values])
    vector.scatter_reverse(la.InsertMode.add)
    vector.scatter_forward()
    tagged = np.flatnonzero(seen[:, 0]).astype(np.int32)
    values = seen[tagged, 1] // seen[tagged, 0]  # several ranks may have given the same tag
    return meshtags(mesh, tags.dim, tagged, values.astype(np.int32))


def _tag(kind: str, name: str, tags: Mapping[str, Tags], others: Mapping[str, Tags]) -> Tags:
    if name not in tags:
        known = ", ".join(sorted(tags)) or "none"
        if name in others:
            other = "surface" if kind == "volume" else "volume"
            raise InputError(
                f"'{name}' is a {other} of this mesh, but a {kind} is needed here: {known}"
            )
        raise InputError(
            f"'{name}' is not a {kind} of this mesh; it has {known}{_hint(name, tags)}"
        )
    return tags[name]


def _hint(name: str, tags: Mapping[str, Tags]) -> str:
    """Return the remedy for a name of several faces or of a part of a side; empty otherwise."""
    if several := re.fullmatch(r"(.+)_face_(\d+)_*", name):
        for kind in ("plane", "cylinder"):
            whole = f"{several[1]}_{kind}_{several[2]}"
            if whole in tags:
                return (
                    f". Several faces lie in one {kind} there: '{whole}' contains all of "
                    "them, and perfplast mesh lists the name of each"
                )
    if side := re.fullmatch(r"(.+)_([xyz])_(low|high)", name):
        return (
            f". Faces on that side of '{side[1]}' have their own names; [[geometry.face]] "
            f'with plane = {{{side[2]} = ...}} and body = "{side[1]}" names the whole '
            "side"
        )
    return ""


def read_gmsh(comm: MPI.Intracomm, path: str | Path, gdim: int | None = None) -> TaggedMesh:
    """Read a .msh file whose physical groups name the bodies and surfaces. Collective.

    A group without a name is named by its number. Surfaces may overlap, as gmsh's groups may.

    Rank 0 reads; the mesh is then distributed over ``comm`` without ghost cells. Second-order
    geometry is preserved. Surfaces inside a body may be named too.

    Args:
        comm: Communicator of the mesh.
        path: The file.
        gdim: 3 if only tetrahedra are accepted, 2 if only triangles in a plane z = const; None for
            either.

    Raises:
        InputError: On every rank, for errors of :func:`gmsh_reader.read_msh`, cells without a name,
            named facets that are not facets of cells, and a mesh that is folded over itself.
    """
    data: GmshMesh | None = on_rank0(comm, lambda: read_msh(path, gdim))
    without_arrays = comm.bcast(data.without_arrays() if data else None)
    data = data or without_arrays
    gdim = data.gdim

    element = basix.ufl.element(
        "Lagrange",
        _CELLS[gdim].name,
        data.degree,
        lagrange_variant=basix.LagrangeVariant.equispaced,
        shape=(gdim,),
    )
    cells = _reordered(data.cells, gdim)
    points = np.ascontiguousarray(data.points[:, :gdim])
    mesh = create_mesh(comm, cells, x=points, e=ufl.Mesh(element))
    facets = _reordered(data.facets, gdim - 1)
    tagged_mesh = TaggedMesh(
        mesh=mesh,
        cell_tags=distributed_tags(mesh, gdim, cells, data.cell_values),
        facet_tags=distributed_tags(mesh, gdim - 1, facets, data.facet_values),
        volumes=data.volumes,
        surfaces=data.surfaces,
        remarks=data.remarks,
    )
    tagged_mesh.check_tagged()
    owned = mesh.topology.index_map(gdim - 1).size_local
    found = comm.allreduce(np.count_nonzero(tagged_mesh.facet_tags.indices < owned))
    if found != data.facet_count:
        raise InputError(
            f"{data.facet_count - found} of the {data.facet_count} named surface elements "
            f"of '{path}' are not facets of cells, or are named twice; save the whole of "
            "one mesh"
        )
    check_sides(mesh)
    return tagged_mesh


def _reordered(nodes: Longs, dim: int) -> Longs:
    """Return the nodes of simplices from gmsh's order to DOLFINx's."""
    order = np.asarray(cell_perm_gmsh(_CELLS[dim], nodes.shape[1]))
    return np.ascontiguousarray(nodes[:, order])


def distributed_tags(mesh: Mesh, dim: int, nodes: Longs, values: Ints) -> MeshTags:
    """Return tags of entities given by their input nodes on any rank. Collective."""
    entities, local_values = distribute_entity_data(mesh, dim, nodes, values)
    mesh.topology.create_connectivity(dim, 0)
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    return meshtags_from_entities(
        mesh, dim, adjacencylist(entities), local_values.astype(np.int32, copy=False)
    )


UNNAMED = np.iinfo(np.int32).min


def values_of(tags: MeshTags, count: int) -> Ints:
    """Return the tag of each of the first local entities; ``UNNAMED`` without a tag."""
    values = np.full(max(count, tags.indices.max(initial=-1) + 1), UNNAMED, dtype=np.int32)
    values[tags.indices] = tags.values
    return values[:count]


def facet_tags_of(tagged_mesh: TaggedMesh, owned: int) -> Ints:
    """Return tags of the facets of the first cells, shape (owned, dim + 1).

    The first call is collective.
    """
    topology = tagged_mesh.mesh.topology
    dim = topology.dim
    topology.create_connectivity(dim, dim - 1)
    facets = topology.index_map(dim - 1)
    tags = values_of(tagged_mesh.facet_tags, facets.size_local + facets.num_ghosts)
    of_cell: Ints = tags[topology.connectivity(dim, dim - 1).array.reshape(-1, dim + 1)[:owned]]
    return of_cell


def cell_meshtags(mesh: Mesh, values: Ints) -> MeshTags:
    """Return the tags of all local cells, shape (num_cells,)."""
    return meshtags(mesh, mesh.topology.dim, np.arange(len(values), dtype=np.int32), values)


def facet_meshtags(mesh: Mesh, of_cell: Ints) -> MeshTags:
    """Return tags of facets given by cell, as from :func:`facet_tags_of`. Collective."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    facets = mesh.topology.connectivity(dim, dim - 1).array
    values = of_cell.ravel()
    named = values != UNNAMED
    found, at = np.unique(facets[named], return_index=True)
    return meshtags(mesh, dim - 1, found, values[named][at])


def element_size(tagged_mesh: TaggedMesh) -> float:
    """Return the mean of the longest edges of the cells (length). Collective."""
    mesh = tagged_mesh.mesh
    tdim = mesh.topology.dim
    count = mesh.topology.index_map(tdim).size_local
    longest = mesh.h(tdim, np.arange(count, dtype=np.int32))
    sums = np.array([longest.sum(), count], dtype=np.float64)
    mesh.comm.Allreduce(MPI.IN_PLACE, sums)
    return float(sums[0] / sums[1])
