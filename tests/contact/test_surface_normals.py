"""Test nodes of surfaces and their normals: one normal for each smooth face."""

import itertools

from mpi4py import MPI

import numpy as np
import pytest

from meshes.corner_seat import write_corner_seat
from meshes.thick_sphere import write_thick_sphere
from perfplast_fenicsx.contact.surfaces.surface_facets import _faces, face_nodes
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.problem.assembled.spaces import make_spaces
from tests.checks import largest
from tests.models import Read


@pytest.mark.mpi3("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_nodes_on_the_edges_of_a_cube_have_a_normal_for_each_face(
    comm: MPI.Intracomm, degree: int
) -> None:
    skin = Surface("skin", ("cube",), lambda x: np.full(x.shape[1], True))
    tagged_mesh = structured_mesh(
        comm, [Box("cube", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 3, 4))], [skin]
    )
    V = make_spaces(tagged_mesh.mesh, degree).V
    faces = face_nodes(V, tagged_mesh, "skin")
    x = V.tabulate_dof_coordinates()[faces.node]
    sides = (np.isclose(x, 0) | np.isclose(x, 1)).sum(axis=1)
    times = np.bincount(faces.node)[faces.node]
    assert (times == sides).all()
    counts = [comm.allreduce(int((sides == k).sum())) for k in (1, 2, 3)]
    nodes = [degree * n - 1 for n in (2, 3, 4)]  # inside each edge
    pairs = list(itertools.combinations(nodes, 2))
    assert counts == [2 * sum(a * b for a, b in pairs), 2 * 4 * sum(nodes), 3 * 8]
    # every normal is parallel to an axis, and points out of the face of the node
    along = np.argmax(np.abs(faces.normal), axis=1)
    every = np.arange(len(along))
    outward = np.where(np.isclose(x[every, along], 1), 1.0, -1.0)
    assert faces.normal[every, along] == pytest.approx(outward)
    assert np.abs(faces.normal).sum(axis=1) == pytest.approx(1.0)


def test_a_curved_surface_has_one_normal_at_each_node_and_curved_elements_a_better_one(
    read: Read, comm: MPI.Intracomm
) -> None:
    errors = []
    for order in (1, 2):
        tagged_mesh = read(write_thick_sphere, size=0.3, order=order)
        V = make_spaces(tagged_mesh.mesh, 2).V
        faces = face_nodes(V, tagged_mesh, "outer")
        assert len(np.unique(faces.node)) == len(faces.node)
        x = V.tabulate_dof_coordinates()[faces.node]
        radial = x / np.linalg.norm(x, axis=1, keepdims=True)
        errors.append(largest(comm, np.linalg.norm(faces.normal - radial, axis=1)))
    assert errors[0] < 0.3
    assert errors[1] < errors[0] / 5


def test_a_corner_in_the_plane_has_two_normals(read: Read, comm: MPI.Intracomm) -> None:
    tagged_mesh = read(write_corner_seat, dim=2, size=0.25)
    V = make_spaces(tagged_mesh.mesh, 2).V
    for surface, side in (("block_corner", -1.0), ("seat_corner", 1.0)):
        faces = face_nodes(V, tagged_mesh, surface)
        x = V.tabulate_dof_coordinates()[faces.node]
        in_corner = np.linalg.norm(x[:, :2], axis=1) < 1e-9
        found = np.concatenate(comm.allgather(faces.normal[in_corner]))
        order = np.argsort(side * found[:, 0])
        assert found[order] == pytest.approx(np.array([[0.0, side], [side, 0.0]]))


def test_where_faces_end_depends_neither_on_the_order_nor_on_the_side() -> None:
    """Coarse facets around a node are each nearly parallel to the next. The order could matter."""
    turned = np.radians(37.0 * np.arange(8))
    normals = np.stack([np.cos(turned), np.sin(turned), np.full(8, 0.2)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nodes = np.zeros(8, dtype=np.int64)
    faces = _faces(nodes, normals)
    assert 1 < len(np.unique(faces)) < 8
    for order in np.random.default_rng(2).permuted(np.tile(np.arange(8), (20, 1)), axis=1):
        assert np.array_equal(_faces(nodes, normals[order]), faces[order])
    assert np.array_equal(_faces(nodes, -normals), faces)
