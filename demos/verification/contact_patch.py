# %% [markdown]
# # The contact patch test
#
# One block lies on another without friction, under a uniform pressure on top. Only contact supports
# the upper block in the vertical direction; rollers support the symmetry planes and the base. The
# elastic constants of the blocks differ, and so does their lateral expansion. So the blocks slide
# on each other, and the stress is uniform. On unstructured meshes with matching nodes in the seam,
# the results are exact apart from rounding:
#
# - In 3D the vertical stress is −ζ, the work is α = ζA (H₁/E₁ + H₂/E₂), and the limit load is σ_y
#   (A: section, H: heights, all 1 here).
# - In plane strain E becomes E/(1 − ν²), and the out-of-plane stress −νζ is added. The block with
#   the smaller ν yields first, at σ_y/√(1 − ν + ν²); then ζ increases to its limit 2k = 2σ_y/√3.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/contact_patch.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from demos.verification.study import Row, collapse, mesh, run
from meshes.contact_patch import write_contact_patch
from perfplast_fenicsx import (
    Contact,
    Level,
    Newton,
    Pressure,
    Problem,
    Support,
    VonMises,
    WorkNewton,
)
from perfplast_fenicsx.io import OutputFields, ResultFolder, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Integral

TITLE = "Contact patch test"
YIELD_STRESS = 250.0
MATERIALS = {
    "lower": VonMises(young=210e3, poisson=0.3, yield_stress=YIELD_STRESS),
    "upper": VonMises(young=70e3, poisson=0.2, yield_stress=YIELD_STRESS),
}
LOADS = [Pressure("top", 1.0)]
CONTACTS = [Contact("lower_seam", "upper_seam")]
ELASTIC = 100.0
"""A load below first yield."""


# %% [markdown]
# ## The exact solution


# %%
@dataclass(frozen=True)
class Exact:
    """The exact solution for the blocks in 3D (dim 3) or in plane strain (dim 2)."""

    dim: int

    @property
    def name(self) -> str:
        """Return the name of the case."""
        return "patch, plane strain" if self.dim == 2 else "patch, space"

    @property
    def work(self) -> float:
        """Return α at the elastic load."""
        compliance = 0.0
        for material in MATERIALS.values():
            nu = material.poisson if self.dim == 2 else 0.0
            compliance += (1 - nu**2) / material.young
        return ELASTIC * compliance

    @property
    def first_yield(self) -> float:
        """Return ζ at first yield."""
        if self.dim == 3:
            return YIELD_STRESS
        ratios = [material.poisson for material in MATERIALS.values()]
        return min(YIELD_STRESS / math.sqrt(1 - nu + nu**2) for nu in ratios)

    @property
    def limit(self) -> float:
        """Return the limit load."""
        return YIELD_STRESS if self.dim == 3 else 2 * YIELD_STRESS / math.sqrt(3)

    @property
    def limit_allowed(self) -> float:
        """Return the allowed error of the limit load; in 2D ζ ends within 1e-4 of it."""
        return 1e-9 if self.dim == 3 else 1e-4

    def stress(self, poisson: float) -> list[float]:
        """Return the Mandel vector of the stress at the elastic load."""
        if self.dim == 3:
            return [0.0, 0.0, -ELASTIC, 0.0, 0.0, 0.0]
        return [0.0, -ELASTIC, -poisson * ELASTIC, 0.0]


# %% [markdown]
# ## Solve


# %%
def stress_error(problem: Problem, level: Level, exact: Exact) -> float:
    """Return the largest error of a stress component. Collective."""
    stress = level.stress.x.array.reshape(-1, len(exact.stress(0)))
    largest = 0.0
    for name, material in MATERIALS.items():
        points = problem.S.dofmap.list[problem.tagged_mesh.cells(name)].ravel()
        deviation = stress[points] - exact.stress(material.poisson)
        largest = max(largest, float(np.abs(deviation).max(initial=0)))
    return problem.comm.allreduce(largest, MPI.MAX)


def contact_forces(problem: Problem, level: Level) -> tuple[float, float]:
    """Return the contact force on the lower block, and the integral of the pressure. Collective."""
    recovery, tagged_mesh = OutputFields(problem), problem.tagged_mesh
    pressure: fem.Function = recovery.update(level)["contact_pressure"]
    ds = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
    seam = ds(tagged_mesh.surfaces[CONTACTS[0].primary])
    return -float(recovery.resultants[0, -1]), Integral(problem.comm, pressure * seam)()


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for elastic solution, first yield and limit load, in 3D and 2D. Collective."""
    size = 0.4 if coarse else 0.25
    rows: list[Row] = []
    for exact, degree in ((Exact(dim), degree) for dim in (2, 3) for degree in (1, 2)):
        tagged_mesh = mesh(folder, write_contact_patch, dim=exact.dim, size=size)
        sides = [Support("x0", "x"), Support("y0", "y")][: exact.dim - 1]
        supports = [*sides, Support("bottom", "xyz"[exact.dim - 1])]
        problem = Problem(tagged_mesh, MATERIALS, supports, LOADS, CONTACTS, degree=degree)
        row = partial(Row, exact.name, element=f"P{degree}", size=size, dofs=problem.num_dofs)

        began = time.perf_counter()
        newton = Newton(problem)
        level = newton.solve(ELASTIC)
        took = {"solves": newton.linear.solves, "seconds": time.perf_counter() - began}
        error = stress_error(problem, level, exact) / YIELD_STRESS
        resultant, integral = contact_forces(problem, level)
        numbers = [
            ("work of an elastic load", level.state.alpha, exact.work, 1e-9, took),
            ("stress, deviation / σ_y", error, 0.0, 1e-9, took),
            ("contact force", resultant, ELASTIC, 1e-9, took),
            ("contact pressure, ∫p", integral, ELASTIC, 1e-9, took),
        ]
        began = time.perf_counter()
        work = WorkNewton(problem)
        first = work.first_yield().zeta
        took = {"solves": work.linear.solves, "seconds": time.perf_counter() - began}
        numbers.append(("first yield", first, exact.first_yield, 1e-9, took))
        direct = collapse(problem)
        found = collapse(problem, method="path")
        took = {"solves": found.solves, "seconds": found.seconds}
        upper = math.nan if found.limit.upper is None else found.limit.upper
        numbers.append(("limit load", found.zeta, exact.limit, exact.limit_allowed, took))
        numbers.append(("limit load, upper bound", upper, exact.limit, 1e-9, took))
        rows += [
            row(
                quantity=quantity,
                computed=computed,
                exact=known,
                allowed=allowed,
                solves=int(took["solves"]),
                seconds=took["seconds"],
            )
            for quantity, computed, known, allowed, took in numbers
        ]
        without_path = direct.row(exact.name, size, exact.limit, 1e-4)
        rows.append(replace(without_path, quantity="limit load, without path"))
    found.write(folder, Scene(TITLE, LOADS, CONTACTS))
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
