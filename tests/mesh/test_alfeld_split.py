"""Test that the barycentric split preserves bodies, names, facets and ranks."""

from dataclasses import replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import compute_midpoints, locate_entities, meshtags

from meshes.plate_with_hole import write_plate_with_hole
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import BodyForce, Pressure, Problem, Support, TaggedMesh, Traction
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.mesh import punch
from perfplast_fenicsx.mesh.alfeld_split import alfeld_split
from tests.checks import assert_refused
from tests.mesh.test_meshes import area_vector, volume
from tests.models import STEEL, Read, punch_problem


def plate(tagged_mesh: TaggedMesh) -> Problem:
    """Return a plate under all kinds of loads."""
    return Problem(
        tagged_mesh,
        {"plate": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [Traction("top", (1.0, 2.0)), Pressure("hole", 3.0), BodyForce("plate", (0.4, 0.7))],
        degree=2,
    )


def interpolated(problem: Problem) -> PETSc.Vec:
    """Return a quadratic velocity, the same on every mesh."""
    v = fem.Function(problem.V)
    v.interpolate(lambda x: np.stack([x[0] * (1 + x[1]), x[1] * (x[0] - 2 * x[1])]))
    return v.x.petsc_vec


def cell_volumes(tagged_mesh: TaggedMesh) -> np.ndarray:
    """Return the volumes of the cells of this rank."""
    mesh = tagged_mesh.mesh
    x = mesh.geometry.x[geometry_dofmap(mesh)][:, :, : mesh.geometry.dim]
    size = np.abs(np.linalg.det(x[:, 1:] - x[:, :1]))
    return np.asarray(size / (2 if mesh.topology.dim == 2 else 6))


@pytest.mark.mpi3
def test_bodies_and_surfaces_stay(comm: MPI.Intracomm) -> None:
    coarse = punch(comm, 4)
    split = alfeld_split(coarse)
    topology, before = split.mesh.topology, coarse.mesh.topology
    assert topology.index_map(3).size_global == 4 * before.index_map(3).size_global
    assert (
        topology.index_map(0).size_global
        == before.index_map(0).size_global + before.index_map(3).size_global
    )
    for name in coarse.volumes:
        assert volume(split, name) == pytest.approx(volume(coarse, name))
    for name in coarse.surfaces:
        assert np.allclose(area_vector(split, name), area_vector(coarse, name))
    split.check_tagged()
    assert np.bincount(split.parents).tolist() == [4] * before.index_map(3).size_local
    whole = cell_volumes(coarse)[split.parents]
    assert np.allclose(cell_volumes(split), whole / 4)


def test_inner_surfaces_stay(comm: MPI.Intracomm) -> None:
    built = punch(comm, 4)
    inside = locate_entities(built.mesh, 2, lambda x: np.isclose(x[2], 0.5))
    middle = meshtags(built.mesh, 2, inside, np.full(len(inside), 7, dtype=np.int32))
    coarse = replace(built, facet_tags=middle, surfaces={"middle": 7})
    split = alfeld_split(coarse)
    owned = split.mesh.topology.index_map(2).size_local
    facets = split.facets("middle")
    facets = facets[facets < owned]
    assert comm.allreduce(len(facets)) == 2 * 4 * 4
    places = compute_midpoints(split.mesh, 2, facets)
    assert np.allclose(places[:, 2], 0.5)


def test_a_plane_problem_on_the_split(read: Read) -> None:
    coarse = read(write_plate_with_hole, size=0.5)
    problem = plate(coarse)
    fine = problem.on(alfeld_split(coarse))
    cells = coarse.mesh.topology.index_map(2).size_global
    assert fine.num_dofs == problem.num_dofs + 2 * (cells + 3 * cells)
    assert fine.given == problem.given
    v, w = (interpolated(p) for p in (problem, fine))
    assert fine.loads.alpha(w) == pytest.approx(problem.loads.alpha(v))


def test_contact_still_matches(comm: MPI.Intracomm) -> None:
    problem = punch_problem(4)
    fine = problem.on(alfeld_split(problem.tagged_mesh))
    assert fine.num_pairs == problem.num_pairs > 0


def test_curved_cells_are_refused(read: Read) -> None:
    curved = read(write_thick_tube, order=2)
    assert_refused(lambda: alfeld_split(curved), ["curved", "first-order"])
