"""Define geometry files that several tests mesh."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import MeshingOptions, Survey, mesh_geometry
from perfplast_fenicsx.mesh import gmsh_session


def pin_in_plate(shift: float = 0.0, beside: float = 0.0) -> None:
    """Return a plate with a hole, a pin in it, a block on top, and a separate block beside them."""
    occ = gmsh.model.occ
    plate, hole = occ.addBox(-10, -10, 0, 30, 20, 4), occ.addCylinder(0, 0, 0, 0, 0, 4, 5)
    occ.cut([(3, plate)], [(3, hole)])
    occ.addCylinder(shift, 0, 0, 0, 0, 4, 5)
    occ.addBox(10, -10, 4, 10, 20, 4)
    occ.addBox(20 + beside, -10, 0, 5, 20, 4)


def write(path: Path, make: Callable[[], None]) -> Path:
    """Write a geometry on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        with gmsh_session():
            make()
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
    MPI.COMM_WORLD.barrier()
    return path


def survey_of(source: Path, mesh: Path, options: MeshingOptions | None = None) -> Survey:
    """Mesh on rank 0, and return the survey, or raise the same refusal, on all ranks."""
    found: Survey | InputError | None = None
    if MPI.COMM_WORLD.rank == 0:
        try:
            found = mesh_geometry(source, mesh, options, trust=True)
        except InputError as error:
            found = error
    found = MPI.COMM_WORLD.bcast(found)
    if isinstance(found, InputError):
        raise found
    assert found is not None
    return found
