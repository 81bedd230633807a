"""Test the skin of the bodies: complete, outward, with the names of its surfaces."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.pictures.boundary_surface import exterior, facet_tags
from perfplast_fenicsx.problem.declared.loads import Pressure
from tests.pictures.skins import skin, square

pytestmark = pytest.mark.serial


def test_the_skin_is_whole_and_outward() -> None:
    scene = Scene("", [Pressure("top", 1.0)], [Contact("left", "top")])
    surface = skin(build(MPI.COMM_SELF, "two_blocks", n=2), scene)
    assert not surface.plane
    assert surface.facets is surface.triangles
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a) / 2
    for index, name in enumerate(surface.names):
        own = surface.body == index
        height = {"lower": 0.0, "upper": 1.0}[name]
        assert own.sum() == 2 * 4 * 14
        assert np.isclose(np.linalg.norm(areas[own], axis=1).sum(), 14.0)
        volume = np.einsum("ij,ij->", areas[own], a[own]) / 3
        assert np.isclose(volume, 3.0)  # positive: the triangles are outward
        assert np.isclose(surface.points[surface.triangles[own]][..., 2].min(), height)
    assert np.allclose(surface.normals, areas)
    assert np.allclose(surface.areas, np.linalg.norm(areas, axis=1))
    assert np.allclose(areas[surface.marks["load 0"]].sum(axis=0), [0, 0, 1.5])
    assert surface.marks["contact"].sum() == 2 * 4 * 1.5
    assert surface.marks["opposite"].sum() == 2 * 4 * 2


def test_the_skin_of_a_plane_mesh() -> None:
    scene = Scene("", [Pressure("side", 1.0)], [Contact("bottom", "side"), Contact("", "bottom")])
    surface = skin(square(MPI.COMM_SELF), scene)
    assert surface.triangles.shape == (18, 3)
    assert np.isclose(surface.areas.sum(), 1.0)
    assert np.all(surface.body == 0)

    assert surface.plane
    assert surface.facets is surface.edges
    middle = surface.points[surface.edges].mean(axis=1)
    found = sorted((round(6 * x), round(6 * y)) for x, y, _ in middle)
    along = (1, 3, 5)
    expected = [(i, y) for i in along for y in (0, 6)] + [(x, i) for i in along for x in (0, 6)]
    assert found == sorted(expected)  # each once
    outward = np.where(np.isclose(middle, 1), 1, 0) - np.where(np.isclose(middle, 0), 1, 0)
    outward[:, 2] = 0
    assert np.allclose(surface.normals, outward / 3)
    right, bottom = np.isclose(middle[:, 0], 1), np.isclose(middle[:, 1], 0)
    assert np.array_equal(surface.marks["load 0"], right)
    assert np.array_equal(surface.marks["contact"], right | bottom)
    assert np.array_equal(surface.marks["opposite"], bottom)


def test_exterior() -> None:
    facets, cells = exterior(np.array([[0, 1, 2, 3], [1, 2, 4, 3]]))
    assert sorted(map(tuple, facets.tolist())) == [
        *((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 4), (1, 3, 4), (2, 3, 4))
    ]
    assert [4 in facet for facet in facets.tolist()] == (cells == 1).tolist()


def test_facet_tags() -> None:
    facets = np.array([[0, 1, 2], [0, 3, 1], [1, 2, 3]])
    tags = facet_tags(facets, np.array([[3, 2, 1], [7, 8, 9], [1, 0, 3]]), np.array([5, 6, 7]))
    assert tags.tolist() == [-1, 7, 5]
