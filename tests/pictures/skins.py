"""Make bodies whose skin several tests use, and artificial fields on these bodies."""

import os
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import create_unit_square, locate_entities_boundary, meshtags

from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap
from perfplast_fenicsx.io.case.scene import NamedScene, Scene
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.pictures.boundary_surface import Surface, make_skin


def square(comm: MPI.Intracomm) -> TaggedMesh:
    """Return a plane body."""
    mesh = create_unit_square(comm, 3, 3)
    index_map = mesh.topology.index_map(2)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    tags = meshtags(mesh, 2, cells, np.full_like(cells, 7))
    mesh.topology.create_entities(1)
    bottom = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0))
    side = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], 1))
    facets = np.concatenate([bottom, side])
    values = np.repeat(np.array([1, 2], dtype=np.int32), [len(bottom), len(side)])
    order = np.argsort(facets)
    facet_tags = meshtags(mesh, 1, facets[order], values[order])
    return TaggedMesh(mesh, tags, facet_tags, {"plate": 7}, {"bottom": 1, "side": 2})


def skin(tagged_mesh: TaggedMesh, scene: Scene) -> Surface:
    """Return the skin of a mesh of this process only, without fields."""
    mesh = tagged_mesh.mesh
    assert mesh.comm.size == 1
    tags = tagged_mesh.facet_tags
    corners = entity_nodes(mesh, mesh.topology.dim - 1, tags.indices)
    surfaces = {name: np.ravel(tags).tolist() for name, tags in tagged_mesh.surfaces.items()}
    named = NamedScene(scene, tagged_mesh.volumes, surfaces)
    body = tagged_mesh.cell_tags.values[np.argsort(tagged_mesh.cell_tags.indices)]
    x = mesh.geometry.x[:, : mesh.geometry.dim]
    return make_skin(x, geometry_dofmap(mesh), body, corners, tags.values, named).surface


def fields_of(tagged_mesh: TaggedMesh, scale: float = 0.01) -> dict[str, fem.Function]:
    """Return artificial fields: u = scale (x, 2y, 3z), p = y, a yield ratio that grows with x."""
    mesh = tagged_mesh.mesh
    gdim = mesh.geometry.dim
    u = fem.Function(fem.functionspace(mesh, ("P", 1, (gdim,))))
    u.interpolate(lambda x: scale * np.array([x[0], 2 * x[1], 3 * x[2]])[:gdim])
    ratio = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    ratio.interpolate(lambda x: np.minimum(x[0], 1.0))
    pressure = fem.Function(fem.functionspace(mesh, ("P", 1)))
    pressure.interpolate(lambda x: x[1])
    return {"displacement": u, "yield_ratio": ratio, "contact_pressure": pressure}


def put_before(package: str, text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make child processes import a package with this text instead of the real one."""
    (folder / package).mkdir(parents=True, exist_ok=True)
    (folder / package / "__init__.py").write_text(text, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
