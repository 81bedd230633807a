# %% [markdown]
# # Published contact: a roller and a rounded punch
#
# These are the first two of five contact benchmarks of NAFEMS (A. W. A. Konter, FENET-UNOTT-DLE-09,
# 2005), for elastic bodies and small displacements. [The page](../../docs/published.md) lists the
# sources and a verdict.
#
# - **Roller** of steel (210 GPa, diameter 100) on a block of aluminium (70 GPa, 200×200) in plane
#   strain, under a load of 35 kN per mm of length; SSNP154 of Code_Aster. Without friction the
#   reference values are those of Hertz: p₀ = 3585.37 MPa, half-width 6.21 mm.
# - **Punch** of steel, diameter and height 100, edge radius 10, on a foundation of aluminium,
#   diameter and height 200, under 100 MPa; SSNA122 of Code_Aster (V6.01.122). In Code_Aster, the
#   middle of the foundation's top moves down by 0.13073 mm (linear elements) or 0.13290 mm
#   (quadratic elements). The stresses σ_yy there are −91.10 and −93.63 MPa, extrapolated from the
#   elements. The difference between our displacement and the quadratic value must not exceed the
#   difference between these two values. The demo shows the pressure but does not check it. The
#   bottom of the foundation is held; if the sides were held too, the displacement would be smaller.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/published_contact.py

# %%
import math
import time
from collections.abc import Mapping, Sequence

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from demos.verification.hertz_line import measure
from demos.verification.study import Row, mesh, run, show
from meshes.roller_on_block import write_roller_on_block
from meshes.rounded_punch import write_rounded_punch
from perfplast_fenicsx import (
    Contact,
    Elastic,
    Level,
    Newton,
    Pressure,
    Problem,
    Support,
    Traction,
)
from perfplast_fenicsx.io import OutputFields, ResultFolder, Scene

TITLE = "Published contact"
STEEL, ALUMINIUM = Elastic(young=210e3, poisson=0.3), Elastic(young=70e3, poisson=0.3)
LINE_LOAD, PEAK, HALF_WIDTH = 35e3, 3585.37, 6.21
"""Published line load (N/mm) of the roller, and Hertz's pressure (MPa) and half-width (mm)."""

SUNK, PRESSED = (0.13073, 0.13290), 93.63
"""Published values in the middle of the punch: downward displacement (mm) with linear and quadratic
elements, and pressure (MPa) with quadratic elements."""


Numbers = tuple[float, float, float | None]
"""Computed value, published value, and largest relative difference."""


def rows(
    case: str,
    size: float,
    problem: Problem,
    level: Level,
    began: float,
    found: Mapping[str, Numbers],
) -> list[Row]:
    """Return a row for each quantity, with its computed, published and allowed numbers."""
    return [
        Row(
            case=case,
            quantity=quantity,
            element="P2, curved",
            size=size,
            dofs=problem.num_dofs,
            computed=computed,
            exact=exact,
            allowed=allowed,
            solves=level.report.linear_solves,
            seconds=time.perf_counter() - began,
        )
        for quantity, (computed, exact, allowed) in found.items()
    ]


# %% [markdown]
# ## The roller
#
# The model is half of the bodies. The force acts on a small arc at the top, because the
# displacement under a line force would be infinite.


# %%
def roller(folder: ResultFolder, size: float) -> list[Row]:
    """Return rows for pressure and width of the contact. Collective."""
    section = mesh(folder, write_roller_on_block, contact_size=size)
    held = [Support("x0", "x"), Support("bottom")]
    loads = [Traction("crown", (0.0, -LINE_LOAD / 2), total=True)]
    contacts = [Contact("roller_seam", "block_seam")]
    problem = Problem(
        section, {"roller": STEEL, "block": ALUMINIUM}, held, loads, contacts, degree=2
    )
    began = time.perf_counter()
    level = Newton(problem).solve(1.0)
    show(folder, problem, Scene("Roller on a block, SSNP154", loads, contacts), [level])
    fields = OutputFields(problem)
    pressures = measure(problem, fields.update(level)["contact_pressure"], "roller_seam")
    force = abs(float(fields.resultants[0, 1]))
    width = 2 * math.sqrt(pressures.spread)
    found = {
        "largest pressure": (pressures.peak, PEAK, 0.01),
        "half-width": (width, HALF_WIDTH, 0.01),
        "contact force": (force, LINE_LOAD / 2, 1e-8),
    }
    return rows("roller, SSNP154", size, problem, level, began, found)


# %% [markdown]
# ## The punch


# %%
def punch(folder: ResultFolder, size: float, sides: bool = False) -> list[Row]:
    """Return rows for displacement and pressure in the middle of the contact. Collective."""
    section = mesh(folder, write_rounded_punch, contact_size=size).turned()
    held = [Support("bottom"), *([Support("side")] if sides else [])]
    loads, contacts = [Pressure("top", 100.0)], [Contact("punch_seam", "foundation_seam")]
    problem = Problem(
        section, {"punch": STEEL, "foundation": ALUMINIUM}, held, loads, contacts, degree=2
    )
    began = time.perf_counter()
    level = Newton(problem).solve(1.0)
    fields = OutputFields(problem).update(level)
    pressures = measure(problem, fields["contact_pressure"], "foundation_seam")
    middle = problem.comm.bcast(
        float(pressures.p[np.argmin(pressures.r)]) if len(pressures.r) else 0.0
    )
    down = -_value_at_the_middle(problem, level)
    low, high = SUNK
    found = {
        "sunk in the middle": (down, high, None if sides else high / low - 1),
        "pressure in the middle": (middle, PRESSED, None),
    }
    name = "punch, SSNA122, sides held" if sides else "punch, SSNA122"
    return rows(name, size, problem, level, began, found)


def _value_at_the_middle(problem: Problem, level: Level) -> float:
    """Return the vertical displacement of the foundation's top on the axis. Collective."""
    V, tagged_mesh = problem.V, problem.tagged_mesh
    nodes = fem.locate_dofs_topological(V, 1, tagged_mesh.facets("foundation_seam"))
    owned = nodes[nodes < V.dofmap.index_map.size_local]
    at = V.tabulate_dof_coordinates()[owned]
    axis = owned[np.hypot(at[:, 0], at[:, 1]) < 1e-6]
    values = level.state.u.x.array.reshape(-1, 2)[axis, 1]
    return float(problem.comm.allreduce(float(values.sum())))


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for both problems on two meshes, or on one mesh in a quick run. Collective."""
    sizes = (0.5,) if coarse else (0.5, 0.25)
    table = [row for size in sizes for row in roller(folder, size)]
    table += [row for size in sizes for row in punch(folder, 2 * size)]
    return table + punch(folder, 2 * sizes[-1], sides=True)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
