# %% [markdown]
# # Tension and shear along different paths: a benchmark of another program
#
# A tension σ and a shear stress τ act on a cube. At first both increase together; then the shear
# stress decreases while the tension increases further, so the direction of the stress changes:
#
#     (σ, τ) = (0, 0), A (151.2, 93.1), B (257.2, 33.1), and with kinematic hardening C (259.3, 0).
#
# These are the cases SSNP14 (kinematic hardening) and SSNP15 (isotropic hardening) of Code_Aster's
# validation manual (V6.03.014 and V6.03.015, https://code-aster.org), after the guide VPCS of
# AFNOR. Young's modulus is 195000, σ_y = 181, and the tangent modulus E_T = 1930, so the hardening
# modulus is E E_T/(E − E_T). The strains at A come from a single step. To B and C Code_Aster takes
# 40 (isotropic) and 30 + 30 (kinematic) steps of the same implicit Euler method, which this demo
# repeats. The values of the guide hold in the limit of small steps, and the computed strains
# converge to these values.
#
# Along x, only an elastic pad supports the cube. The pad is softer than the cube by nine powers of
# ten. So no plane across the cube is fixed.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/tension_and_shear.py

# %%
import time
from collections.abc import Callable, Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from demos.verification.study import Row, run
from perfplast_fenicsx import (
    Elastic,
    Flow,
    Hardening,
    Level,
    LoadingHistory,
    Newton,
    Problem,
    Stage,
    Support,
    TaggedMesh,
    Tie,
    Traction,
    stage_path,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Tension and shear"
YOUNG, TANGENT = 195000.0, 1930.0
MODULUS = YOUNG * TANGENT / (YOUNG - TANGENT)
ISOTROPIC = Hardening(YOUNG, 0.3, 181.0, isotropic=MODULUS)
KINEMATIC = Hardening(YOUNG, 0.3, 181.0, kinematic=MODULUS)
PAD = Elastic(1e-9 * YOUNG, 0.0)
LOADS = [
    Traction("right", (1.0, 0.0, 0.0), name="tension"),
    Traction("left", (-1.0, 0.0, 0.0), name="tension"),
    Traction("right", (0.0, 1.0, 0.0), name="shear"),
    Traction("left", (0.0, -1.0, 0.0), name="shear"),
    Traction("back", (1.0, 0.0, 0.0), name="shear"),
    Traction("front", (-1.0, 0.0, 0.0), name="shear"),
]
A, B, C = (
    {"tension": tension, "shear": shear}
    for tension, shear in ((151.2, 93.1), (257.2, 33.1), (259.3, 0.0))
)
AT_A = (0.014829713606886, 0.013601401082429)
AT_B = (0.035324711958965, 0.020351415903945)
GUIDE_B = (0.035265, 0.020471)
KINEMATIC_B = (0.040661299997639, 0.019780067836272)
KINEMATIC_C = (0.044151267768728, 0.019085331590312)
"""Reference values of ε_xx and ε_xy at C, with kinematic hardening."""
SAME_STEPS, MORE_STEPS = 1e-6, 1e-3
"""Largest relative differences of strains; the manual allows 1e-2."""


# %%
def _at(axis: int, place: int) -> Callable[[npt.NDArray[np.int64]], npt.NDArray[np.bool_]]:
    """Return a function that marks the grid points with a given index along one axis."""
    return lambda x: x[axis] == place


def cube_and_pad(comm: MPI.Intracomm) -> TaggedMesh:
    """Return a cube with a pad on its right side. Collective."""
    sides = {"left": (0, 0), "right": (0, 1), "front": (1, 0), "back": (1, 1), "below": (2, 0)}
    surfaces = [Surface(name, ("cube",), _at(*side)) for name, side in sides.items()]
    surfaces += [Surface(name, ("pad",), _at(0, i)) for i, name in enumerate(("glued", "end"), 1)]
    cube = Box("cube", (0, 0, 0), (1, 1, 1), (1, 1, 1))
    pad = Box("pad", (1, 0, 0), (2, 1, 1), (1, 1, 1))
    return structured_mesh(comm, [cube, pad], surfaces)


def strains(
    comm: MPI.Intracomm, material: Hardening, stages: Sequence[Stage]
) -> tuple[list[npt.NDArray[np.float64]], Problem, list[Level]]:
    """Return ε_xx and ε_xy at the end of each stage, the problem and its levels. Collective.

    The strains equal the works of unit loads on a cube of side 1.
    """
    supports = [Support("front", "y"), Support("below", "z"), Support("end", "x")]
    problem = Problem(
        cube_and_pad(comm),
        {"cube": Flow(material), "pad": PAD},
        supports,
        LOADS,
        contacts=[Tie("right", "glued")],
    )
    levels = list(stage_path(Newton(problem), LoadingHistory(problem, stages)))
    assert all(level.report.converged for level in levels)
    ends = np.cumsum([stage.steps for stage in stages]) - 1
    works = [levels[end].report.works for end in ends]
    found = [np.array([work["tension"], work["shear"] / 2]) for work in works]
    return found, problem, levels


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return strains with both kinds of hardening. Collective."""
    rows = []
    for case, material, stages, expected in (
        ("isotropic, 40 steps", ISOTROPIC, [Stage(A), Stage(B, 40)], {"A": AT_A, "B": AT_B}),
        ("isotropic, 640 steps", ISOTROPIC, [Stage(A), Stage(B, 640)], {"guide B": GUIDE_B}),
        (
            "kinematic, 30 + 30 steps",
            KINEMATIC,
            [Stage(A), Stage(B, 30), Stage(C, 30)],
            {"A": AT_A, "B": KINEMATIC_B, "C": KINEMATIC_C},
        ),
    ):
        if coarse and "guide B" in expected:
            continue
        began = time.perf_counter()
        found, problem, levels = strains(comm, material, stages)
        solves = sum(level.report.linear_solves for level in levels)
        seconds = time.perf_counter() - began
        for place, values in expected.items():
            allowed = MORE_STEPS if place.startswith("guide") else SAME_STEPS
            computed = found["ABC".index(place[-1])]
            for name, one, value in zip(("ε_xx", "ε_xy"), computed, values, strict=True):
                about = (case, f"{name} at {place}", "P1", 1.0, problem.num_dofs)
                rows.append(Row(*about, float(one), value, allowed, solves, seconds))
    scene, by = Scene(TITLE, LOADS), Prescribed.LOAD_FACTOR
    ResultWriter(folder, problem, scene, Newton.method, prescribed=by).write(levels[-1])
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
