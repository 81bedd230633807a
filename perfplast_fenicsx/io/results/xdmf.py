"""``fields.xdmf`` and ``fields.h5``: the fields of all levels, for ParaView.

The arrays of the mesh and of each level are files of their own in the folder ``fields``, in the
order of the input, whatever the number of ranks. ``fields.xdmf`` describes them as one time series,
``fields.h5`` joins them by links, for those who read arrays themselves (VTK's reader of XDMF cannot
follow them); both are small and replaced as a whole when a level has been written. So no crash
harms the levels that are there, and a restart goes on with them.

The tags of the bodies are a field of each level, ``body``. Those of the named surfaces are in the
.h5 file only, for pictures (``/MeshTags/surfaces``).
"""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import basix.ufl
import h5py
import numpy as np
from dolfinx import fem
from dolfinx.io.utils import cell_perm_vtk

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.compat import coordinate_map, entity_nodes, geometry_dofmap
from perfplast_fenicsx.io.results.array_names import (
    BODY,
    GEOMETRY,
    SURFACE_TAGS,
    SURFACES,
    TOPOLOGY,
)
from perfplast_fenicsx.io.results.global_ordering import (
    Ordering,
    cell_ordering,
    node_ordering,
    with_ghosts,
)
from perfplast_fenicsx.io.results.parallel_hdf5 import Block, block, write_arrays
from perfplast_fenicsx.io.results.result_folder import FIELDS, ResultFolder
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

KINDS = {1: "Scalar", 3: "Vector", 9: "Tensor"}
"""What XDMF calls values of so many components."""

CELLS = {(2, 3): "Triangle", (2, 6): "Triangle_6", (3, 4): "Tetrahedron", (3, 10): "Tetrahedron_10"}
"""What XDMF calls cells of a dimension with so many nodes."""


_Stored = tuple[str, tuple[int, ...]]
"""Where the values of a field are (Node or Cell), and the shape of its array."""


class FieldsFile:
    """Writes fields of load levels, with what is prescribed (ζ or α) as the time."""

    def __init__(
        self,
        folder: ResultFolder,
        assembly: TaggedMesh,
        name: str = "fields.xdmf",
        fields: Mapping[str, fem.Function] | None = None,
        times: Sequence[float] = (),
    ) -> None:
        """Write the mesh and its tags, and take over the levels of an earlier run. Collective.

        Args:
            folder: Where the files are.
            assembly: The mesh, with names.
            name: Of the description.
            fields: Functions like those that the earlier run has written.
            times: Of its levels, from the first one on; later ones are forgotten.

        Raises:
            InputError: If the files cannot be written.
        """
        self._folder, self._path = folder, folder.file(name)
        self._mesh = mesh = assembly.mesh
        self._dofs = geometry_dofmap(mesh)
        self._cells = cell_ordering(mesh)
        self._nodes = node_ordering(mesh, self._dofs, mesh.geometry.index_map())
        self._written: dict[str, fem.Function] = {}
        folder.on_root(lambda: folder.file(FIELDS).mkdir(exist_ok=True))
        arrays = self._mesh_arrays(assembly)
        self._shapes = {name: array.shape for name, array in arrays.items()}
        write_arrays(folder, self._data(0), arrays)
        kept = {name: self._array(name, function) for name, function in (fields or {}).items()}
        self._levels = [(time, _stored(fields or {}, kept)) for time in times]
        self._describe()

    def write(self, fields: Mapping[str, fem.Function], time: float) -> None:
        """Append the fields of a level. Collective.

        Args:
            fields: Nodal or piecewise constant functions by name. Nodal ones get the degree of the
                mesh's geometry, as the format demands.
            time: ζ or α, larger than those before.

        Raises:
            InputError: If the files cannot be written; what was there before is whole.
        """
        arrays = {name: self._array(name, function) for name, function in fields.items()}
        write_arrays(self._folder, self._data(len(self._levels) + 1), arrays)
        self._levels.append((time, _stored(fields, arrays)))
        self._describe()

    def _data(self, level: int) -> Path:
        """The file of a level's arrays; 0 is the mesh."""
        end = f"{level:04}" if level else "mesh"
        stem = "" if self._path.stem == "fields" else f"{self._path.stem}_"
        return self._folder.file(FIELDS) / f"{stem}{end}.h5"

    def _mesh_arrays(self, assembly: TaggedMesh) -> dict[str, Block]:
        """Cells, points, tags of cells; facets with names, which have the order of the ranks."""
        mesh, cells = self._mesh, self._cells
        tdim, gdim = mesh.topology.dim, mesh.geometry.dim
        index_map = mesh.geometry.index_map()
        owned = mesh.topology.index_map(tdim).size_local
        number = with_ghosts(index_map, self._nodes.numbers())
        to_vtk = np.argsort(cell_perm_vtk(mesh.topology.cell_type, self._dofs.shape[1]))
        body = np.zeros(len(self._dofs), dtype=np.int32)
        body[assembly.cell_tags.indices] = assembly.cell_tags.values
        points = np.asarray(mesh.geometry.x[: index_map.size_local, :gdim], dtype=np.float64)

        tags = assembly.facet_tags
        ours = tags.indices < mesh.topology.index_map(tdim - 1).size_local
        corners = entity_nodes(mesh, tdim - 1, tags.indices[ours])[:, :tdim]
        first, total = mesh.comm.exscan(len(corners)) or 0, mesh.comm.allreduce(len(corners))
        return {
            TOPOLOGY: block(cells, number[self._dofs[:owned]][:, to_vtk]),
            GEOMETRY: block(self._nodes, points),
            BODY: block(cells, body[:owned, None]),
            SURFACES: Block(np.ascontiguousarray(number[corners]), first, total),
            SURFACE_TAGS: Block(tags.values[ours].astype(np.int32)[:, None], first, total),
        }

    def _array(self, name: str, function: fem.Function) -> Block:
        """Values at the nodes of the geometry or of the cells, plane vectors with a third zero."""
        writable = self._writable(name, function)
        V, shape = writable.function_space, writable.ufl_shape
        values = writable.x.array.reshape(-1, V.dofmap.index_map_bs)
        at: Ordering = self._cells
        if V.element.basix_element.degree == 0:
            rows = values[V.dofmap.list[:, 0]]
            rows = rows[: self._mesh.topology.index_map(self._mesh.topology.dim).size_local]
        else:
            index_map, at = self._mesh.geometry.index_map(), self._nodes
            rows = np.zeros((index_map.size_local + index_map.num_ghosts, values.shape[1]))
            rows[self._dofs] = values[V.dofmap.list]
            rows = rows[: index_map.size_local]
        if shape == (2,):
            rows = np.column_stack([rows, np.zeros(len(rows))])
        return block(at, rows)

    def _writable(self, name: str, function: fem.Function) -> fem.Function:
        """The function, in the mesh's degree if it is a nodal one of another degree."""
        space = function.function_space
        mesh, degree = space.mesh, space.element.basix_element.degree
        if degree in (0, coordinate_map(mesh).degree):
            return function
        if name not in self._written:
            shape, cell = function.ufl_shape or None, mesh.basix_cell()
            element = basix.ufl.element("P", cell, coordinate_map(mesh).degree, shape=shape)
            self._written[name] = fem.Function(fem.functionspace(mesh, element))
        self._written[name].interpolate(function)
        return self._written[name]

    def _describe(self) -> None:
        """Replace the two small files. Collective."""

        def describe() -> None:
            replace(self._path.with_suffix(".h5"), self._links())
            replace(self._path, self._xdmf().encode())

        self._folder.on_root(describe)

    def _links(self) -> bytes:
        """``fields.h5``: the arrays of all files under the names that DOLFINx would give them."""
        image = io.BytesIO()
        with h5py.File(image, "w") as file:
            for name in self._shapes:
                file[name] = h5py.ExternalLink(f"{FIELDS}/{self._data(0).name}", f"/{name}")
            for number, (time, stored) in enumerate(self._levels, start=1):
                for name in stored:
                    place = f"{FIELDS}/{self._data(number).name}"
                    file[_place(name, time)] = h5py.ExternalLink(place, f"/{name}")
        return image.getvalue()

    def _xdmf(self) -> str:
        """``fields.xdmf``: one time series whose grids have the mesh, its tags and all fields."""
        root = ElementTree.Element("Xdmf", Version="3.0")
        domain = ElementTree.SubElement(root, "Domain")
        if not self._levels:
            self._add_mesh(ElementTree.SubElement(domain, "Grid", Name="mesh", GridType="Uniform"))
        else:
            series = ElementTree.SubElement(
                domain, "Grid", Name="perfplast", GridType="Collection", CollectionType="Temporal"
            )
            for number, (time, stored) in enumerate(self._levels, start=1):
                grid = ElementTree.SubElement(
                    series, "Grid", Name=f"level {number}", GridType="Uniform"
                )
                ElementTree.SubElement(grid, "Time", Value=repr(float(time)))
                self._add_mesh(grid)
                for name, (center, shape) in stored.items():
                    attribute = ElementTree.SubElement(
                        grid, "Attribute", Name=name, AttributeType=KINDS[shape[1]], Center=center
                    )
                    self._add_item(attribute, shape, number, name, "Float", 8)
        ElementTree.indent(root)
        return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"

    def _add_mesh(self, grid: ElementTree.Element) -> None:
        cells, per_cell = self._shapes[TOPOLOGY]
        topology = ElementTree.SubElement(
            grid,
            "Topology",
            TopologyType=CELLS[self._mesh.topology.dim, per_cell],
            NumberOfElements=str(cells),
            NodesPerElement=str(per_cell),
        )
        self._add_item(topology, (cells, per_cell), 0, TOPOLOGY, "Int", 8)
        kind = "XYZ" if self._mesh.geometry.dim == 3 else "XY"
        geometry = ElementTree.SubElement(grid, "Geometry", GeometryType=kind)
        self._add_item(geometry, self._shapes[GEOMETRY], 0, GEOMETRY, "Float", 8)
        body = ElementTree.SubElement(
            grid, "Attribute", Name="body", AttributeType="Scalar", Center="Cell"
        )
        self._add_item(body, self._shapes[BODY], 0, BODY, "Int", 4)

    def _add_item(
        self,
        parent: ElementTree.Element,
        shape: tuple[int, ...],
        level: int,
        name: str,
        kind: str,
        precision: int,
    ) -> None:
        item = ElementTree.SubElement(
            parent,
            "DataItem",
            Dimensions=" ".join(map(str, shape)),
            NumberType=kind,
            Precision=str(precision),
            Format="HDF",
        )
        item.text = f"{FIELDS}/{self._data(level).name}:/{name}"


def _stored(fields: Mapping[str, fem.Function], arrays: Mapping[str, Block]) -> dict[str, _Stored]:
    def center(function: fem.Function) -> str:
        return "Node" if function.function_space.element.basix_element.degree else "Cell"

    return {name: (center(fields[name]), array.shape) for name, array in arrays.items()}


def _place(name: str, time: float) -> str:
    return f"Function/{name}/{repr(float(time)).replace('.', '_')}"
