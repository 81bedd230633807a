"""The problems that the benchmarks solve, with load levels and the elastic problem for E."""

import math
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp

from mpi4py import MPI

from meshes.bolted_assembly import FOOT, write_bolted_assembly
from meshes.joints import sides
from meshes.thick_sphere import write_thick_sphere
from perfplast_fenicsx import (
    Contact,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    l_plate,
    punch,
    two_blocks,
)
from perfplast_fenicsx.mesh import TaggedMesh, read_gmsh

STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
PUNCH_METAL = VonMises(young=2e5, poisson=0.3, yield_stress=400 * math.sqrt(1.5))


@dataclass(frozen=True)
class Model:
    """A problem on meshes of any size.

    Attributes:
        problem: Function of communicator, cubes per unit length and degree; it returns the problem.
        levels: Load factors ζ of the path.
        smallest: Number of cubes for a run that only compiles forms.
        material: Material of all bodies.
        elastic_supports: Supports that the elastic problem for E adds to those of the problem. They
            prevent rigid motions of bodies that only contact holds.
        glued: Function that makes the problem for E without contact; None if the problem for E is
            the problem itself.
    """

    problem: Callable[[MPI.Intracomm, int, int], Problem]
    levels: tuple[float, ...]
    smallest: int
    material: VonMises
    elastic_supports: Sequence[Support] = ()
    glued: Callable[[MPI.Intracomm, int, int], Problem] | None = None


def _two_blocks(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return two stacked cantilevers; ζ is the traction on the free half of the upper one's top."""
    return Problem(
        two_blocks(comm, n),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
        degree=degree,
    )


def _punch(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return a quarter of a square punch on a block; ζ is the pressure on the punch."""
    return Problem(
        punch(comm, n),
        {"base": PUNCH_METAL, "punch": PUNCH_METAL},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom")],
        [Pressure("top", 1.0)],
        [Contact("punch_bottom", "base_top", 0.0)],
        degree=degree,
    )


def _l_plate(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return a quarter of a plate with a hole in plane strain, without contact; ζ = 1 is 200."""
    return Problem(
        l_plate(comm, n),
        {"plate": STEEL},
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z")],
        [Traction("top", (0.0, 200.0, 0.0))],
        degree=degree,
    )


def _bolted(comm: MPI.Intracomm, n: int, degree: int, apart: float | None = None) -> Problem:
    """Return brackets that are bolted to a plate, with a rod between the brackets.

    The load factor ζ multiplies a traction on the grip of the rod.
    """
    assembly = _assembly(comm, n, glued=False, apart=apart)
    contacts = [Contact(*pair, 0.0) for pair in sides(assembly.surfaces)]
    return _pulled(assembly, contacts, degree)


def _glued(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return the bolted assembly as a single body without contact."""
    return _pulled(_assembly(comm, n, glued=True), [], degree)


def _pulled(assembly: TaggedMesh, contacts: list[Contact], degree: int) -> Problem:
    return Problem(
        assembly,
        dict.fromkeys(assembly.volumes, STEEL),
        [Support("ends")],
        [Traction("grip", (0.2, 0.3, 1.0))],
        contacts,
        degree=degree,
    )


def _bolted_apart(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return the bolted assembly with separately meshed bodies and mortar contact."""
    return _bolted(comm, n, degree, apart=1.3)


def _assembly(comm: MPI.Intracomm, n: int, glued: bool, apart: float | None = None) -> TaggedMesh:
    """Return a mesh of the assembly with ``n`` elements along a bracket's foot. Collective."""

    def write(path: Path) -> None:
        write_bolted_assembly(path, FOOT / n, glued=glued, apart=apart)

    return _generated(comm, write)


def _shells(comm: MPI.Intracomm, n: int, degree: int) -> Problem:
    """Return an octant of two thick shells in contact; elements have the size 1/``n``.

    The load factor ζ is the inner pressure. The limit load is 480 ln 1.4 + 710 ln(2/1.4).
    """
    tagged_mesh = _generated(
        comm, lambda path: write_thick_sphere(path, interface=1.4, size=1 / n, order=2)
    )
    return Problem(
        tagged_mesh,
        {"inner_shell": VonMises(2e5, 0.3, 240.0), "outer_shell": VonMises(2e5, 0.3, 355.0)},
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")],
        [Pressure("inner", 1.0)],
        [Contact("inner_shell_seam", "outer_shell_seam")],
        degree=degree,
    )


def _generated(comm: MPI.Intracomm, write: Callable[[Path], None]) -> TaggedMesh:
    """Return the mesh that a generator writes. Collective."""
    folder = Path(comm.bcast(mkdtemp() if comm.rank == 0 else ""))
    path = folder / "mesh.msh"
    try:
        if comm.rank == 0:
            write(path)
        return read_gmsh(comm, path)
    finally:
        if comm.rank == 0:
            shutil.rmtree(folder)


MODELS = {
    "two_blocks": Model(_two_blocks, (60.0, 80.0, 100.0), 2, STEEL),
    "punch": Model(_punch, (450.0,), 2, PUNCH_METAL, [Support("punch_bottom", "z")]),
    "l_plate": Model(_l_plate, (1.0,), 1, STEEL),
    "bolted": Model(_bolted, (0.5, 1.0, 3.0), 1, STEEL, glued=_glued),
    "shells": Model(_shells, (), 3, STEEL),
    "bolted_apart": Model(_bolted_apart, (0.5, 1.0, 3.0), 1, STEEL, glued=_glued),
}
