# %% [markdown]
# # Bounds for each kind of problem
#
# The demo computes strict bounds for a strip footing, and for a strong punch on the same ground,
# with k = 1 and one mesh for each problem. The problems have constant loads, friction, ties, a
# rigid surface, axial symmetry, and combinations of these features.
#
# - On any number of ranks, both bounds must equal the bounds that were computed on one rank, within
#   the tolerance of the search.
# - The demo compares the cost of each problem with the cost of the frictionless problem under
#   proportional loads on the same mesh. The number of factorisations may be at most 1.5 times as
#   large. The table also shows the ratio of processor times for one factorisation, which is at most
#   about 1.3. The demo does not check this ratio, because other work on the machine changes it.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/statements.py

# %%
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

from demos.verification.bounded_bodies import of_shear
from demos.verification.study import Row, mesh, run
from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    BodyBounds,
    Contact,
    Force,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Tie,
    Traction,
    limit_bounds,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Bounds of each kind of statement"
TOLERANCE = 1e-4
"""Relative tolerance of each bound on its mesh."""
MORE = 1.5
"""Largest ratio of the numbers of factorisations with and without the additional statement."""
REPEATED = 3
"""Number of measurements of processor time, after a first run that does not count."""
GROUND, PUNCH = of_shear(1.0), of_shear(50.0)
SEAM = ("ground_footing", "punch_footing")


@dataclass(frozen=True)
class Statement:
    """A problem with an additional statement, such as friction, and the known bounds.

    Attributes:
        words: Name of the case.
        beside: Name of the frictionless case with proportional loads on the same mesh; this case
            has its own name here.
        known: Both bounds, computed on one rank.
        given: Arguments of :class:`Problem` that differ from those of the plain footing or punch.
        plates: Rigid surfaces.
        punch: Whether a strong punch rests on the ground.
        turned: Whether the bodies are axisymmetric.
    """

    words: str
    beside: str
    known: tuple[float, float]
    given: dict[str, Any]
    plates: Sequence[RigidSurface] = ()
    punch: bool = False
    turned: bool = False

    def problem(self, folder: ResultFolder, size: float) -> Problem:
        """Return the problem on its mesh. Collective."""
        section = mesh(folder, write_strip_footing, size=size, punch=self.punch)
        supports = [Support("side", "x"), Support("bottom")]
        supports += [] if self.turned else [Support("x0", "x")]
        given: dict[str, Any] = {
            "loads": [Pressure("top" if self.punch else "footing", 1.0)],
            "contacts": [Contact(*SEAM)] if self.punch else [],
        }
        return Problem(
            section.turned() if self.turned else section,
            {"ground": GROUND} | ({"punch": PUNCH} if self.punch else {}),
            [*supports, *self.plates],
            degree=2,
            **(given | self.given),
        )


# %%
DOWN, ASIDE = Pressure("footing", 1.0), Traction("footing", (0.3, 0.0))
AROUND = Pressure("free", 1.0, constant=True)
PLATE, PUSHED = [RigidSurface("footing", held="x")], {"loads": [Force("footing", [0.0, -1.0])]}


def rubbing(**friction: float | bool) -> dict[str, Any]:
    """Return a contact with friction."""
    return {"contacts": [Contact(*SEAM, **friction)]}  # type: ignore[arg-type]


STATEMENTS = (
    Statement("V", "V", (3.245466, 5.172423), {}),
    Statement("V and H", "V and H", (2.145893, 3.263486), {"loads": [DOWN, ASIDE]}),
    Statement(
        "dead H", "V and H", (2.733033, 4.856214), {"loads": [DOWN, replace(ASIDE, constant=True)]}
    ),
    Statement("dead pressure beside", "V", (4.245429, 6.172423), {"loads": [DOWN, AROUND]}),
    Statement("rigid surface", "V", (4.96447, 5.260535), PUSHED, PLATE),
    Statement("V, around", "V, around", (3.245458, 5.230256), {}, turned=True),
    Statement("rigid surface, around", "V, around", (16.969, 17.88393), PUSHED, PLATE, turned=True),
    Statement("contact", "contact", (4.902652, 5.207787), {}, punch=True),
    Statement("Tresca", "contact", (4.963977, 5.24753), rubbing(tresca=0.5), punch=True),
    Statement("Drucker's pair", "contact", (4.902652, 5.25575), rubbing(coulomb=0.2), punch=True),
    Statement(
        "joint", "contact", (4.964481, 5.25575), rubbing(coulomb=0.2, associated=True), punch=True
    ),
    Statement("tie", "contact", (4.964483, 5.260535), {"contacts": [Tie(*SEAM)]}, punch=True),
    Statement(
        "contact, around", "contact, around", (5.100111, 5.346279), {}, punch=True, turned=True
    ),
    Statement(
        "Tresca, dead, around",
        "contact, around",
        (6.36655, 6.605872),
        rubbing(tresca=0.5) | {"loads": [Pressure("top", 1.0), AROUND]},
        punch=True,
        turned=True,
    ),
)


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for bounds and their cost. Collective."""
    seconds: dict[str, list[float]] = {it.words: [] for it in STATEMENTS}
    found: dict[str, BodyBounds] = {}
    for turn in range(1 if coarse else 1 + REPEATED):
        for it in STATEMENTS:
            problem = it.problem(folder, 0.4)
            began = time.process_time()
            found[it.words] = limit_bounds(problem, TOLERANCE)
            if turn or coarse:
                seconds[it.words].append(comm.allreduce(time.process_time() - began))
    each = {
        words: statistics.median(seconds[words]) / bounds.factorisations
        for words, bounds in found.items()
    }
    rows: list[Row] = []
    for it in STATEMENTS:
        bounds, plain = found[it.words], found[it.beside]
        lower, upper = bounds.lower, bounds.upper
        assert lower.strict and upper.strict, f"{lower!r}, {upper!r}"
        assert lower.value is not None and upper.value is not None
        more = bounds.factorisations / plain.factorisations
        told: list[tuple[str, float, float, float | None, bool]] = [
            ("below, of one rank", lower.value, it.known[0], TOLERANCE, False),
            ("above, of one rank", upper.value, it.known[1], TOLERANCE, False),
        ]
        if it.words != it.beside:
            told += [
                ("factorisations, over", more, MORE, 0.0, True),
                ("time of one, over", each[it.words] / each[it.beside], 1.0, None, False),
            ]
        rows += [
            Row(
                case=it.words,
                quantity=quantity,
                element="P1 and P2",
                size=0.4,
                dofs=bounds.problem.num_dofs,
                computed=computed,
                exact=exact,
                allowed=allowed,
                solves=0,
                seconds=statistics.median(seconds[it.words]),
                bound=at_most,
                bracket=f"{lower.shown} ... {upper.shown}",
            )
            for quantity, computed, exact, allowed, at_most in told
        ]
    last, given = found["contact"], found["contact"].problem.given
    scene = Scene(TITLE, given.loads, given.contacts)
    writer = ResultWriter(folder, last.problem, scene, "interior-point", prescribed=Prescribed.WORK)
    writer.write_limit(last.mesh, last, None)
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
