"""Test cases for which the run makes the mesh from a CAD file."""

import json
from pathlib import Path

from mpi4py import MPI

import gmsh
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.case_reader import read_case
from tests.geometry.files import write

CASE = """
[geometry]
file = "../tower.step"
size = 2.0
symmetry = {x = 0.0, y = 0.0}

[[geometry.face]]
name = "loaded"
plane = {z = 3.0}

[material.part_1]
law = "elastic"
young = 200e3
poisson = 0.3

[material.part_2]
law = "von-mises"
young = 200e3
poisson = 0.3
yield_stress = 300.0

[[support]]
on = "part_1_z_low"
components = "z"

[[support]]
on = "symmetry_x"
components = "x"

[[support]]
on = "symmetry_y"
components = "y"

[[load]]
on = "loaded"
pressure = 1.0

[[contact]]
primary = "part_1_joint_1"
secondary = "part_2_joint_1"

[loading]
control = "work"
until = "limit"

[output]
fields = false
pictures = false
"""


def tower() -> None:
    """Draw a block on a larger block."""
    gmsh.model.occ.addBox(-2, -2, 0, 4, 4, 2)
    gmsh.model.occ.addBox(-1, -1, 2, 2, 2, 1)


def case_file(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the tower and its case on rank 0."""
    write(folder / "tower.step", tower)
    path = folder / "case" / "tower.toml"
    if MPI.COMM_WORLD.rank == 0:
        text = CASE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    MPI.COMM_WORLD.barrier()
    return path


def limit_load(path: Path, results: Path) -> float:
    assert main(["run", str(path), "-o", str(results), "--quiet"]) == 0
    return float(json.loads((results / "summary.json").read_text())["limit"]["upper"])


APART = (
    ("size = 2.0", 'size = 1.1\nsizes = {part_2 = 0.45}\nmeshed = "apart"'),
    ('secondary = "part_2_joint_1"', 'secondary = "part_2_joint_1"\nformulation = "mortar"'),
)


@pytest.mark.mpi2
def test_meshed_together_and_apart(shared_tmp_path: Path) -> None:
    """A block between frictionless surfaces collapses at its yield stress, on any mesh."""
    together = limit_load(case_file(shared_tmp_path), shared_tmp_path / "together")
    apart = limit_load(case_file(shared_tmp_path, *APART), shared_tmp_path / "apart")
    assert together == pytest.approx(300.0, rel=1e-3)
    assert apart == pytest.approx(together, rel=1e-3)


def test_the_mesh_is_kept_until_something_changes(shared_tmp_path: Path) -> None:
    path = case_file(shared_tmp_path)
    mesh, cells = path.with_suffix(".msh"), []

    def made() -> int:
        found = read_case(path).tagged_mesh(MPI.COMM_WORLD).mesh.topology
        cells.append(found.index_map(found.dim).size_global)
        return mesh.stat().st_mtime_ns

    first = made()
    assert made() == first
    case_file(shared_tmp_path, ("size = 2.0", "size = 0.5"))
    MPI.COMM_WORLD.barrier()
    second = made()
    assert second > first
    assert cells[2] > 3 * cells[1]
    if MPI.COMM_WORLD.rank == 0:
        mesh.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")
    MPI.COMM_WORLD.barrier()
    with pytest.raises(InputError, match="mesh file of another origin"):
        made()


@pytest.mark.mpi2("change0-'[^']*keep.step' cannot be read: No such file")
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("../tower.step", "../keep.step"), "'[^']*keep.step' cannot be read: No such file"),
        (("plane = {z = 3.0}", "plane = {z = 3.1}"), "nearest is 'part_2_z_high', 0.1 away"),
        (("size = 2.0", "size = -2.0"), "size = -2 is not a positive length"),
        (("size = 2.0", "seize = 2.0"), "no key 'seize' here; did you mean 'size'"),
        (("size = 2.0", "size = 2.0\n[mesh]\nfile = 'a.msh'\n[geometry.sizes]"), "remove one"),
        (("plane = {z", "plain = {z"), r"\[\[geometry.face\]\] number 1: there is no key 'plain'"),
    ],
)
def test_bad_input(shared_tmp_path: Path, change: tuple[str, str], says: str) -> None:
    path = case_file(shared_tmp_path, change)
    with pytest.raises(InputError, match=f"tower.toml, .*{says}"):
        read_case(path).tagged_mesh(MPI.COMM_WORLD)
    assert not path.with_suffix(".msh").exists()
