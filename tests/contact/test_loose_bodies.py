"""Test that the program names bodies that only facets prevent from spinning, and no others."""

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from meshes.naming import interface, name, name_planes
from meshes.sizes import generate
from meshes.sphere_sector import write_sphere_sector
from perfplast_fenicsx import BodyForce, Contact, Newton, Pressure, Problem, Support
from perfplast_fenicsx.contact.rows.loose_bodies import LooseMotion, in_words, loose_motions
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split
from tests.checks import assert_solved
from tests.models import STEEL, Read, punch_problem, stack_problem, two_blocks_problem


def write_bolted(path: str | Path, order: int) -> None:
    """Write a round pin in a plate; ``end`` is the lower end of the pin."""
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        plate = occ.addBox(-1, -1, 0, 2, 2, 0.5)
        pin = occ.addCylinder(0.1, 0.05, 0, 0, 0, 0.5, 0.4)
        occ.fragment([(3, plate)], [(3, pin)])
        occ.synchronize()
        volumes = [tag for _, tag in gmsh.model.getEntities(3)]
        inside = min(volumes, key=lambda tag: occ.getMass(3, tag))
        name(3, {"pin": [inside], "plate": [tag for tag in volumes if tag != inside]})
        _, faces = gmsh.model.getAdjacencies(3, inside)
        name(2, {"end": [tag for tag in on_plane(2, 2, 0.0) if tag in faces]})
        name(2, {"seam": interface(2)})
        name_planes(2, {"left": (0, -1.0)})
        generate(3, lambda x, y, z: 0.25, order)
        write_split(path)


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("order", [1, 2])
def test_a_round_pin_may_spin(read: Read, order: int, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        problem = Problem(
            read(write_bolted, order=order),
            {"pin": STEEL, "plate": STEEL},
            [Support("left"), Support("end", "z")],
            [BodyForce("pin", (1.0, 0.0, 0.0))],
            [Contact("pin_seam", "plate_seam")],
            degree=order,
        )
    (loose,) = loose_motions(problem.V, problem.bodies, problem.fixed, problem.constraints)
    assert loose.motion == "rotation about z"
    assert "'pin'" in caplog.text or problem.comm.rank > 0
    assert caplog.text.count("loosely held") == (problem.comm.rank == 0)
    assert_solved(Newton(problem).solve(100.0))


@pytest.mark.serial
def test_all_that_is_loose_is_one_sentence() -> None:
    motions = [
        LooseMotion(0, "rotation about z"),
        LooseMotion(1, "translation in z"),
        LooseMotion(2, "rotation about z"),
    ]
    words = in_words(motions, ["'nut_2'", "'bolt'", "'nut_1'"])
    assert "'nut_1' and 'nut_2' (rotation about z); 'bolt' (translation in z)." in words
    assert "if loads cause such a rotation or push bodies in such a direction" in words
    assert "push" not in in_words(motions[:1], ["'nut_2'"])


@pytest.mark.parametrize("make", [punch_problem, two_blocks_problem, stack_problem])
def test_bodies_that_are_held_are_not_named(make: Callable[[int], Problem]) -> None:
    problem = make(2)
    assert not loose_motions(problem.V, problem.bodies, problem.fixed, problem.constraints)


def write_long_beam(path: str | Path) -> None:
    """Write a beam that is held at its end ``wall`` and rests on a distant block."""
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        beam, block = occ.addBox(0, 0, 1, 8, 1, 1), occ.addBox(6, 0, 0, 2, 1, 1)
        occ.fragment([(3, beam)], [(3, block)])
        occ.synchronize()
        name(3, {"beam": [beam], "block": [block]})
        name(2, {"seam": interface(2)})
        name_planes(2, {"wall": (0, 0.0), "floor": (2, 0.0)})
        generate(3, lambda x, y, z: 1.0, 1)
        write_split(path)


def test_a_beam_that_is_held_far_from_where_it_rests(read: Read) -> None:
    """Contact allows rotation about an axis in the wall. The body hardly moves near this axis."""
    problem = Problem(
        read(write_long_beam),
        {"beam": STEEL, "block": STEEL},
        [Support("wall"), Support("floor")],
        [BodyForce("beam", (0.0, 0.0, -1.0))],
        [Contact("beam_seam", "block_seam")],
    )
    assert not loose_motions(problem.V, problem.bodies, problem.fixed, problem.constraints)


def test_a_narrow_sector_is_held(read: Read, caplog: pytest.LogCaptureFixture) -> None:
    """Three planes pass through the centre of a sphere, and almost through one line."""
    supports = [Support("x0", "x"), Support("y0", "y"), Support("oblique", "normal")]
    loads = [Pressure("inner", 1.0)]
    with caplog.at_level(logging.WARNING):
        Problem(read(write_sphere_sector, size=0.33), {"shell": STEEL}, supports, loads)
    assert "loosely held" not in caplog.text


def write_quarter_ring(path: str | Path) -> None:
    """Write a thin ring whose ends lie in the planes x = 0 and y = 0."""
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        outer, inner = occ.addDisk(0, 0, 0, 51, 51), occ.addDisk(0, 0, 0, 49, 49)
        ring, _ = occ.cut([(2, outer)], [(2, inner)])
        ring, _ = occ.intersect(ring, [(2, occ.addRectangle(0, 0, 0, 60, 60))])
        occ.synchronize()
        name(2, {"ring": [tag for _, tag in ring]})
        name(1, {axis: on_plane(1, number, 0.0) for number, axis in enumerate("xy")})
        generate(2, lambda x, y, z: 2.0, 1)
        gmsh.write(str(path))


@pytest.mark.mpi2
@pytest.mark.parametrize("components", ["letters", "normal"])
def test_a_thin_ring_is_held_by_its_ends(
    read: Read, caplog: pytest.LogCaptureFixture, components: str
) -> None:
    """For any form of the supports, their resistance does not depend on facets."""
    letters = {axis: axis if components == "letters" else "normal" for axis in "xy"}
    supports = [Support(axis, held) for axis, held in letters.items()]
    with caplog.at_level(logging.WARNING):
        problem = Problem(
            read(write_quarter_ring), {"ring": STEEL}, supports, [BodyForce("ring", (0.0, -1.0))]
        )
    assert "loosely held" not in caplog.text
    rows = (problem.V, problem.bodies, problem.fixed, problem.constraints)
    assert not loose_motions(*rows, flat=len(problem.constraints.host))
