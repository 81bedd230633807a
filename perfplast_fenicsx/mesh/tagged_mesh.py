"""Store bodies with names in one mesh, and read such a mesh from a gmsh file."""

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
"""The tag of a surface, or several tags if it has several parts or shares facets with others."""

_CELLS = {1: CellType.interval, 2: CellType.triangle, 3: CellType.tetrahedron}


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """Bodies with names in one mesh.

    Volumes that share vertices form one body; separate bodies share no vertex. In a plane mesh the
    "volumes" are areas, and the "surfaces" are curves.

    Attributes:
        mesh: Mesh of triangles or tetrahedra.
        cell_tags: Tag of the volume of each local cell, owned or ghost.
        facet_tags: Tags of the named facets.
        volumes: Tags of the volumes by name, the same on all ranks.
        surfaces: Tag or tags of the surfaces by name, the same on all ranks. Surfaces with common
            facets share the tags of these facets.
        section: Meaning of a mesh of triangles: plane strain, the half section of bodies of
            revolution (:meth:`turned`), or sheets in plane stress (:meth:`thin`).
        remarks: Remarks on the mesh for the user, each a sentence.
        glued: Pairs of surfaces of bodies that share a face in the drawing. A pair is tied if no
            contact or tie names its surfaces.
        taken: Differences between the bodies of this mesh and the bodies of the given mesh, each a
            clause.
        drawn: Areas (in the plane lengths) of surfaces in the drawing by name, as far as they are
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
        """Return a tagged mesh from a DOLFINx mesh and names for its tags. Collective.

        If facets have tags without a name, a sentence in ``remarks`` lists these tags.

        Args:
            mesh: Triangles in the plane, or tetrahedra.
            cell_tags: A tag for each cell; it suffices if one of the ranks that have the cell gives
                the tag.
            facet_tags: Tags of at least the named facets; one rank per facet suffices here too.
            volumes: The tag of each body.
            surfaces: The tag of each surface, or several tags for a surface with several parts.

        Raises:
            InputError: On every rank, if cells or tags have a wrong type or dimension, if a tag is
                missing in the mesh or is not an integer, if two volumes share a tag, or if cells
                belong to no volume.
        """
        dim = mesh.topology.dim
        if mesh.geometry.dim != dim:
            raise InputError(
                f"the mesh has cells of dimension {dim}, but its points have {mesh.geometry.dim} "
                "coordinates; give a mesh of triangles with gdim=2, or of tetrahedra."
            )
        for what, tags, wanted in (("cell", cell_tags, dim), ("facet", facet_tags, dim - 1)):
            if tags.dim != wanted:
                raise InputError(
                    f"the {what} tags belong to entities of dimension {tags.dim}, but the {what}s "
                    f"of this mesh have dimension {wanted}; give tags of {what}s."
                )
        one, several = _numbers("volume", volumes), _numbers("surface", surfaces)
        for name, own in one.items():
            first = next(other for other in one if one[other] == own)
            if len(own) > 1 or first != name:
                what = f"the tag {own[0]} of '{first}'" if first != name else f"the tags {own}"
                raise InputError(
                    f"the volume '{name}' has {what}; give each volume exactly one tag, which no "
                    "other volume has."
                )
        _check_found(mesh, ("volume", "cell"), cell_tags, one)
        _check_found(mesh, ("surface", "facet"), facet_tags, several)
        named = [tag for tags in several.values() for tag in tags]
        unnamed = [tag for tag in _tags_in(mesh, facet_tags) if tag not in named]
        left = f"facets with the tags {str(unnamed)[1:-1]} have no name and are ignored"
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
        """Return the kinematics, which define the meaning of the coordinates."""
        return KINDS["space"] if self.mesh.geometry.dim == 3 else self.section

    @property
    def axisymmetric(self) -> bool:
        """Return whether the mesh is the half section of bodies of revolution."""
        return isinstance(self.section, Axisymmetric)

    @property
    def is_thin(self) -> bool:
        """Return whether the bodies are sheets in plane stress."""
        return isinstance(self.kinematics, PlaneStress)

    def turned(self) -> "TaggedMesh":
        """Return the mesh as a half section of bodies of revolution: x is r, and y is z.

        Vertices close to the axis are moved onto the axis. Collective.

        Raises:
            InputError: If the mesh has tetrahedra, or reaches negative radii.
        """
        if self.mesh.geometry.dim == 3:
            raise InputError(
                "kind = 'axisymmetric' needs a mesh of triangles, but this mesh has tetrahedra; "
                "give the half section of the bodies with x as radius and y along the axis, or "
                "remove kind."
            )
        radii = self.mesh.geometry.x[:, 0]
        low, high = bounding_box(self.mesh.comm, self.mesh.geometry.x.astype(np.float64))
        axis = ON_AXIS * float(np.linalg.norm(high - low))
        if low[0] < -axis:
            raise InputError(
                f"the mesh extends to x = {low[0]:.4g}, but x is the radius in axisymmetry; give "
                "only the half section, where x >= 0."
            )
        radii[np.abs(radii) <= axis] = 0.0
        # areas in the drawing are lengths in the plane
        return replace(self, section=KINDS["axisymmetric"], drawn={})

    def thin(self, thickness: float = 1.0) -> "TaggedMesh":
        """Return the same mesh as sheets in plane stress.

        Args:
            thickness: Thickness (length), by which forces on whole surfaces are divided.

        Raises:
            InputError: If the mesh has tetrahedra, or if the thickness is not positive.
        """
        if self.mesh.geometry.dim == 3:
            raise InputError(
                "plane stress needs a mesh of triangles, but this mesh has tetrahedra; give a "
                "mesh of the mid-plane, or remove kind."
            )
        if not (thickness > 0 and math.isfinite(thickness)):
            raise InputError(
                f"thickness = {thickness} is not a positive length; give a positive number."
            )
        return replace(self, section=PlaneStress(thickness))

    def cells(self, name: str) -> Ints:
        """Return the local indices of a volume's cells, sorted; none on ranks without such cells.

        Raises:
            InputError: On every rank, if the volume does not exist.
        """
        return self.cell_tags.find(_tag("volume", name, self.volumes, self.surfaces))

    def facets(self, name: str) -> Ints:
        """Return the local indices of a surface's facets, sorted; an empty array if there are none.

        Raises:
            InputError: On every rank, if the surface does not exist.
        """
        tags = _tag("surface", name, self.surfaces, self.volumes)
        return self.facet_tags.indices[np.isin(self.facet_tags.values, tags)]

    def tags_of(self, names: Iterable[str]) -> tuple[int, ...]:
        """Return the tags of several surfaces, sorted and without repetition.

        Raises:
            InputError: On every rank, if a surface does not exist.
        """
        tags = [_tag("surface", name, self.surfaces, self.volumes) for name in names]
        return tuple(int(tag) for tag in np.unique(np.concatenate([[], *map(np.atleast_1d, tags)])))

    def left_glued(
        self, named: Iterable[str], cracks: Iterable[str] = ()
    ) -> tuple["TaggedMesh", list[tuple[str, str]]]:
        """Return the mesh, and the glued pairs outside cracks that no contact or tie names.

        Args:
            named: Names of the surfaces of contacts and ties; unknown names are ignored.
            cracks: Names of surfaces that are not glued.

        Returns:
            The mesh, with names such as ``A_rest`` and ``B_rest`` for the parts outside cracks of a
            pair A and B; and the pairs of names.

        Raises:
            InputError: If a contact or tie names only a part of a pair.
        """
        used = {*self.tags_of(name for name in named if name in self.surfaces)}
        open_ = {*self.tags_of(cracks)}
        surfaces, pairs = dict(self.surfaces), list[tuple[str, str]]()
        for pair in self.glued:
            own = [{*self.tags_of([name])} - open_ for name in pair]
            taken = [tags & used for tags in own]
            if any(taken) and taken != own:
                raise InputError(
                    f"a contact or tie names only a part of '{pair[0]}' or '{pair[1]}', but the "
                    "rest is glued, and both parts share nodes; name both sides completely, or "
                    "give crack = true in the [[line]] of an open crack."
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
        """Check that all cells are simplices and belong to a named volume. Collective.

        Raises:
            InputError: If cells have another kind, or if cells belong to no volume.
        """
        kind = self.mesh.topology.cell_name()
        if kind not in ("triangle", "tetrahedron"):
            raise InputError(
                f"the mesh has cells of type {kind}, but only triangles and tetrahedra are "
                "supported; divide the cells, for example with CellType.triangle in DOLFINx."
            )
        tags = list(self.volumes.values())
        named = self.cell_tags.indices[np.isin(self.cell_tags.values, tags)]
        owned = self.mesh.topology.index_map(self.mesh.topology.dim).size_local
        missing = self.mesh.comm.allreduce(owned - np.count_nonzero(named < owned))
        if missing:
            wrong = np.setdiff1d(self.cell_tags.values, tags)
            found = np.unique(np.concatenate(self.mesh.comm.allgather(wrong))).tolist()
            told = f" (tags in the mesh without a volume: {str(found)[1:-1]})" if found else ""
            raise InputError(f"{missing} cells belong to no named volume{told}; name every body.")


def _numbers(kind: str, names: Mapping[str, Tags]) -> dict[str, tuple[int, ...]]:
    """Return the tags of each name as a tuple.

    Raises:
        InputError: If a tag is not an integer, or if a name has no tag.
    """
    found = {}
    for name, given in names.items():
        tags = np.unique(np.ravel(given))
        if not len(tags) or tags.dtype.kind not in "iu":
            raise InputError(
                f"the {kind} '{name}' has the tag {given!r}, which is not an integer; give an "
                "integer."
            )
        found[name] = tuple(int(tag) for tag in tags)
    return found


def _check_found(
    mesh: Mesh, what: tuple[str, str], tags: MeshTags, names: Mapping[str, tuple[int, ...]]
) -> None:
    """Raise an error for a name with a tag that no cell or facet has. Collective.

    Args:
        mesh: The mesh.
        what: Kinds of the named and of the tagged objects, such as ("volume", "cell").
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
    """Return the tags that occur on any rank, sorted. Collective."""
    found: list[int] = np.unique(np.concatenate(mesh.comm.allgather(tags.values))).tolist()
    return found


def _on_all_ranks(mesh: Mesh, tags: MeshTags) -> MeshTags:
    """Return the tags on all ranks that have the tagged entities. Collective."""
    mesh.topology.create_entities(tags.dim)
    mesh.topology.create_connectivity(tags.dim, mesh.topology.dim)
    vector = la.vector(mesh.topology.index_map(tags.dim), 2, dtype=np.int64)
    seen = vector.array.reshape(-1, 2)
    seen[:] = 0
    seen[tags.indices] = np.column_stack([np.ones_like(tags.values), tags.values])
    vector.scatter_reverse(la.InsertMode.add)
    vector.scatter_forward()
    tagged = np.flatnonzero(seen[:, 0]).astype(np.int32)
    # the mean, because several ranks may have given the same tag
    values = seen[tagged, 1] // seen[tagged, 0]
    return meshtags(mesh, tags.dim, tagged, values.astype(np.int32))


def _tag(kind: str, name: str, tags: Mapping[str, Tags], others: Mapping[str, Tags]) -> Tags:
    if name not in tags:
        known = ", ".join(sorted(tags)) or "none"
        if name in others:
            other = "surface" if kind == "volume" else "volume"
            raise InputError(
                f"'{name}' is a {other} of this mesh, but a {kind} is needed here; known {kind}s: "
                f"{known}."
            )
        raise InputError(
            f"'{name}' is not a {kind} of this mesh; known {kind}s: {known}{_hint(name, tags)}."
        )
    return tags[name]


def _hint(name: str, tags: Mapping[str, Tags]) -> str:
    """Return a remedy if the unknown ``name`` means faces that have other names, otherwise ""."""
    if several := re.fullmatch(r"(.+)_face_(\d+)_*", name):
        for kind in ("plane", "cylinder"):
            whole = f"{several[1]}_{kind}_{several[2]}"
            if whole in tags:
                return (
                    f". Several faces lie in this {kind}: '{whole}' contains all of them, and "
                    "perfplast mesh lists the name of each face"
                )
    if side := re.fullmatch(r"(.+)_([xyz])_(low|high)", name):
        return (
            f". The faces on this side of '{side[1]}' have separate names; [[geometry.face]] "
            f'with plane = {{{side[2]} = ...}} and body = "{side[1]}" names the whole '
            "side"
        )
    return ""


def read_gmsh(comm: MPI.Intracomm, path: str | Path, gdim: int | None = None) -> TaggedMesh:
    """Return the mesh in a .msh file; physical groups name bodies and surfaces. Collective.

    A group without a name has its number as name. Surfaces may overlap, because gmsh's groups may
    overlap.

    Rank 0 reads the file; then the mesh is distributed over ``comm`` without ghost cells.
    Second-order geometry is preserved. Surfaces inside a body may be named too.

    Args:
        comm: Communicator of the mesh.
        path: The file.
        gdim: 3 to accept only tetrahedra, 2 to accept only triangles in a plane z = const, None to
            accept both.

    Raises:
        InputError: On every rank, as for :func:`gmsh_reader.read_msh`; also for cells without a
            name, named facets that are not facets of cells, and a folded mesh.
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
            f"{data.facet_count - found} of the {data.facet_count} named surface elements of "
            f"'{path}' are not facets of cells, or occur twice; save the whole mesh again."
        )
    check_sides(mesh)
    return tagged_mesh


def _reordered(nodes: Longs, dim: int) -> Longs:
    """Return the nodes of simplices in DOLFINx's order from gmsh's order."""
    order = np.asarray(cell_perm_gmsh(_CELLS[dim], nodes.shape[1]))
    return np.ascontiguousarray(nodes[:, order])


def distributed_tags(mesh: Mesh, dim: int, nodes: Longs, values: Ints) -> MeshTags:
    """Return tags of entities; any rank may give a tag, by the entity's input nodes. Collective."""
    entities, local_values = distribute_entity_data(mesh, dim, nodes, values)
    mesh.topology.create_connectivity(dim, 0)
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    return meshtags_from_entities(
        mesh, dim, adjacencylist(entities), local_values.astype(np.int32, copy=False)
    )


UNNAMED = np.iinfo(np.int32).min


def values_of(tags: MeshTags, count: int) -> Ints:
    """Return the tags of the first ``count`` local entities; ``UNNAMED`` if they have none."""
    values = np.full(max(count, tags.indices.max(initial=-1) + 1), UNNAMED, dtype=np.int32)
    values[tags.indices] = tags.values
    return values[:count]


def facet_tags_of(tagged_mesh: TaggedMesh, owned: int) -> Ints:
    """Return the tags of the facets of the first ``owned`` cells, shape (owned, dim + 1).

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
    """Return DOLFINx tags of all local cells from their values, shape (num_cells,)."""
    return meshtags(mesh, mesh.topology.dim, np.arange(len(values), dtype=np.int32), values)


def facet_meshtags(mesh: Mesh, of_cell: Ints) -> MeshTags:
    """Return DOLFINx tags of facets from values by cell (:func:`facet_tags_of`). Collective."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    facets = mesh.topology.connectivity(dim, dim - 1).array
    values = of_cell.ravel()
    named = values != UNNAMED
    found, at = np.unique(facets[named], return_index=True)
    return meshtags(mesh, dim - 1, found, values[named][at])


def element_size(tagged_mesh: TaggedMesh) -> float:
    """Return the mean over all cells of their longest edge (length). Collective."""
    mesh = tagged_mesh.mesh
    tdim = mesh.topology.dim
    count = mesh.topology.index_map(tdim).size_local
    longest = mesh.h(tdim, np.arange(count, dtype=np.int32))
    sums = np.array([longest.sum(), count], dtype=np.float64)
    mesh.comm.Allreduce(MPI.IN_PLACE, sums)
    return float(sums[0] / sums[1])
