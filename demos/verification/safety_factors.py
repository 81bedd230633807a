# %% [markdown]
# # Factors of safety
#
# The demo checks strict brackets for factors of safety, their width, and the number of bounds that
# the program computes for a bracket. Each mesh requires a lower and an upper bound, and each
# further F requires one bound.
#
# - Ground that is glued to other bodies: a gravity wall, a steel footing near a slope, sand on
#   clay, and a strip in the slope of ACADS 1(a). The brackets must be narrower than 1 % after 12
#   bounds.
# - A sand slope with φ = 32° and an inclination β = 21.8°. As the cohesion tends to zero, F tends
#   to tan φ/tan β = 1.5622. The brackets must be narrower than 2 %.
# - Homogeneous slopes, compared with log spirals, which are mechanisms: D. V. Griffiths and P. A.
#   Lane (Géotechnique 49 (1999), 387), ACADS 1(a), and a slope of 45°.
#
#     ./fenicsx python3 demos/verification/safety_factors.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.slope import write_slope
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    FactorOfSafety,
    MohrCoulomb,
    Problem,
    Support,
    factor_of_safety,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene, read_case
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Factors of safety"
FOLDER = Path(__file__).parent / "cases"
"""Case files; ``perfplast run CASE --trust`` solves each of them."""
WIDTH, BOUNDS = 1.0, 12
"""Largest width (percent) and number of bounds for ground that is tied to other bodies."""
GLUED = ("strip_in_slope", "footing_of_steel", "sand_on_clay", "gravity_wall")
COHESIONS = (1e-2, 1e-3, 1e-4, 1e-5)
NO_COHESION = 2.5 * math.tan(math.radians(32.0))
"""tan φ/tan β of the sand slope."""
COARSE = Adaptation(0.5, 300)

SLOPES = {
    "Griffiths and Lane, first": ({"size": 0.05}, 20.0, 0.05, 0.012, 1.3978),
    "Griffiths and Lane, second": ({"depth": 0.5, "size": 0.07}, 20.0, 0.05, 0.018, 1.3682),
    "ACADS 1(a)": ({"depth": 0.5, "size": 0.07}, 19.6, 0.015, 0.03, 0.9845),
    "1:1": ({"run": 1.0, "depth": 1.0, "size": 0.07}, 45.0, 0.03, 0.025, 1.5291),
}
"""Mesh, φ (degrees), c/γH, gap of μ at which the refinement ends, and F of the best log spiral."""


# %%
def of_case(
    comm: MPI.Intracomm, name: str, coarse: bool, cohesion: float | None = None
) -> FactorOfSafety:
    """Return the factor of safety of a case; ``cohesion`` replaces its cohesion. Collective."""
    case = read_case(FOLDER / f"{name}.toml", comm, trust=True)
    if cohesion is not None:
        (soil,) = case.materials
        sand = case.materials[soil]
        assert isinstance(sand, MohrCoulomb)
        case.materials[soil] = replace(sand, cohesion=cohesion)
    tolerance = case.loading.limit_tolerance
    assert tolerance is not None
    return factor_of_safety(case.problem(comm), tolerance, COARSE if coarse else case.adapt)


def of_slope(folder: ResultFolder, name: str, coarse: bool) -> FactorOfSafety:
    """Return the factor of safety of a slope of height 1 and unit weight 1. Collective."""
    shape, degrees, cohesion, until, _ = SLOPES[name]
    ground = mesh(folder, write_slope, **shape)
    held = [Support("bottom"), Support("left", "x")]
    held += [Support("right", "x")] if "depth" in shape else []
    soil = MohrCoulomb(1e4, 0.3, cohesion, degrees)
    weight = BodyForce("soil", (0.0, -1.0), constant=True)
    problem = Problem(ground, {"soil": soil}, held, [weight], degree=2)
    return factor_of_safety(problem, 2e-3, COARSE if coarse else Adaptation(until, 5000))


def rows_of(
    case: str, found: FactorOfSafety, began: float, told: Sequence[tuple[str, float, float]]
) -> list[Row]:
    """Return rows for quantities, each with its largest allowed value."""
    return [
        Row(
            case=case,
            quantity=quantity,
            element="P1 and P2",
            size=1.0,
            dofs=found.bodies.num_dofs,
            computed=small,
            exact=large,
            allowed=0.0,
            solves=0,
            seconds=time.process_time() - began,
            bound=True,
            bracket=f"{found.lower:.5g} ... {found.upper:.5g}, {found.searches} bounds",
        )
        for quantity, small, large in told
    ]


def ends(found: FactorOfSafety) -> tuple[float, float]:
    """Return both proven factors."""
    assert found.lower is not None, found.in_words()
    assert found.upper is not None, found.in_words()
    return found.lower, found.upper


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for brackets, their widths, and the numbers of bounds. Collective."""
    rows: list[Row] = []
    for name in GLUED[:1] if coarse else GLUED:
        began = time.process_time()
        found = of_case(comm, name, coarse)
        low, high = ends(found)
        told = [("width in %", 100 * (high / low - 1), 50.0 if coarse else WIDTH)]
        told += [] if coarse else [("bounds", found.searches, BOUNDS)]
        rows += rows_of(name.replace("_", " "), found, began, told)
        show(subfolder(folder, name), found)
    for cohesion in COHESIONS[:1] if coarse else COHESIONS:
        began = time.process_time()
        found = of_case(comm, "sand_slope", coarse, cohesion)
        low, high = ends(found)
        told = [("tan φ/tan β, below", NO_COHESION, high)]
        told += [] if coarse else [("width in %", 100 * (high / low - 1), 2.0)]
        rows += rows_of(f"sand, c/γH = {cohesion:g}", found, began, told)
    for name, (*_, spiral) in list(SLOPES.items())[:1] if coarse else SLOPES.items():
        began = time.process_time()
        found = of_slope(folder, name, coarse)
        low, high = ends(found)
        told = [("below, log spiral", low, spiral)]
        told += [] if coarse else [("width in %", 100 * (high / low - 1), 1.2)]
        told += [] if coarse else [("bounds", found.searches, BOUNDS)]
        rows += rows_of(name, found, began, told)
    return rows


def show(folder: ResultFolder, found: FactorOfSafety) -> None:
    """Draw the collapse mechanism. Collective."""
    given = found.bodies.given
    scene = Scene(TITLE, given.loads, given.contacts)
    writer = ResultWriter(folder, found.bodies, scene, "interior-point", prescribed=Prescribed.WORK)
    writer.write_safety(found)
    draw(folder)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
