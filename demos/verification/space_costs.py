# %% [markdown]
# # The cost of bounds in 3D
#
# The demo computes strict brackets for the limit loads of nine 3D bodies, each in about a minute on
# one core, including the start of the program. One body is repeated with a limit of some minutes.
# Each mesh covers the part between planes of symmetry, with few cells, which are arranged along the
# expected plastic hinges ([meshes/sectors.py](../../meshes/sectors.py)):
#
# - the tutorial's **beam on its prop**, the demo's **two blocks**, and an **L-bracket**: halves;
# - a smooth **square punch**, an elastic body in contact, and a **uniform pressure** on a square:
#   eighths between a middle plane and a diagonal plane; each bound for the pressure has a separate
#   mesh;
# - a **cube between rough platens**: a sixteenth, in which the platen is a rigid surface;
# - a **thick sphere**: a 120th, with a polyhedron for each bound ([why](bounds_in_space.py));
# - a **cantilever** 5×1×1 under an end shear, a quarter, and a clamped **plate** 10×10×1 under a
#   pressure, a sixteenth. The bending stress is an odd function of the distance from the middle
#   plane. The mirror image of a mechanism with the opposite sign is also a mechanism, and so is the
#   mean of both mechanisms. Points of the middle plane move only normal to this plane in the mean
#   mechanism, so the model holds the other components there. Half of the load acts on each side of
#   the plane. Two halves of the plate's pressure on its two faces differ from the whole pressure on
#   one face by a hydrostatic stress, which the clamped sides can carry.
#
# Metals obey von Mises' law, with k = 1 except for the first two bodies. Convergence rates start at
# the second mesh.
#
#     OMP_NUM_THREADS=1 ./fenicsx python3 demos/verification/space_costs.py

# %%
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from mpi4py import MPI

import numpy as np

from demos.two_blocks import STEEL
from demos.verification.bounded_bodies import GROUND
from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes import sectors
from meshes.sphere_sector import write_sphere_sector
from meshes.thick_sphere import INNER, OUTER
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Elastic,
    Force,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Traction,
    VonMises,
    adaptive_bounds,
)
from perfplast_fenicsx.cli import Terminal
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import AdaptiveBounds, Round
from perfplast_fenicsx.materials import Material

TITLE = "The cost of bounds in 3D"
RTOL = 1e-3
"""Tolerance of each bound on its mesh, much smaller than the gaps."""
NARROWER = 1e-3  # smaller than all gaps here: the limit on cells ends each case
ONE_MESH = 1  # largest number of cells: only the first mesh is used
S235 = VonMises(young=210e3, poisson=0.3, yield_stress=235.0)
Y0, OBLIQUE = Support("y0", "y"), Support("oblique", "normal")
MIDDLE = Support("z0", "xy")
"""Support that prevents in-plane motion in the middle plane of bent bodies."""
EXACT = 2 * math.sqrt(3) * math.log(OUTER / INNER)
SIZES = {"inner": 0.065, "outer": 0.09}
"""Edge lengths of the sphere's elements, for the lower and the upper bound."""
COARSE = 0.33
STARTED = sum(os.times()[:4])
"""Processor time (s) of the start of the program."""


@dataclass(frozen=True)
class Case:
    """A problem, and the gap that the bounds should reach.

    Attributes:
        name: Name in the table.
        write: Function that makes the first mesh.
        materials: Materials of the volumes.
        supports: Supports, including planes of symmetry, and rigid surfaces.
        loads: Loads.
        asked: Required gap (percent), and largest number of cells.
        coarse: Gap on the first mesh for a quick run; None if a quick run omits the case.
        contacts: Contacts between the bodies.
        above: Function that makes the first mesh for the upper bound; ``write`` then makes the mesh
            for the lower bound.
    """

    name: str
    write: Callable[..., None]
    materials: dict[str, Material]
    supports: Sequence[Support | RigidSurface]
    loads: Sequence[Pressure | Traction | Force]
    asked: tuple[float, int]
    coarse: float | None = None
    contacts: Sequence[Contact] = field(default_factory=list)
    above: Callable[..., None] | None = None


PATCH = Case(
    "pressure on a square",
    sectors.write_patch_sector,
    {"ground": GROUND},
    [Y0, OBLIQUE, Support("held")],
    [Pressure("top", 1.0)],
    (4.8, 2700),
    above=sectors.write_patch_edge_sector,
)
CASES = (
    Case(
        "beam on its prop",
        sectors.write_prop_half,
        {"beam": S235, "block": S235},
        [Support("beam_x_low"), Support("block_z_low"), Y0],
        [Pressure("beam_z_high", 1.0)],
        (5.5, 1400),
        contacts=[Contact("beam_joint", "block_joint")],
    ),
    Case(
        "two blocks",
        sectors.write_blocks_half,
        {"lower": STEEL, "upper": STEEL},
        [Support("left"), Y0],
        [Traction("top", (0.0, 0.0, -1.0))],
        (3.5, 3400),
        contacts=[Contact("upper_bottom", "lower_top")],
    ),
    Case(
        "square punch",
        sectors.write_punch_sector,
        {"ground": GROUND, "punch": Elastic(1e6, 0.3)},
        [Y0, OBLIQUE, Support("held")],
        [Pressure("top", 1.0)],
        (5.0, 3700),
        contacts=[Contact("punch_seam", "ground_seam")],
    ),
    PATCH,
    replace(
        PATCH,
        name="pressure on a square, longer",
        write=sectors.write_patch_finest_sector,
        asked=(2.6, 8000),
    ),
    Case(
        "cube, rough platens",
        sectors.write_cube_sector,
        {"cube": GROUND},
        [Support("x0", "x"), OBLIQUE, Support("z0", "z"), RigidSurface("top", held="xy")],
        [Force("top", (0.0, 0.0, -1 / 8))],
        (0.65, 2400),
        coarse=2.0,
    ),
    Case(
        "cantilever",
        sectors.write_cantilever_quarter,
        {"beam": GROUND},
        [Support("wall"), Y0, MIDDLE],
        [Traction("end", (0.0, 0.0, -1.0))],
        (1.3, 2500),
        coarse=10.0,
    ),
    Case(
        "clamped plate",
        sectors.write_plate_sector,
        {"plate": GROUND},
        [Y0, OBLIQUE, MIDDLE, Support("edge")],
        [Pressure("top", 0.5)],
        (3.6, 3200),
    ),
    Case(
        "L-bracket",
        sectors.write_bracket_half,
        {"bracket": GROUND},
        [Support("foot"), Y0],
        [Traction("end", (0.0, 0.0, -1.0))],
        (1.2, 3400),
        coarse=16.0,
    ),
)


# %%
@dataclass
class Clock:
    """Meshes, gaps and processor time of one case, including the start of the program.

    Attributes:
        comm: Communicator; the times of its ranks are added.
        below: A lower bound from another mesh, or None.
        reached: Cells, gap and seconds after each mesh.
    """

    comm: MPI.Intracomm
    below: float | None = None
    reached: list[tuple[int, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.began = self._now()

    def _now(self) -> float:
        return float(self.comm.allreduce(sum(os.times()[:4])))

    def seconds(self) -> float:
        """Return the processor time (s) so far, including the start of the program. Collective."""
        return self._now() - self.began + self.comm.size * STARTED

    def mesh(self, round_: Round) -> None:
        """Store cells, gap and time after a mesh. Collective."""
        seconds = self.seconds()
        upper, gap = round_.upper, round_.gap
        gap = gap if self.below is None or upper is None else upper / self.below - 1
        if gap is not None:
            self.reached.append((round_.cells, 100 * gap, seconds))

    def rates(self) -> tuple[float, float]:
        """Return p and q in gap ~ cells^-p and gap ~ seconds^-q, from the second mesh on."""
        cells, gaps, seconds = np.log(np.array(self.reached[1:])).T
        return -float(np.polyfit(cells, gaps, 1)[0]), -float(np.polyfit(seconds, gaps, 1)[0])

    def words(self, name: str) -> str:
        """Return lines with rates and the time for each gap; extrapolated times are in brackets."""
        told = "; ".join(f"{n} cells {gap:.2f} % {s:.0f} s" for n, gap, s in self.reached)
        if len(self.reached) < 3:
            return f"{name}: {told}"
        p, q = self.rates()
        costs = ", ".join(f"{per:g} % {self.cost(per, q)}" for per in (10, 5, 2, 1))
        return f"{name}: {told}\n    p = {p:.2f}, q = {q:.2f}; {costs}"

    def cost(self, gap: float, q: float) -> str:
        """Return the time (s) for a gap (percent), interpolated or extrapolated."""
        gaps, seconds = (np.log([it[i] for it in self.reached]) for i in (1, 2))
        wanted = math.log(gap)
        if wanted >= gaps[0]:
            return f"< {math.exp(seconds[0]):.0f} s"
        if wanted >= gaps[-1]:
            return f"{math.exp(np.interp(-wanted, -gaps, seconds)):.0f} s"
        return f"({math.exp(seconds[-1] + (gaps[-1] - wanted) / q):.0f} s)"


# %%
def bounds_of(folder: ResultFolder, case: Case, coarse: bool) -> tuple[AdaptiveBounds, Clock]:
    """Return bounds for a case on adapted meshes. Collective."""

    def on(write: Callable[..., None]) -> Problem:
        given = (case.materials, case.supports, case.loads, case.contacts)
        return Problem(mesh(folder, write), *given, degree=2)

    clock, most = Clock(folder.comm), ONE_MESH if coarse else case.asked[1]
    if case.above is not None:
        return apart(clock, on(case.write), on(case.above), most), clock
    return adaptive_bounds(on(case.write), Adaptation(NARROWER, most), RTOL, clock.mesh), clock


def apart(clock: Clock, below: Problem, above: Problem, cells: int) -> AdaptiveBounds:
    """Return a lower bound on one mesh, with upper bounds on other adapted meshes. Collective."""
    low = adaptive_bounds(below, Adaptation(NARROWER, ONE_MESH), RTOL)
    clock.below = low.lower.value
    found = adaptive_bounds(above, Adaptation(NARROWER, cells), RTOL, clock.mesh)
    return together(low, found)


def together(below: AdaptiveBounds, above: AdaptiveBounds) -> AdaptiveBounds:
    """Return the lower bound of one mesh with the upper bound of another."""
    return replace(above, low=below.low, sources=(below.sources[0], above.sources[1]))


def sphere(folder: ResultFolder, coarse: bool) -> tuple[list[AdaptiveBounds], Clock]:
    """Return bounds for the sphere from an inner and an outer polyhedron. Collective."""
    clock, bodies, held = Clock(folder.comm), list[Problem](), [Support("x0", "x"), Y0, OBLIQUE]
    for surface, size in SIZES.items():
        size = COARSE if coarse else size
        shell = mesh(folder, write_sphere_sector, size=size, circumscribed=surface)
        bodies.append(Problem(shell, {"shell": GROUND}, held, [Pressure("inner", 1.0)], degree=2))
    return [adaptive_bounds(body, Adaptation(NARROWER, ONE_MESH), RTOL) for body in bodies], clock


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for strict brackets and their cost. Collective."""
    terminal, rows = Terminal(comm), list[Row]()
    for case in CASES:
        if coarse and case.coarse is None:
            continue
        found, clock = bounds_of(folder, case, coarse)
        low, high = ends(found)
        allowed = case.asked[0] if case.coarse is None or not coarse else case.coarse
        told = [("gap in %", 100 * (high / low - 1), allowed)]
        if not coarse or case.name == "L-bracket":
            show_bounds(subfolder(folder, case.write.__name__[6:]), case.name, found)
        rows += at_most(case.name, found, clock.seconds(), told)
        terminal.say(clock.words(case.name))
    polyhedra, clock = sphere(folder, coarse)
    found, seconds = together(*polyhedra), clock.seconds()
    low, high = ends(found)
    told = [("gap in %", 100 * (high / low - 1), 20.0 if coarse else 1.0)]
    told += [("below, exact", low, EXACT), ("exact, above", EXACT, high)]
    for surface, body in zip(SIZES, polyhedra, strict=True):
        if not coarse:  # a proof holds for one body only
            show_bounds(subfolder(folder, f"sphere_{surface}"), f"sphere, {surface}", body)
    return rows + at_most("thick sphere", found, seconds, told)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
