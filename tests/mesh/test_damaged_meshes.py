"""Test that folded, overlapping or cut meshes are refused, and valid meshes are not."""

import re
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.overlapping_bodies import check_bodies, overlap_depths
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh
from tests.mesh.damaged_meshes import DAMAGED, Plain, blocks, inverted


def read(folder: Path, mesh: Plain) -> TaggedMesh:
    path = folder / "mesh.msh"
    if MPI.COMM_WORLD.rank == 0:
        mesh.write(path)
    MPI.COMM_WORLD.barrier()
    return read_gmsh(MPI.COMM_WORLD, path)


@pytest.mark.mpi2("inner node far out-3")
@pytest.mark.parametrize("dim", [pytest.param(2, marks=pytest.mark.long), 3])
@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_meshes_are_refused(shared_tmp_path: Path, name: str, dim: int) -> None:
    make, says = DAMAGED[name]
    with pytest.raises(InputError) as refusal:
        check_bodies(read(shared_tmp_path, make(dim)))
    sentence = str(refusal.value)
    assert re.search(says, sentence), sentence
    assert len(set(MPI.COMM_WORLD.allgather(sentence))) == 1


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("other", [2, 3])
@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_sound_meshes_are_not(shared_tmp_path: Path, dim: int, other: int, gap: float) -> None:
    """Bodies that touch, with matching or other nodes, or that are apart."""
    assert (
        check_bodies(read(shared_tmp_path, blocks(dim, 2, (0.25,) * (dim - 1) + (gap,), other)))
        == []
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_numbered_the_other_way_round_are_harmless(shared_tmp_path: Path, dim: int) -> None:
    """Volumes are positive for any orientation of the vertices."""
    assert check_bodies(read(shared_tmp_path, inverted(blocks(dim)))) == []


def test_touching_without_names_is_told(shared_tmp_path: Path) -> None:
    mesh = blocks(3)
    keep = ~np.isin(mesh.tags, [12, 13])
    bare = Plain(mesh.points, mesh.cells, mesh.body, mesh.facets[keep], mesh.tags[keep])
    (told,) = check_bodies(read(shared_tmp_path, bare))
    assert "'a' touches 'b' at 16 facets without a name" in told


def test_bodies_may_overlap_where_it_is_meant(shared_tmp_path: Path) -> None:
    mesh = read(shared_tmp_path, blocks(3, 2, (0.0, 0.0, -0.02)))
    assert check_bodies(mesh, overlaps=True) == []


@pytest.mark.parametrize("gdim", [2, 3])
def test_depths_of_simplices(gdim: int) -> None:
    """Random simplices touch after a separation by the depth, and overlap after 1 % less."""
    lot = np.random.default_rng(7)
    one, other = lot.normal(size=(2, 400, gdim + 1, gdim))
    none = np.zeros(len(one))
    depth = overlap_depths(one, other, none)
    both = depth > 0
    assert 50 < both.sum() < 380
    inside = np.concatenate([lot.dirichlet(np.ones(gdim + 1), 3000)])
    points = np.einsum("pk,nki->npi", inside, one)
    edges = (other[:, 1:] - other[:, :1]).transpose(0, 2, 1)
    local = np.linalg.solve(edges[:, None], (points - other[:, :1])[..., None])[..., 0]
    hit = ((local >= 0).all(axis=2) & (local.sum(axis=2) <= 1)).any(axis=1)
    assert not (hit & ~both).any()  # a common point shows that they overlap
    assert hit.sum() > 0.9 * both.sum()
    assert (overlap_depths(one, other, 1.01 * depth) == 0).all()
