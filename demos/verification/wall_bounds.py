# %% [markdown]
# # Bounds for a wall with friction
#
# A stiff wall of height 1 is pushed against the ground or moves away from it. The ground has the
# friction angle φ, no cohesion and no weight, and carries a surcharge of 1. The joint between wall
# and ground has the friction angle δ, and opens while it slips (associated slip). The wall does not
# rotate, and the force along its direction of motion is
#
#     K = cos δ (cos δ ± √(sin²φ − sin²δ))/(1 ∓ sin φ) exp(±θ tan φ),  θ = asin(sin δ/sin φ) ± δ
#
# with the upper signs for a wall that is pushed (K_pq), and the lower signs for a wall that moves
# away (K_aq).
#
# The velocity of the mechanism jumps at the toe. A mesh whose ground is one piece and is held at
# the toe cannot represent this jump. So the ground extends below the toe. The face below the toe
# has neither a support nor a contact, but a constant pressure. This pressure lies between the
# pressure at which the ground would follow the wall and the pressure that would push the ground
# away. In the mechanism for K the ground below the toe is at rest. So the pressure does no work,
# and K is an upper bound for any such pressure; the lower bound shows that the ground carries K.
#
#     ./fenicsx python3 demos/verification/wall_bounds.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.retaining_wall import write_retaining_wall
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder

TITLE = "Walls from both sides"


@dataclass(frozen=True)
class Wall:
    """A wall and the ground next to it.

    Attributes:
        friction: Friction angle of the ground (degrees).
        joint: Friction angle of the joint (degrees).
        below: Pressure on the face of the ground below the toe.
        pushed: Whether the wall is pushed against the ground.
        width: Width of the ground.
    """

    friction: float
    joint: float
    below: float
    pushed: bool = True
    width: float = 6.0

    @property
    def name(self) -> str:
        """Return the name of the factor."""
        return f"{'K_pq' if self.pushed else 'K_aq'}, φ {self.friction:g}°, δ {self.joint:g}°"

    @property
    def exact(self) -> float:
        """Return the limit load over surcharge and height; negative if the wall moves away."""
        phi, delta = math.radians(self.friction), math.radians(self.joint)
        sign = 1 if self.pushed else -1
        turned = math.asin(math.sin(delta) / math.sin(phi)) + sign * delta
        root = math.sqrt(math.sin(phi) ** 2 - math.sin(delta) ** 2)
        least = math.cos(delta) * (math.cos(delta) + sign * root) / (1 - sign * math.sin(phi))
        return sign * least * math.exp(sign * turned * math.tan(phi))


PUSHED = Wall(30.0, 15.0, below=3.0)
YIELDS = Wall(30.0, 15.0, below=1.0, pushed=False, width=3.0)
ROUGH = Wall(30.0, 30.0, below=3.0)
ASKED, CELLS, FEW = 0.015, 4000, 150
"""Required gap for both factors, largest number of cells, and number of cells in a quick run."""


# %%
def beside(ground: TaggedMesh, wall: Wall) -> Problem:
    """Return the problem of wall and ground, with a growing pressure on the wall's back.

    Collective.
    """
    rubs = math.tan(math.radians(wall.joint))
    return Problem(
        ground,
        {"ground": MohrCoulomb(1e4, 0.3, 0.0, wall.friction), "wall": Elastic(1e6, 0.3)},
        [Support("bottom"), Support("side"), Support("crest", "y")],
        [
            Pressure("back", 1.0 if wall.pushed else -1.0),
            Pressure("top", 1.0, constant=True),
            Pressure("below", wall.below, constant=True),
        ],
        [Contact("ground_face", "wall_face", coulomb=rubs, associated=True)],
        degree=2,
    )


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for brackets of the exact factors. Collective."""
    rows: list[Row] = []
    adaptation = Adaptation(ASKED, FEW if coarse else CELLS)
    for wall in (PUSHED,) if coarse else (ROUGH, YIELDS, PUSHED):
        began = time.perf_counter()
        ground = mesh(folder, write_retaining_wall, width=wall.width)
        found = adaptive_bounds(beside(ground, wall), adaptation)
        low, high = ends(found)
        told = [("below, exact", low, wall.exact), ("exact, above", wall.exact, high)]
        if not coarse:
            told += [("gap in %", 100 * (high - low) / abs(low), 100 * ASKED)]
        rows += at_most(wall.name, found, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "pushed"), "Wall that is pushed and rubs", found)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
