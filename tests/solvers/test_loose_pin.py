"""Test a loose pin in the hole of a plate, held only by friction and contact."""

import re
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Newton,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    load_path,
    read_gmsh,
)
from perfplast_fenicsx.mesh import gmsh_session
from tests.checks import assert_solved
from tests.models import STEEL

HOLE, HALF = 1.01, 3.0


def write_pin(path: Path, size: float) -> None:
    """Write a disk of radius 1 in the hole of a square plate. On one process."""
    with gmsh_session() as gmsh:
        occ, model = gmsh.model.occ, gmsh.model
        pin = occ.addDisk(0, 0, 0, 1.0, 1.0)
        plate = occ.addRectangle(-HALF, -HALF, 0, 2 * HALF, 2 * HALF)
        ((_, plate),), _ = occ.cut([(2, plate)], [(2, occ.addDisk(0, 0, 0, HOLE, HOLE))])
        occ.synchronize()
        sides = {"pin_seam": model.getBoundary([(2, pin)], oriented=False)}
        for curve in model.getBoundary([(2, plate)], oriented=False):
            low_x, low_y, _, high_x, high_y, _ = model.getBoundingBox(*curve)
            if high_x - low_x > 0.1 and high_y - low_y > 0.1:
                sides["hole"] = [curve]
            elif high_x - low_x < 0.1:
                sides["left" if low_x < 0 else "right"] = [curve]
        model.addPhysicalGroup(2, [pin], name="pin")
        model.addPhysicalGroup(2, [plate], name="plate")
        for name, curves in sides.items():
            model.addPhysicalGroup(1, [tag for _, tag in curves], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        model.mesh.generate(2)
        gmsh.write(str(path))


@pytest.fixture
def mesh(shared_tmp_path: Path) -> TaggedMesh:
    path = shared_tmp_path / "pin.msh"
    if MPI.COMM_WORLD.rank == 0:
        write_pin(path, 0.25)
    MPI.COMM_WORLD.barrier()
    return read_gmsh(MPI.COMM_WORLD, path)


def held(mesh: TaggedMesh, load: BodyForce | Traction, **friction: float) -> Problem:
    return Problem(
        mesh,
        {"pin": STEEL, "plate": STEEL},
        [Support("left")],
        [load],
        [Contact("pin_seam", "hole", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


PULLED, PRESSED = Traction("right", (1.0, 0.0)), BodyForce("pin", (1.0, 0.0))


def test_surfaces_that_do_not_touch_have_no_friction(mesh: TaggedMesh) -> None:
    """Contact forces are rounding errors, and neither they nor friction decide anything.

    The plate then has the strength and stiffness for almost zero friction.
    """
    level = Newton(held(mesh, PULLED, coulomb=0.2)).solve(50.0)
    assert_solved(level)
    assert level.report.newton_iterations < 10
    assert level.report.active_contacts == 0
    tresca = Newton(held(mesh, PULLED, tresca=1e-6)).solve(50.0)
    assert_solved(tresca)
    assert tresca.report.newton_iterations < 30
    assert tresca.report.friction_excess < 1e-4
    assert level.report.alpha == pytest.approx(tresca.report.alpha, rel=1e-4)


def test_up_to_the_limit_and_beyond(mesh: TaggedMesh) -> None:
    levels = list(load_path(Newton(held(mesh, PULLED, coulomb=0.2)), [330.0, 400.0]))
    assert [level.report.converged for level in levels] == [True, False]
    reason = levels[-1].report.reason
    assert re.search("above the limit load", reason), reason


@pytest.mark.long
def test_a_pin_that_is_pressed_rolls_and_rubs(mesh: TaggedMesh) -> None:
    """Linearisations of friction cycle; the condensed program does not."""
    level = Newton(held(mesh, PRESSED, coulomb=0.2)).solve(50.0)
    assert_solved(level)
    assert level.report.friction_excess < 1e-9
    assert level.report.rounds < 15
    assert level.report.active_set_iterations < 500
