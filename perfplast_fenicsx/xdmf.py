"""``fields.xdmf`` and ``fields.h5``: the fields of all levels, for ParaView.

DOLFINx writes the arrays in parallel, but describes each field as a time series of its own, which
ParaView shows as that many copies of the mesh. The description is therefore rewritten as one time
series that has all fields; the arrays stay as they are. Between two levels both files are closed.

The tags of the bodies are a field of each level, ``body``. Those of the named surfaces are in the
.h5 file only, for pictures (``/MeshTags/surfaces``).
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import basix.ufl
from dolfinx import fem
from dolfinx.io import XDMFFile

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.compat import coordinate_map
from perfplast_fenicsx.output import ResultFolder


class FieldsFile:
    """Writes fields of load levels, with what is prescribed (ζ or α) as the time."""

    def __init__(self, folder: ResultFolder, assembly: Assembly, name: str = "fields.xdmf") -> None:
        """Write the mesh and its tags. Collective."""
        self._folder = folder
        self._path = folder.file(name)
        self._by_dolfinx = ""
        self._written: dict[str, fem.Function] = {}
        with XDMFFile(folder.comm, self._path, "w") as file:
            file.write_mesh(assembly.mesh)
            for tags, called in ((assembly.cell_tags, "body"), (assembly.facet_tags, "surfaces")):
                tags.name = called
                file.write_meshtags(tags, assembly.mesh.geometry)
        self._keep()

    def write(self, fields: Mapping[str, fem.Function], time: float) -> None:
        """Append the fields of a level. Collective.

        Args:
            fields: Nodal or piecewise constant functions by name. Nodal ones get the degree of the
                mesh's geometry, as the format demands.
            time: ζ or α, larger than those before.

        Raises:
            InputError: If the files cannot be written.
        """
        self._folder.on_root(lambda: _write(self._path, self._by_dolfinx))
        with XDMFFile(self._folder.comm, self._path, "a") as file:
            for name, function in fields.items():
                writable = self._writable(name, function)
                writable.name = name
                file.write_function(writable, time)
        self._keep()
        self._folder.on_root(lambda: _write(self._path, one_series(self._by_dolfinx)))

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

    def _keep(self) -> None:
        def keep() -> None:
            self._by_dolfinx = self._path.read_text(encoding="utf-8")

        self._folder.on_root(keep)


def one_series(text: str) -> str:
    """Merge the time series of the fields of an XDMF description into one.

    Args:
        text: What DOLFINx writes: the mesh as a Uniform grid, tags of cells (``body``) and facets
            as others, then a Temporal collection for each field, whose grids refer to the mesh.

    Returns:
        One Temporal collection, whose grids have the mesh, the tags of cells and all fields.
    """
    root = ElementTree.fromstring(text)
    domain = root.find("Domain")
    assert domain is not None
    mesh, *tags = domain.findall("Grid[@GridType='Uniform']")
    body = domain.find("Grid[@Name='body']/Attribute")  # cells have the order of the mesh's
    series = domain.findall("Grid[@CollectionType='Temporal']")
    merged = ElementTree.Element(
        "Grid", Name="perfplast", GridType="Collection", CollectionType="Temporal"
    )
    for number, steps in enumerate(zip(*(collection for collection in series), strict=True), 1):
        grid = ElementTree.SubElement(merged, "Grid", Name=f"level {number}", GridType="Uniform")
        parts = [mesh.find("Topology"), mesh.find("Geometry"), steps[0].find("Time")]
        parts += [body, *(step.find("Attribute") for step in steps)]
        grid.extend(copy.deepcopy(part) for part in parts if part is not None)
    for grid in (*series, *tags):
        domain.remove(grid)
    if series:
        domain.remove(mesh)
        domain.append(merged)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _write(path: Path, text: str) -> None:
    part = path.with_suffix(".xdmf.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)
