# %% [markdown]
# # A thick sphere under inner pressure
#
# A spherical shell of inner radius a and outer radius b = 2a yields first at the inner surface.
# When the plastic zone extends to the radius c,
#
#     p = 2σ_y ln(c/a) + (2σ_y/3)(1 − c³/b³),
#     u(a) = σ_y (1 − ν) c³/(E a²) − (1 − 2ν) p a/E,
#
# and at c = b the shell is completely plastic. Then p = 2σ_y ln(b/a), which is 332.7 for σ_y = 240,
# at any larger deformation (R. Hill, The Mathematical Theory of Plasticity, Oxford 1950, chapter
# V). The demo solves an octant for prescribed work α = L(u) = (4πa²/8) u(a), before and after first
# yield and on the plateau, and compares the whole curve ζ(α). A sphere that is divided at a radius
# of 1.4a into two shells in frictionless contact has the same solution. This case tests contact on
# a curved surface.
#
# Plastic flow preserves volume at every point at which the constitutive law is evaluated. A mesh
# has five to six linear tetrahedra for each node, and cannot flow at all: ζ increases without
# limit. A mesh of quadratic tetrahedra has about as many conditions as unknowns, and its limit
# loads are slightly too large.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/thick_sphere.py

# %%
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from demos.verification.study import Row, collapse, mesh, run
from meshes.thick_sphere import INNER, OUTER, write_thick_sphere
from perfplast_fenicsx import (
    Contact,
    Level,
    Pressure,
    Problem,
    Support,
    VonMises,
    WorkNewton,
    interpolation_points,
    load_path,
)
from perfplast_fenicsx.io import OutputFields, ResultFolder, Scene
from perfplast_fenicsx.materials import deviator
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Integral

TITLE = "Thick sphere"
MATERIAL = VonMises(young=210e3, poisson=0.3, yield_stress=240.0)
EXACT = 2 * MATERIAL.yield_stress * math.log(OUTER / INNER)
INTERFACE = 1.4
LOADS = [Pressure("inner", 1.0)]
SUPPORTS = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]
CONTACTS = [Contact("inner_shell_seam", "outer_shell_seam")]
RADII = 7
"""Number of plastic radii at which points of the curve are computed."""

Floats = npt.NDArray[np.float64]
Points = list[tuple[float, float]]
"""Points (α, ζ) of a curve."""


# %% [markdown]
# ## The closed form


# %%
def exact_point(c: float) -> tuple[float, float]:
    """Return α for the octant, and ζ, at the plastic radius c."""
    a, b, yield_stress = INNER, OUTER, MATERIAL.yield_stress
    E, nu = MATERIAL.young, MATERIAL.poisson
    p = 2 * yield_stress * math.log(c / a) + 2 / 3 * yield_stress * (1 - (c / b) ** 3)
    u = yield_stress * (1 - nu) * c**3 / (E * a**2) - (1 - 2 * nu) * p * a / E
    return 4 * math.pi * a**2 / 8 * u, p


def exact_points(radii: int) -> Points:
    """Return points at half of first yield, from first to full yield, and on the plateau."""
    curve = [exact_point(float(c)) for c in np.linspace(INNER, OUTER, radii)]
    (first, yielding), (last, limit) = curve[0], curve[-1]
    return [(first / 2, yielding / 2), *curve, (1.5 * last, limit), (2 * last, limit)]


# %% [markdown]
# ## Solve
#
# At collapse, quadratic tetrahedra yield gradually. After full plasticity ζ still increases by 0.1
# to 0.3 % on these meshes until the work is a thousand times as large. The demo does not follow the
# divided shell as far. The corner nodes of a quadratic face carry almost no part of a uniform
# pressure, so the solver needs hundreds of linear systems to determine which of these nodes are in
# contact.


# %%
def curve(problem: Problem) -> tuple[list[Level], int]:
    """Return levels at the works of the exact points, and the number of linear solves.

    Collective.
    """
    solver = WorkNewton(problem)
    levels = list(load_path(solver, [alpha for alpha, _ in exact_points(RADII)]))
    return [level for level in levels if level.report.converged], solver.linear.solves


def largest_error(levels: Sequence[Level]) -> float:
    """Return the largest relative error of ζ; nan if a point was not solved."""
    exact = [zeta for _, zeta in exact_points(RADII)]
    if len(levels) < len(exact):
        return math.nan
    return max(abs(lv.state.zeta / zeta - 1) for lv, zeta in zip(levels, exact, strict=True))


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for curves and limit loads of undivided and divided shells. Collective."""
    linear = {0.4: None, 0.2: None}
    quadratic = {0.5: 2.5e-2, 0.35: 1e-2} if coarse else {0.35: 1e-2, 0.25: 5e-3, 0.15: 2e-3}
    rows: list[Row] = []
    curves: dict[str, Points] = {}
    for case, interface, degree, sizes in (
        ("thick sphere", None, 1, linear),
        ("thick sphere", None, 2, quadratic),
        ("sphere in a sphere", INTERFACE, 2, quadratic),
    ):
        limits, whole, seams = [], [], []
        element = "P1" if degree == 1 else "P2, curved"
        for size, allowed in sizes.items():
            write = write_thick_sphere
            tagged_mesh = mesh(folder, write, size=size, order=degree, interface=interface)
            materials = dict.fromkeys(tagged_mesh.volumes, MATERIAL)
            contacts = CONTACTS if interface else []
            problem = Problem(tagged_mesh, materials, SUPPORTS, LOADS, contacts, degree=degree)
            began = time.perf_counter()
            levels, solves = curve(problem)
            error = largest_error(levels)
            about = (case, element, size, problem.num_dofs, allowed)
            whole.append(row("largest error of ζ(α)", about, error, 0.0, solves, began))
            if interface:
                began = time.perf_counter()
                pressure = seam_pressure(problem, levels[-1])
                exact = 2 * MATERIAL.yield_stress * math.log(OUTER / interface)
                seams.append(row("mean seam pressure", about, pressure, exact, 0, began))
            began = time.perf_counter()
            found = collapse(problem, rtol=1e-3 if interface else 1e-4)
            limit = row("limit load", about, found.zeta, EXACT, found.solves, began)
            factorisations = found.limit.factorisations
            limits.append(replace(limit, factorisations=factorisations, bracket=found.bracket))
        if degree == 2:
            for of_meshes in (whole, seams, limits):
                assert all(abs(b.error) < abs(a.error) for a, b in pairwise(of_meshes))
        rows += whole + seams + limits
        label = f"{case}, {element}, {problem.num_dofs} unknowns"
        curves[label] = [(level.state.alpha, level.state.zeta) for level in levels]
    found.write(folder, Scene(f"{TITLE}, divided", LOADS, contacts))
    draw(folder)
    profile = equivalent_stress(problem, levels[HALF])
    folder.on_root(lambda: draw_curves(curves, profile, folder.file("curve.png")))
    return rows


def seam_pressure(problem: Problem, level: Level) -> float:
    """Return the mean contact pressure. Collective."""
    tagged_mesh = problem.tagged_mesh
    pressure = OutputFields(problem).update(level)["contact_pressure"]
    ds = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
    seam = ds(tagged_mesh.surfaces[CONTACTS[0].primary])
    one = fem.Constant(tagged_mesh.mesh, default_scalar_type(1))
    force, area = Integral(problem.comm, pressure * seam), Integral(problem.comm, one * seam)
    return force() / area()


def row(
    quantity: str,
    about: tuple[str, str, float, int, float | None],
    computed: float,
    exact: float,
    solves: int,
    began: float,
) -> Row:
    """Return a row of the table, with the time since ``began``."""
    case, element, size, dofs, allowed = about
    return Row(
        case=case,
        quantity=quantity,
        element=element,
        size=size,
        dofs=dofs,
        computed=computed,
        exact=exact,
        allowed=allowed,
        solves=solves,
        seconds=time.perf_counter() - began,
    )


# %% [markdown]
# ## The picture
#
# The left part shows the curves. The right part shows, for one level, the equivalent stress σ_θ −
# σ_r at all quadrature points. The exact stress is σ_y for r ≤ c, and σ_y (c/r)³ for larger r.

# %%
HALF = 3
"""Index of the level whose stress is drawn; c = 4/3 a at this level."""


def equivalent_stress(problem: Problem, level: Level) -> Floats:
    """Return radius and equivalent stress at each point, shape (n, 2), on rank 0. Collective."""
    mesh = problem.tagged_mesh.mesh
    points = interpolation_points(problem.Q.element)
    radius = fem.Expression(ufl.sqrt(ufl.dot(*[ufl.SpatialCoordinate(mesh)] * 2)), points)
    d = deviator(level.stress)
    stress = fem.Expression(ufl.sqrt(1.5 * ufl.dot(d, d)), points)
    values = [fem.Function(problem.Q) for _ in range(2)]
    for function, expression in zip(values, (radius, stress), strict=True):
        function.interpolate(expression)
    found = problem.comm.gather(np.column_stack([function.x.array for function in values]))
    return np.concatenate(found) if found else np.zeros((0, 2))


def draw_curves(curves: dict[str, Points], profile: Floats, path: Path) -> None:
    """Draw computed points on the exact curves. Not collective."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 5.5), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    alpha, zeta = zip((0.0, 0.0), *exact_points(100)[1:], strict=True)
    left.plot(alpha, zeta, color="black", label="closed form")
    left.plot(*exact_point(INNER), "D", color="#e0a020", label="first yield", zorder=3)
    for (label, points), marker in zip(curves.items(), "x^o", strict=True):
        left.plot(*zip(*points, strict=True), marker, label=label, fillstyle="none", markersize=8)
    left.set(xlabel="work of the loads α", ylabel="inner pressure ζ", title=f"{TITLE}: ζ(α)")
    left.set(xlim=(0, 1.03 * alpha[-1]), ylim=(0, 1.3 * EXACT))

    c = float(np.linspace(INNER, OUTER, RADII)[HALF - 1])
    r = np.linspace(INNER, OUTER, 200)
    exact = MATERIAL.yield_stress * np.minimum(1, (c / r) ** 3)
    right.plot(*profile.T, ".", color="#3b6ea5", markersize=3, label=label)
    right.plot(r, exact, color="black", label="closed form")
    right.axvline(INTERFACE, color="#707070", linestyle=":", label="seam of the two shells")
    right.set(xlabel="radius", ylabel="equivalent stress", ylim=(0, 1.1 * MATERIAL.yield_stress))
    right.set_title(f"Stress with a plastic zone as far as c = {c:.3g}")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(loc="lower right" if axes is left else "lower left")
    figure.savefig(path)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
