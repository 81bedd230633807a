"""Test meshes from XDMF files, through a gmsh file."""

from pathlib import Path

from mpi4py import MPI

import pytest
from dolfinx import io

from meshes.from_xdmf import main
from perfplast_fenicsx import Contact, Newton, Problem, Support, Traction, read_gmsh, two_blocks
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from tests.models import STEEL

SURFACES = ("left", "top", "upper_bottom", "lower_top")


def write(tagged_mesh: TaggedMesh, path: Path) -> None:
    mesh = tagged_mesh.mesh
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    tagged_mesh.cell_tags.name, tagged_mesh.facet_tags.name = "bodies", "surfaces"
    with io.XDMFFile(mesh.comm, path, "w") as file:
        file.write_mesh(mesh)
        file.write_meshtags(tagged_mesh.cell_tags, mesh.geometry)
        file.write_meshtags(tagged_mesh.facet_tags, mesh.geometry)


def alpha(tagged_mesh: TaggedMesh) -> float:
    problem = Problem(
        tagged_mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
    )
    level = Newton(problem).solve(80.0)
    assert level.report.converged
    return level.state.alpha


@pytest.mark.mpi2
def test_a_mesh_by_way_of_xdmf_is_the_same(shared_tmp_path: Path) -> None:
    comm = MPI.COMM_WORLD
    tagged_mesh = two_blocks(comm, 2)
    source, target = shared_tmp_path / "blocks.xdmf", shared_tmp_path / "blocks.msh"
    write(tagged_mesh, source)
    if comm.rank == 0:
        bodies = [f"{name}={tag}" for name, tag in tagged_mesh.volumes.items()]
        surfaces = [f"{name}={tagged_mesh.surfaces[name]}" for name in SURFACES]
        names = ["--bodies", "bodies", *bodies, "--surfaces", "surfaces", *surfaces]
        main([str(source), str(target), *names])
    comm.barrier()
    read = read_gmsh(comm, target)
    assert set(read.volumes) == {"lower", "upper"}
    assert set(read.surfaces) == set(SURFACES)
    assert alpha(read) == pytest.approx(alpha(tagged_mesh), rel=1e-10)


def test_names_and_files_that_are_not_there(tmp_path: Path) -> None:
    source, target = tmp_path / "blocks.xdmf", tmp_path / "blocks.msh"
    bodies, surfaces = ["--bodies", "bodies", "lower=1"], ["--surfaces", "surfaces", "left=1"]
    with pytest.raises(SystemExit, match="cannot be read"):
        main([str(source), str(target), *bodies, *surfaces])
    write(two_blocks(MPI.COMM_SELF, 1), source)
    with pytest.raises(SystemExit, match="no grid 'parts'"):
        main([str(source), str(target), "--bodies", "parts", "lower=1", *surfaces])
    with pytest.raises(SystemExit, match="the value 7 of 'lower'"):
        main([str(source), str(target), "--bodies", "bodies", "lower=7", *surfaces])
