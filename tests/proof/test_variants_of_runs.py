"""Test ten variants of each kind of honest run whose bounds the checker once refused.

- Separately meshed bodies in contact, under pressures far above their strength: both sides of a
seam differ by rounding. - Ground whose cohesion is far below its pressures: Rankine's passive and
active states. - Walls with friction on ground: bounds on each mesh, and strict upper bounds.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from demos.verification.wall_bounds import PUSHED, YIELDS, Wall, beside
from meshes.retaining_wall import write_retaining_wall
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Contact,
    DruckerPrager,
    MohrCoulomb,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    Tie,
    VonMises,
    adaptive_bounds,
    limit_bounds,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.proof import check
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read

pytestmark = pytest.mark.serial

COMM = MPI.COMM_WORLD


def assert_proven(path: Path, low: BodyBounds, high: BodyBounds) -> None:
    """Check that the checker proves both halves on file, with the reported values."""
    assert low.lower.strict, low.why_not
    assert high.upper.strict, high.why_not
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(low, high))
    found = check(folder.file("bounds.h5"))
    assert not any(half.faults for half in found.values())
    assert found["lower"].proven == pytest.approx(low.lower.value, rel=1e-8)
    assert found["upper"].proven == pytest.approx(high.upper.value, rel=1e-8)


@dataclass(frozen=True)
class Apart:
    """Two stacked blocks with separate meshes, and a constant pressure on their sides.

    Attributes:
        cohesion: Cohesion of Mohr–Coulomb ground with φ = 30°; for ``metal`` the shear strength.
        sides: Pressure on the sides.
        lower: Cells along the lower block.
        upper: Cells along the upper one.
        slope: Inclination of the seam.
        friction: μ of the joint, whose slip is associated.
        adhesion: c of the joint.
        glued: Whether the blocks are tied instead.
        metal: Whether they are of metal.
        off: Distance between the vertices of both sides.
        far: Distance from the origin.
    """

    cohesion: float = 0.01
    sides: float = 5.0
    lower: int = 2
    upper: int = 3
    slope: float = 0.0
    friction: float = 0.3
    adhesion: float = 0.0
    glued: bool = False
    metal: bool = False
    off: float = 3.4e-12
    far: float = 0.0

    @property
    def exact(self) -> float:
        """Return the pressure on the top at which the uniform stress yields."""
        steep = 1.0 if self.metal else math.tan(math.radians(60.0))
        return (steep**2 - 1) * self.sides + 2 * self.cohesion * steep + self.sides

    def problem(self) -> Problem:
        """Return the problem."""
        mesh = blocks_apart(COMM, [self.lower] * 2, [self.upper] * 2, slope=self.slope)
        x = mesh.mesh.geometry.x
        seam = np.abs(x[:, 1] - 1.0 - self.slope * (x[:, 0] - 0.5)) < 1e-9
        x[seam, :2] += self.off * np.random.default_rng(1).uniform(-1, 1, (int(seam.sum()), 2))
        x[:, 0] += self.far
        body: Material = MohrCoulomb(1e4, 0.3, self.cohesion, 30.0)
        if self.metal:
            body = VonMises(1e4, 0.3, math.sqrt(3.0) * self.cohesion)
        seams = ("lower_top", "upper_bottom")
        joint = Contact(*seams)
        if self.friction:
            joint = Contact(*seams, tresca=self.adhesion, coulomb=self.friction, associated=True)
        return Problem(
            mesh,
            {"lower": body, "upper": body},
            [Support("bottom", "y"), Support("x0", "x"), Support("upper_x0", "x")],
            [
                Pressure("top", 1.0),
                *(Pressure(side, self.sides, constant=True) for side in ("x1", "upper_x1")),
            ],
            [Tie(*seams) if self.glued else joint],
            degree=2,
        )


APART = {
    "little cohesion": Apart(cohesion=1e-3, sides=1.0),
    "less beside the pressure": Apart(cohesion=1e-3),
    "more": Apart(cohesion=0.1),
    "smooth": Apart(friction=0.0),
    "adhesion": Apart(adhesion=0.05),
    "tied": Apart(glued=True),
    "many cells": Apart(lower=7, upper=4),
    "inclined": Apart(slope=0.2, friction=0.6),
    "farther apart": Apart(off=1e-11),
    "tied and inclined": Apart(glued=True, slope=0.2),
    "far from the origin": Apart(far=1e3, off=1e-12),
    "metal": Apart(cohesion=1e-3, sides=100.0, metal=True, friction=0.0),
}


@pytest.mark.long(but=["little cohesion", "smooth", "metal"])
@pytest.mark.parametrize("name", APART)
def test_blocks_meshed_apart_under_pressure(tmp_path: Path, name: str) -> None:
    it = APART[name]
    bounds = limit_bounds(it.problem(), 1e-5)
    assert_proven(tmp_path, bounds, bounds)
    assert bounds.lower.value is not None and bounds.upper.value is not None
    assert it.exact * (1 - 1e-3) <= bounds.lower.value <= it.exact * (1 + 1e-9)
    assert it.exact * (1 - 1e-9) <= bounds.upper.value <= it.exact * (1 + 1e-3)


@dataclass(frozen=True)
class Rankine:
    """A block of heavy ground between smooth planes, pushed or released at its right side.

    Attributes:
        cohesion: Over the weight of a column of the block's height.
        angle: Angle of friction (degrees).
        height: Height and width.
        weight: Weight per volume.
        surcharge: Pressure on the top, over the weight of that column.
        active: Whether the weight grows beside a pressure that stays.
        by_cone: Whether the law is Drucker and Prager's.
        cells: Cells along each side.
    """

    cohesion: float = 0.003
    angle: float = 35.0
    height: float = 1.0
    weight: float = 2.0
    surcharge: float = 0.0
    active: bool = False
    by_cone: bool = False
    cells: int = 3

    def problem(self) -> Problem:
        """Return the problem, whose limit load is 1."""
        c, h = self.cohesion * self.weight * self.height, self.height
        names: dict[str, Callable] = {
            "x0": lambda x: x[0] < 1e-9 * h,
            "x1": lambda x: x[0] > h * (1 - 1e-9),
            "y0": lambda x: x[1] < 1e-9 * h,
            "y1": lambda x: x[1] > h * (1 - 1e-9),
        }
        ground = {"ground": lambda x: x[1] > -1}
        mesh = rectangle((self.cells, self.cells), (h, h), ground, names)
        steep = math.tan(math.radians(45 + self.angle / 2))
        steep = 1 / steep if self.active else steep
        own = -2 * c * steep if self.active else 2 * c * steep

        law: Material = MohrCoulomb(1e4, 0.3, c, self.angle)
        if self.by_cone:
            law = DruckerPrager(1e4, 0.3, c, self.angle, "plane-strain")
        top = self.surcharge * self.weight * h
        weight, deeper = steep**2 * self.weight, steep**2 * (self.weight * h + top) + own
        push = f"{deeper:.17g} - {weight:.17g}*y"
        loads = [
            Pressure("x1", push, constant=self.active),
            BodyForce("ground", [0.0, -self.weight], constant=not self.active),
            *([Pressure("y1", top, constant=not self.active)] if top else []),
        ]
        supports = [Support("x0", "x"), Support("y0", "y")]
        return Problem(mesh, {"ground": law}, supports, loads, degree=2)


RANKINE = {
    "passive": Rankine(),
    "steeper": Rankine(angle=42.0, cohesion=0.001),
    "flatter": Rankine(angle=15.0),
    "hardly any cohesion": Rankine(cohesion=1e-5),
    "in mm and kPa": Rankine(height=1e4, weight=2e-5),
    "tiny": Rankine(height=1e-3, weight=2e4),
    "surcharge": Rankine(surcharge=3.0, cohesion=1e-4),
    "Drucker and Prager": Rankine(by_cone=True, angle=30.0),
    "many cells": Rankine(cells=7),
    "active": Rankine(active=True, surcharge=1.0),
    "active, steeper": Rankine(active=True, angle=42.0, surcharge=0.3, cohesion=1e-3),
}


@pytest.mark.long(but=["hardly any cohesion"])
@pytest.mark.parametrize("name", RANKINE)
def test_ground_with_hardly_any_cohesion(tmp_path: Path, name: str) -> None:
    bounds = limit_bounds(RANKINE[name].problem(), 1e-5)
    assert_proven(tmp_path, bounds, bounds)
    assert bounds.lower.value is not None and bounds.upper.value is not None
    assert 1 - 5e-4 < bounds.lower.value <= 1 + 1e-9
    assert 1 - 1e-9 <= bounds.upper.value < 1 + 5e-4


WALLS = {
    "pushed": replace(PUSHED, width=3.0),
    "hardly rubs": Wall(30.0, 5.0, below=3.0, width=3.0),
    "as rough as the ground": Wall(30.0, 30.0, below=3.0, width=3.0),
    "weak ground": Wall(20.0, 10.0, below=2.0, width=3.0),
    "weak ground, rough": Wall(20.0, 20.0, below=2.0, width=3.0),
    "strong ground": Wall(40.0, 20.0, below=4.0, width=4.0),
    "nearly smooth": Wall(35.0, 1.0, below=3.5, width=3.0),
    "yields": YIELDS,
    "yields, rough": Wall(30.0, 30.0, below=1.0, pushed=False, width=3.0),
    "yields, weak": Wall(20.0, 10.0, below=1.0, pushed=False, width=3.0),
}


@pytest.mark.long
@pytest.mark.parametrize("name", WALLS)
def test_walls_that_rub(read: Read, tmp_path: Path, name: str) -> None:
    """Each mesh has proven bounds, or no bounds."""
    wall = WALLS[name]
    problem = beside(read(write_retaining_wall, width=wall.width), wall)
    found = adaptive_bounds(problem, Adaptation(until=0.05, cells=300))
    assert_proven(tmp_path, found.low, found.high)
    assert len(found.rounds) > 1
    rounding = 1e-9 * abs(wall.exact)
    for one in found.rounds:
        assert one.upper is not None
        assert one.upper >= wall.exact - rounding
        assert one.lower is None or one.lower <= wall.exact + rounding
