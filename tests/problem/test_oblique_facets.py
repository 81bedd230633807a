"""Test the remark on loads that only oblique facets of a smooth cylinder carry."""

from pathlib import Path

import numpy as np
import pytest

from meshes.naming import interface, name, name_planes
from meshes.sizes import generate
from perfplast_fenicsx import BodyForce, Contact, Problem, Support, Tie
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split
from perfplast_fenicsx.problem.judged.oblique_facets import faceted_cylinders, interlocked
from tests.models import STEEL, Read

AXIS = np.array([2.0, -1.0, 2.0]) / 3
"""Axis of the pin after the bodies have been rotated."""


def write_pin(path: str | Path, order: int = 1, rows: int = 0, square: bool = False) -> None:
    """Write an oblique pin in a plate.

    Args:
        path: The file.
        order: Degree of the element geometry.
        rows: Number of rows of facets along the axis; 0 for a mesh without rows.
        square: Whether the pin is square.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        plate = occ.addRectangle(-1, -1, 0, 2, 2)
        pin = (
            occ.addRectangle(-0.4, -0.4, 0, 0.8, 0.8) if square else occ.addDisk(0, 0, 0, 0.4, 0.4)
        )
        occ.fragment([(2, plate)], [(2, pin)])
        base = occ.getEntities(2)
        layers = {"numElements": [rows]} if rows else {}
        bodies = [tag for dim, tag in occ.extrude(base, 0, 0, 0.5, **layers) if dim == 3]
        inside = min(bodies, key=lambda tag: occ.getMass(3, tag))
        occ.synchronize()
        name(3, {"pin": [inside], "plate": [tag for tag in bodies if tag != inside]})
        _, faces = gmsh.model.getAdjacencies(3, inside)
        name(2, {"end": [tag for tag in on_plane(2, 2, 0.0) if tag in faces]})
        name(2, {"seam": interface(2)})
        name_planes(2, {"left": (0, -1.0)})
        generate(3, lambda x, y, z: 0.25, order)
        across = np.array([1.0, 2.0, 0.0]) / np.sqrt(5)
        turned = np.column_stack([across, np.cross(AXIS, across), AXIS, np.zeros(3)])
        gmsh.model.mesh.affineTransform(turned.ravel())
        write_split(path)


def pulled(
    read: Read, direction: tuple[float, ...] = tuple(AXIS), more: str = "", **mesh: int
) -> Problem:
    """Return a pin under a body force, in a fixed plate."""
    contact = Contact("pin_seam", "plate_seam", coulomb=0.1 if more == "friction" else None)
    return Problem(
        read(write_pin, **mesh),
        {"pin": STEEL, "plate": STEEL},
        [Support("left"), *([Support("end")] if more == "support" else [])],
        [BodyForce("pin", direction)],
        [] if more == "tie" else [contact],
        ties=[Tie("pin_seam", "plate_seam")] if more == "tie" else [],
    )


@pytest.mark.mpi2
def test_a_pulled_pin(read: Read) -> None:
    problem = pulled(read)
    (found,) = faceted_cylinders(problem)
    assert np.abs(np.abs(found.axis @ AXIS) - 1) < 1e-9
    assert np.linalg.norm(np.cross(found.centre, AXIS)) < 1e-9
    assert 1.0 < found.tilt < 30.0
    remark = interlocked(problem)
    assert remark is not None
    assert "translation along (0.67, -0.33, 0.67)" in remark
    assert "'pin_seam' and 'plate_seam'" in remark
    assert f"{found.tilt:.2g} degrees" in remark


ACROSS = tuple(np.cross(AXIS, [0.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("direction", "more"),
    [(ACROSS, ""), *((tuple(AXIS), more) for more in ("friction", "support", "tie"))],
)
def test_a_pin_that_does_not_slide(read: Read, direction: tuple[float, ...], more: str) -> None:
    """Nothing is reported without a load along the axis, or if something else holds the pin."""
    assert interlocked(pulled(read, direction, more)) is None


def test_other_surfaces_are_no_cylinders(read: Read) -> None:
    """A square pin has no cylinder, and curved elements have no facets."""
    assert not faceted_cylinders(pulled(read, ACROSS, square=1))
    assert not faceted_cylinders(pulled(read, ACROSS, order=2))
