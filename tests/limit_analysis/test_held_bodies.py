"""Test that the program names stiff bodies whose supports carry loads that nothing limits."""

from collections.abc import Callable

import pytest

from perfplast_fenicsx import (
    BodyForce,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Traction,
    VonMises,
    limit_bounds,
)
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import held_bodies
from tests.limit_analysis.test_static_bound import rectangle

CLAY, SAND = VonMises(1e4, 0.3, 1.0), MohrCoulomb(1e4, 0.3, 1.0, 20.0)
STIFF = Elastic(1e4, 0.3)
PUSH = Pressure("left", 1.0)


def wall(
    load: object = PUSH,
    law: object = CLAY,
    bottom: str = "xy",
    toe: float = 0.0,
    wide: float = 0.5,
    high: int = 2,
) -> Problem:
    """Return a stiff wall glued to ground; the bottom is held from a given place on."""
    sides = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 2 - 1e-9,
        "top": lambda x: x[1] > high / 2 - 1e-9,
        "bottom": lambda x: (x[1] < 1e-9) & (x[0] > toe - 1e-9),
    }
    parts = {"wall": lambda x: x[0] < wide, "ground": lambda x: x[0] > wide}
    mesh = rectangle((4, high), (2.0, high / 2), parts, sides)
    supports = [Support("bottom", bottom), Support("right", "x")]
    return Problem(mesh, {"wall": STIFF, "ground": law}, supports, [load], degree=2)


HELD: dict[str, tuple[Callable[[], Problem], str]] = {
    "driven into clay": (lambda: wall(), "x"),
    "driven into sand": (lambda: wall(law=SAND), "x"),
    "pulled": (lambda: wall(Pressure("left", -1.0)), "x"),
    "dragged along": (lambda: wall(Traction("left", (1.0, 0.0))), "x"),
    "pressed down": (lambda: wall(Traction("left", (0.0, -1.0))), "y"),
    "both": (lambda: wall(Traction("left", (1.0, -1.0))), "x, y"),
    "heavy": (lambda: wall(BodyForce("wall", (1.0, 0.0))), "x"),
    "held along one axis": (lambda: wall(bottom="x"), "x"),
    "a toe alone": (lambda: wall(toe=0.5), "x"),
    "thicker": (lambda: wall(wide=1.0), "x"),
}
FREE: dict[str, Callable[[], Problem]] = {
    "held beyond the toe": lambda: wall(toe=1.0),
    "on rollers": lambda: wall(bottom="y"),
    "the ground is loaded": lambda: wall(Pressure("top", 1.0), wide=-1.0),
}


@pytest.mark.parametrize("name", HELD)
def test_a_held_wall_is_named(name: str) -> None:
    make, axes = HELD[name]
    (words,) = held_bodies(make())
    assert f"supports hold nodes of 'wall', which does not yield, along {axes} against" in words


@pytest.mark.parametrize("name", FREE)
def test_others_are_not(name: str) -> None:
    assert not held_bodies(FREE[name]())


@pytest.mark.mpi2
def test_the_words_of_a_run() -> None:
    words = limit_bounds(wall()).in_words()
    assert "Nothing limits the loads" in words
    assert "Supports hold nodes of 'wall'" in words
