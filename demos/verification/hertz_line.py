# %% [markdown]
# # Hertz: a cylinder pressed on a plane, and on another cylinder
#
# Long elastic cylinders that touch along a line transfer the load P′ (per unit length) through a
# strip of half-width b, in which the pressure distribution is half an ellipse (H. Hertz, 1881; K.
# L. Johnson, Contact Mechanics, Cambridge 1985, chapter 4):
#
#     b² = 4P′R/(πE*),   p(x) = p₀ √(1 − x²/b²),   p₀² = P′E*/(πR),
#
# where 1/R is the sum of the curvatures, and 1/E* the sum of (1 − ν²)/E, of both bodies; a rigid
# body contributes zero. Initially only the node on the axis is in contact; the contact area is an
# unknown of the problem. The program computes the gaps from the meshes. In the case with separate
# meshes, the elements of the lower cylinder are 2/3 as large. The nodes do not match, so this case
# uses mortar contact.
#
# The second moment of the pressure field gives the half-width: ∫p x² / ∫p = b²/4. Hertz's theory
# assumes half spaces. Here b is 0.06 times the radius of the cylinders, so the error of this
# assumption is far below 1 %.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/hertz_line.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from demos.verification.study import Row, mesh, run
from meshes.hertz_line import RADIUS, write_hertz_line
from perfplast_fenicsx import Contact, Elastic, Newton, Plane, Pressure, Problem, Support
from perfplast_fenicsx.io import OutputFields, ResultFolder

TITLE = "Hertz line contact"
STEEL, ALUMINIUM = Elastic(young=210e3, poisson=0.3), Elastic(young=70e3, poisson=0.33)
HALF_WIDTH = 0.06
ALLOWED = 0.03
FINER = 1.5
"""Ratio of the numbers of edges of the lower and the upper body on separate meshes."""


def contact_modulus(*bodies: Elastic) -> float:
    """Return E* of elastic bodies in contact."""
    return 1 / sum((1 - body.poisson**2) / body.young for body in bodies)


# %% [markdown]
# ## Measured quantities
#
# The pressure field is linear between the vertices of the contact surface. Its integral is exactly
# the contact force.


# %%
@dataclass(frozen=True)
class Pressures:
    """The contact pressure on a surface about the origin.

    Attributes:
        force: ∫p.
        spread: ∫p r² / ∫p, with r the distance from the z axis (in 2D, from x = 0).
        peak: Largest nodal value.
        r: Distance of the vertices, on rank 0.
        p: Pressure at the vertices, on rank 0.
    """

    force: float
    spread: float
    peak: float
    r: npt.NDArray[np.float64]
    p: npt.NDArray[np.float64]


def measure(problem: Problem, pressure: fem.Function, surface: str) -> Pressures:
    """Return the integrals and vertex values of the pressure on a surface. Collective."""
    tagged_mesh, comm, V = problem.tagged_mesh, problem.comm, pressure.function_space
    tag, sides = tagged_mesh.surfaces[surface], tagged_mesh.mesh.geometry.dim - 1
    ds = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)(tag)
    x = ufl.SpatialCoordinate(tagged_mesh.mesh)
    square = sum(x[i] ** 2 for i in range(sides))

    def integral(density: ufl.core.expr.Expr) -> float:
        return float(comm.allreduce(fem.assemble_scalar(fem.form(density * ds))))

    nodes = fem.locate_dofs_topological(V, sides, tagged_mesh.facets(surface))
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    r = np.linalg.norm(V.tabulate_dof_coordinates()[nodes, :sides], axis=1)
    found = comm.gather(np.column_stack([r, pressure.x.array[nodes]]))
    table = np.concatenate(found) if found else np.zeros((0, 2))
    force = integral(pressure)
    peak = comm.allreduce(float(pressure.x.array[nodes].max(initial=0)), MPI.MAX)
    return Pressures(force, integral(pressure * square) / force, peak, table[:, 0], table[:, 1])


# %% [markdown]
# ## The picture
#
# The picture shows the pressures at all vertices of the finest meshes, with Hertz's half ellipse.


# %%
def draw_pressures(
    folder: ResultFolder, found: dict[str, tuple[Pressures, float]], radius: float, title: str
) -> None:
    """Draw pressures, divided by Hertz's largest pressure, over the distance from the middle.

    Collective.

    Args:
        folder: Folder of the picture.
        found: Pressures and Hertz's largest pressure, by label.
        radius: Hertz's half-width or radius of the contact.
        title: Title of the picture.
    """

    def draw() -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7, 5), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        x = np.linspace(0, 1, 400)
        axes.plot(x, np.sqrt(1 - x**2), color="#202020", linewidth=1, label="Hertz")
        colours = ("#3b6ea5", "#d62020", "#4a8a5a", "#8a6d3b", "#7a5a96", "#e0a020")
        for (label, (pressures, peak)), mark, colour in zip(
            found.items(), "os^vDx", colours, strict=False
        ):
            near = pressures.r < 1.3 * radius
            x, y = pressures.r[near] / radius, pressures.p[near] / peak
            axes.plot(x, y, mark, color=colour, fillstyle="none", markersize=5, label=label)
        axes.set(xlabel="distance from the middle, relative to Hertz's contact")
        axes.set(ylabel="pressure, relative to Hertz's largest", title=title)
        axes.set_xlim(0, 1.3)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(folder.file("pressure.png"))

    folder.on_root(draw)


# %% [markdown]
# ## The cases
#
# A pressure on the middle plane y = R pushes a quarter of the cylinder down. The load is chosen to
# make Hertz's half-width 0.06 R.


# %%
def press(
    folder: ResultFolder, bodies: int, degree: int, size: float, finer: float | None = None
) -> tuple[list[Row], Pressures, float]:
    """Return rows for one mesh, its pressures, and Hertz's largest pressure. Collective."""
    materials = {"upper": STEEL, "lower": ALUMINIUM} if bodies == 2 else {"upper": STEEL}
    curvature, modulus = bodies / RADIUS, contact_modulus(*materials.values())
    load = math.pi * modulus * HALF_WIDTH**2 * curvature / 4
    peak = math.sqrt(load * modulus * curvature / math.pi)

    shape = {"contact_size": size, "bodies": bodies, "order": degree, "finer": finer}
    tagged_mesh = mesh(folder, write_hertz_line, **shape)
    problem = Problem(
        tagged_mesh,
        materials,
        [Support("x0", "x"), *([Support("bottom", "y")] if bodies == 2 else [])],
        [Pressure("top", load / (2 * RADIUS))],
        [Contact("upper_arc", "lower_arc")] if bodies == 2 else [],
        [Plane("upper_arc", point=(0.0, 0.0), normal=(0.0, 1.0))] if bodies == 1 else [],
        degree=degree,
    )
    began = time.perf_counter()
    level = Newton(problem).solve(1.0)
    seconds = time.perf_counter() - began
    fields = OutputFields(problem)
    found = measure(problem, fields.update(level)["contact_pressure"], "upper_arc")
    force = abs(float(fields.resultants[0, 1]))
    case = "cylinder on cylinder" if bodies == 2 else "cylinder on a plane"
    rows = [
        Row(
            case=f"{case}, apart" if finer else case,
            quantity=quantity,
            element=f"P{degree}",
            size=size,
            dofs=problem.num_dofs,
            computed=computed,
            exact=exact,
            allowed=allowed,
            solves=level.report.linear_solves,
            seconds=seconds,
        )
        for quantity, computed, exact, allowed in (
            ("half-width", 2 * math.sqrt(found.spread), HALF_WIDTH, ALLOWED),
            ("peak pressure", found.peak, peak, ALLOWED),
            ("contact force", force, load / 2, 1e-8),
        )
    ]
    return rows, found, peak


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for half-width, peak pressure and force of all cases. Collective."""
    table: list[Row] = []
    finest = {}
    cases: list[tuple[int, float | None]] = [(1, None), (2, None)]
    if not coarse:
        cases.append((2, FINER))
    for bodies, finer in cases:
        for degree in (1, 2):
            for parts in (8,) if coarse else (8, 16):
                rows, found, peak = press(folder, bodies, degree, HALF_WIDTH / parts, finer)
                table += rows
            finest[f"{rows[0].case}, P{degree}"] = found, peak
    draw_pressures(folder, finest, HALF_WIDTH, TITLE)
    return table


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
