"""Test one body as divided hexahedra and as gmsh's tetrahedra: the same limit load."""

import os
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import gmsh
import numpy as np
import pytest

from perfplast_fenicsx import (
    Problem,
    Support,
    Traction,
    VonMises,
    limit_bounds,
    limit_load,
    read_gmsh,
)
from perfplast_fenicsx.mesh import gmsh_session
from perfplast_fenicsx.models import read_inp, write_msh

LENGTH = 2.0
"""Length of the cantilever, whose section is a unit square."""


def hexahedra(path: Path, n: int) -> Path:
    """Write the cantilever as C3D8, n along edges of the section; its ends are node sets."""
    counts = np.array([round(LENGTH * n), n, n]) + 1
    grid = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(1, len(grid) + 1).reshape(counts)
    corner = number[:-1, :-1, :-1].ravel()
    y, z = int(counts[2]), 1
    x = int(counts[1]) * y
    around = np.array([0, x, x + y, y])
    cells = corner[:, None] + np.concatenate([around, around + z])
    text = "*NODE\n" + "".join(
        f"{k},{a / n},{b / n},{c / n}\n" for k, (a, b, c) in enumerate(grid, start=1)
    )
    text += "*ELEMENT, TYPE=C3D8, ELSET=BEAM\n" + "".join(
        ",".join(map(str, [k, *cell])) + "\n" for k, cell in enumerate(cells, start=1)
    )
    for name, nodes in (("HELD", number[0].ravel()), ("PUSHED", number[-1].ravel())):
        text += f"*NSET, NSET={name}\n" + "\n".join(map(str, nodes)) + "\n"
    path.write_text(text)
    return path


def tetrahedra(path: Path, n: int) -> Path:
    """Write the cantilever as gmsh meshes it, as .inp."""
    with gmsh_session():
        gmsh.model.occ.addBox(0, 0, 0, LENGTH, 1, 1)
        gmsh.model.occ.synchronize()
        for dim, tag, name in ((3, 1, "beam"), (2, 1, "held"), (2, 2, "pushed")):
            gmsh.model.addPhysicalGroup(dim, [tag], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1.3 / n)
        gmsh.option.setNumber("Mesh.SaveGroupsOfElements", 1)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    return path


def declared(
    comm: MPI.Intracomm, folder: Path, write: Callable[[Path, int], Path], n: int
) -> Problem:
    """Return the cantilever, pushed down at its end."""
    mesh = folder / f"{write.__name__}_{n}.msh"
    if comm.rank == 0:
        write_msh(read_inp(write(mesh.with_suffix(".inp"), n)), mesh)
    comm.barrier()
    tagged = read_gmsh(comm, mesh)
    (body,) = tagged.volumes
    held, pushed = (next(s for s in tagged.surfaces if word in s) for word in ("held", "pushed"))
    steel = VonMises(young=210000.0, poisson=0.3, yield_stress=235.0)
    load = Traction(pushed, (0.0, 0.0, -100.0))
    return Problem(tagged, {body: steel}, [Support(held)], [load], degree=2)


@pytest.mark.long
def test_limit_loads_agree(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """Limit loads agree within the error of the mesh, estimated from a coarser mesh."""
    coarse, fine, other = (
        limit_load(declared(comm, shared_tmp_path, write, n)).estimate
        for write, n in ((hexahedra, 2), (hexahedra, 3), (tetrahedra, 2))
    )
    assert coarse > fine > 0
    assert abs(fine - other) < coarse - fine


@pytest.mark.skipif("PERFPLAST_FUZZ" not in os.environ, reason="takes half a minute")
def test_bounds_overlap(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    found = [
        limit_bounds(declared(comm, shared_tmp_path, write, n))
        for write, n in ((hexahedra, 3), (tetrahedra, 2))
    ]
    assert all(bounds.lower.strict and bounds.upper.strict for bounds in found)
    lower = max(bounds.lower.value or 0.0 for bounds in found)
    upper = min(bounds.upper.value or 0.0 for bounds in found)
    assert 0 < lower < upper
