"""Test the remark on loads that only facets of a smooth cylinder carry."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshes.naming import interface, name, name_planes
from meshes.sizes import generate
from perfplast_fenicsx import BodyForce, Contact, Problem, Support, Tie
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split
from perfplast_fenicsx.problem.judged.oblique_facets import (
    FacetedCylinder,
    faceted_cylinders,
    interlocked,
    with_common_axes,
)
from tests.models import STEEL, Read

AXIS = np.array([2.0, -1.0, 2.0]) / 3
"""Axis of the pin after the bodies have been rotated."""


def write_pin(
    path: str | Path, order: int = 1, rows: int = 0, square: bool = False, size: float = 0.25
) -> None:
    """Write an oblique pin in a plate.

    Args:
        path: The file.
        order: Degree of the element geometry.
        rows: Number of rows of facets along the axis; 0 for a mesh without rows.
        square: Whether the pin is square.
        size: Length of edges.
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
        generate(3, lambda x, y, z: size, order)
        across = np.array([1.0, 2.0, 0.0]) / np.sqrt(5)
        turned = np.column_stack([across, np.cross(AXIS, across), AXIS, np.zeros(3)])
        gmsh.model.mesh.affineTransform(turned.ravel())
        write_split(path)


def write_studs(
    path: str | Path,
    studs: dict[str, tuple[float, float]],
    bottom: float = 0.0,
    head: bool = False,
    size: float = 0.2,
) -> None:
    """Write studs along z in a plate.

    Args:
        path: The file.
        studs: Place along x and radius by name.
        bottom: Lower end of the studs; the plate begins at z = 0.
        head: Whether studs have a head on the plate.
        size: Length of edges.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        plate = occ.addBox(-1, -1, 0, 2, 2, 0.6)
        made = []
        for x, radius in studs.values():
            shank = [(3, occ.addCylinder(x, 0, bottom, 0, 0, 0.6 - bottom, radius))]
            if head:
                top = [(3, occ.addCylinder(x, 0, 0.6, 0, 0, 0.2, 1.7 * radius))]
                shank, _ = occ.fuse(shank, top)
            made += shank
        holed, _ = occ.cut([(3, plate)], made, removeTool=False)
        _, of = occ.fragment(holed, made)
        occ.synchronize()
        bodies = {name: tag for name, [(_, tag)] in zip(studs, of[1:], strict=True)}
        name(3, {key: [tag] for key, tag in bodies.items()})
        name(3, {"plate": [t for _, t in of[0] if t not in bodies.values()]})
        shared = set(interface(2))
        for key, tag in bodies.items():
            own = [face for face in gmsh.model.getAdjacencies(3, tag)[1] if face in shared]
            under = [face for face in own if head and face in on_plane(2, 2, 0.6)]
            name(2, {f"bore_{key}": [face for face in own if face not in under]})
            if under:
                name(2, {f"head_{key}": under})
        name_planes(2, {"left": (0, -1.0)})
        first = gmsh.model.getAdjacencies(3, next(iter(bodies.values())))[1]
        name(2, {"top": [face for face in on_plane(2, 2, 0.8 if head else 0.6) if face in first]})
        for face in on_plane(2, 2, bottom):
            without_inner_nodes = 3
            gmsh.model.mesh.setAlgorithm(2, face, without_inner_nodes)
        generate(3, lambda x, y, z: size, 1)
        write_split(path)


def studs(
    read: Read,
    loads: dict[str, float],
    head: bool = False,
    weight: float = 0.0,
    across: float = 0.0,
    supports: Sequence[Support] = (Support("left"),),
    **mesh: Any,
) -> Problem:
    """Return studs in a plate under forces along z.

    Args:
        read: The fixture.
        loads: Force on each loaded stud.
        head: Whether studs have heads.
        weight: Constant force on these studs.
        across: Force on these studs along x.
        supports: The supports.
        mesh: Arguments of :func:`write_studs`.
    """
    tagged = read(write_studs, head=head, **mesh)
    names = list(mesh["studs"])
    joints = [f"bore_{key}" for key in names] + [f"head_{key}" for key in names if head]
    forces = [BodyForce(key, (across, 0.0, force)) for key, force in loads.items()]
    if weight:
        forces += [BodyForce(key, (0.0, 0.0, weight), constant=True) for key in loads]
    return Problem(
        tagged,
        dict.fromkeys([*names, "plate"], STEEL),
        supports,
        forces,
        [Contact(f"{joint.split('_')[1]}_{joint}", f"plate_{joint}") for joint in joints],
    )


def pulled(
    read: Read,
    direction: Sequence[float | str] = tuple(map(float, AXIS)),
    more: str = "",
    **mesh: int,
) -> Problem:
    """Return a pin under a body force, in a fixed plate."""
    contact = Contact("pin_seam", "plate_seam", coulomb=0.1 if more == "friction" else None)
    return Problem(
        read(write_pin, **mesh),
        {"pin": STEEL, "plate": STEEL},
        [Support("left"), *([Support("end")] if more == "support" else [])],
        [BodyForce("pin", direction)],
        [Tie("pin_seam", "plate_seam") if more == "tie" else contact],
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


ACROSS = tuple(map(float, np.cross(AXIS, [0.0, 0.0, 1.0])))


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


TWIST = tuple(
    f"{AXIS[i]} * {'xyz'[j]} - {AXIS[j]} * {'xyz'[i]}" for i, j in ((1, 2), (2, 0), (0, 1))
)
"""Force per volume that turns the pin about its axis."""


@pytest.mark.mpi2
def test_a_turned_pin(read: Read) -> None:
    """Facets along the axis resist only rotation, because normals at the ends are not radial."""
    problem = pulled(read, TWIST, rows=2)
    (found,) = faceted_cylinders(problem)
    assert 1.0 < found.tilt < 15.0
    remark = interlocked(problem)
    assert remark is not None
    assert "rotation about (0.67, -0.33, 0.67)" in remark
    assert f"{found.tilt:.2g} degrees" in remark


@pytest.mark.parametrize(
    ("load", "more"), [(ACROSS, ""), *((TWIST, more) for more in ("friction", "support", "tie"))]
)
def test_a_straight_pin_that_does_not_turn(
    read: Read, load: Sequence[float | str], more: str
) -> None:
    assert interlocked(pulled(read, load, more, rows=2)) is None


def test_a_square_pin_of_few_facets(read: Read) -> None:
    """All vertices of a coarse square pin lie on a cylinder, but its faces resist rotation."""
    assert interlocked(pulled(read, TWIST, square=1, rows=3, size=1)) is None


ONE = {"pin": (0.0, 0.4)}


def test_supports_that_move(read: Read) -> None:
    """A support that moves a pin along its bore does not hold it; the plate may move with a pin."""
    top, left = Support("top", "z", value=0.1), Support("left")
    remark = interlocked(studs(read, {}, studs=ONE, supports=[left, top]))
    assert remark is not None
    assert "the body 'pin' (translation in z)" in remark
    along = Support("left", "z", value=0.1)
    assert interlocked(studs(read, {}, studs=ONE, supports=[Support("left", "xy"), along])) is None
    still = [Support("top", "z"), left]
    assert interlocked(studs(read, {"pin": 1.0}, studs=ONE, supports=still)) is None
    across = [Support("top", "x", value=0.1), *still]
    assert interlocked(studs(read, {"pin": 1.0}, studs=ONE, supports=across)) is None


@pytest.mark.mpi2
def test_a_pin_with_a_head(read: Read) -> None:
    """The head stops the pin in one direction; only facets stop the pin in the other direction."""
    remark = interlocked(studs(read, {"pin": 1.0}, head=True, studs=ONE))
    assert remark is not None
    assert "the body 'pin'" in remark
    assert "'pin_bore_pin'" in remark
    assert interlocked(studs(read, {"pin": -1.0}, head=True, studs=ONE)) is None
    assert interlocked(studs(read, {"pin": 1.0}, head=True, studs=ONE, weight=-2.0)) is None
    assert interlocked(studs(read, {"pin": 0.0}, head=True, studs=ONE, across=1.0)) is None


def test_a_blind_hole(read: Read) -> None:
    """The flat end of a hole stops a pin that is pushed in, but not one that is pulled out."""
    hole: dict[str, Any] = {"studs": ONE, "bottom": 0.2, "size": 0.25}
    pushed = studs(read, {"pin": -1.0}, **hole)
    (found,) = faceted_cylinders(pushed)
    assert found.tilt < 10.0
    assert interlocked(pushed) is None
    assert interlocked(studs(read, {"pin": 1.0}, **hole)) is not None


@pytest.mark.parametrize("pin", ["one", "two"])
def test_the_remark_names_the_contact_of_the_moving_body(read: Read, pin: str) -> None:
    both = {"one": (-0.5, 0.3), "two": (0.5, 0.2)}
    remark = interlocked(studs(read, {pin: 1.0}, studs=both))
    assert remark is not None
    assert f"the body '{pin}'" in remark
    assert f"'{pin}_bore_{pin}'" in remark


def test_half_shells_have_one_axis() -> None:
    """Their centres differ by rounding, across the axis; those of other bores do not."""
    x, y, z = np.eye(3)
    centres = [0 * x, 3e-9 * x, 3e-9 * y + 0.7 * z, 0.1 * x]
    found = with_common_axes(
        [
            FacetedCylinder(k, ("pin", "plate"), z + 1e-9 * k * y, at, 0.4, 5.0)
            for k, at in enumerate(centres)
        ]
    )
    for one in found:
        assert (one.axis == z).all()
    assert [bool((one.centre == 0).all()) for one in found] == [True, True, True, False]
