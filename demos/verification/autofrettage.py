# %% [markdown]
# # Autofrettage: the residual stress after a pressure is removed
#
# A thick sphere with radii a and b = 2a is loaded until the plastic zone reaches the radius c. Then
#
#     p = 2σ_y ln(c/a) + (2σ_y/3)(1 − c³/b³),
#     u(r) = (σ_y/E)((1 − ν)c³/r² − (2/3)(1 − 2ν) r (1 + 3 ln(c/r) − c³/b³)),    r ≤ c,
#
# and u(b) = (σ_y/E)(1 − ν)c³/b². After unloading, the hoop stress at the bore is
#
#     σ_y − 3p b³/(2(b³ − a³))
#
# if p is at most twice the pressure at first yield (R. Hill, The Mathematical Theory of Plasticity,
# Oxford 1950, chapter V). A second cycle is then elastic, and ends where the first one ended. Two
# conditions give the plastic radius. Outside this radius, σ_eq is linear in 1/r³, and σ_eq = σ_y at
# the radius. Inside this radius, the accumulated plastic strain is linear in 1/r³, and vanishes at
# the radius. The demo fits a line to points on each side of the radius, and takes the mean of both
# results.
#
# A tube in plane strain with b = 3a has no closed form for the von Mises condition. Its reference
# numbers come from 800 quadratic elements along the radius and 16 steps.
#
# The step size matters where the direction of the stress changes. A hardening block, H = E/10, is
# compressed from above until it yields. Then it is pulled from the side while the first load is
# constant:
#
#     dε^p_z = (2σ_z − σ_x)/(2σ_e) dσ_e/H,    σ_e² = σ_z² − σ_z σ_x + σ_x².
#
# The error of the implicit Euler method is proportional to the step size.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/autofrettage.py

# %%
import math
import time
from collections.abc import Callable, Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from demos.verification.study import Row, mesh, run
from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Flow,
    Hardening,
    Level,
    LoadingHistory,
    Newton,
    Pressure,
    Problem,
    Stage,
    Support,
    VonMises,
    interpolation_points,
    stage_path,
)
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.materials import tensor
from perfplast_fenicsx.mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Autofrettage"
MATERIAL = VonMises(young=200e3, poisson=0.3, yield_stress=240.0)
LOADS = [Pressure("inner", 1.0, "bore"), Pressure("outer", 1.0, "outside")]
"""The second load has the factor 0; its work gives the displacement of the outer surface."""
C, OUTER_SPHERE, OUTER_TUBE = 1.3, 2.0, 3.0
TUBE_PRESSURE = 216.288835
TUBE = {"u(a)": 2.280689e-3, "u(b)": 9.465414e-4, "residual hoop stress": -210.0515}
LAYER = 0.15
"""The stress at the bore is extrapolated by a parabola through points within this distance."""
FRONT = 0.2
"""The plastic radius is the root of lines through points within this distance on each side."""

Floats = npt.NDArray[np.float64]


# %% [markdown]
# ## The closed form of the sphere


# %%
def sphere() -> dict[str, float]:
    """Return the exact values for the comparison, and the pressure."""
    a, b, Y = 1.0, OUTER_SPHERE, MATERIAL.yield_stress
    E, nu, k = MATERIAL.young, MATERIAL.poisson, (C / OUTER_SPHERE) ** 3
    p = 2 * Y * math.log(C / a) + 2 / 3 * Y * (1 - k)
    inner = (1 - nu) * C**3 / a**2 - 2 / 3 * (1 - 2 * nu) * a * (1 + 3 * math.log(C / a) - k)
    outer = (1 - nu) * C**3 / b**2
    residual = Y - 3 * p * b**3 / (2 * (b**3 - a**3))
    found = {"u(a)": Y / E * inner, "u(b)": Y / E * outer, "residual hoop stress": residual}
    return found | {"plastic radius": C, "pressure": p}


# %% [markdown]
# ## Two cycles


# %%
def hoop_at_bore(problem: Problem, stress: fem.Function) -> float:
    """Return the hoop stress at r = a: (tr σ − n·σn)/2 in 3D, t·σt in 2D. Collective."""
    gdim = problem.tagged_mesh.mesh.geometry.dim
    x = ufl.SpatialCoordinate(problem.tagged_mesh.mesh)
    r = ufl.sqrt(ufl.dot(x, x))
    n = ufl.as_vector([*(x[i] / r for i in range(gdim)), *[0] * (3 - gdim)])
    s = tensor(stress)
    across = ufl.dot(n, ufl.dot(s, n))
    whole = ufl.tr(s) if gdim == 3 else s[0, 0] + s[1, 1]
    values = []
    for quantity in (r, (whole - across) / (gdim - 1)):
        at_points = fem.Function(problem.Q)
        points = interpolation_points(problem.Q.element)
        at_points.interpolate(fem.Expression(quantity, points))
        owned = problem.Q.dofmap.index_map.size_local
        values.append(at_points.x.array[:owned])
    radius, hoop = values
    near = radius < 1 + LAYER
    powers = np.vander(radius[near] - 1, 3)
    sums = np.column_stack([powers.T @ powers, powers.T @ hoop[near]])
    sums = problem.comm.allreduce(sums)
    return float(np.linalg.solve(sums[:, :3], sums[:, 3])[2])


def plastic_radius(problem: Problem, level: Level, near: float) -> float:
    """Return the plastic radius of a spherical body, which lies near ``near``. Collective."""
    x = ufl.SpatialCoordinate(problem.tagged_mesh.mesh)
    power, ratio = fem.Function(problem.Q), fem.Function(problem.Q)
    dev = ufl.dev(tensor(level.stress))
    yields = ufl.sqrt(1.5 * ufl.inner(dev, dev)) / MATERIAL.yield_stress
    points = interpolation_points(problem.Q.element)
    for function, value in ((power, ufl.dot(x, x) ** -1.5), (ratio, yields)):
        function.interpolate(fem.Expression(value, points))
    owned = problem.Q.dofmap.index_map.size_local
    flow = level.state.history["accumulated_plastic_strain"].x.array[:owned]
    x3, stress = power.x.array[:owned], ratio.x.array[:owned]
    inside = (flow > 0) & (x3 < (near - FRONT) ** -3)
    outside = (flow == 0) & (x3 > (near + FRONT) ** -3)
    radii = []
    for where, value, end in ((inside, flow, 0.0), (outside, stress, 1.0)):
        powers = np.vander(x3[where], 2)
        sums = np.column_stack([powers.T @ powers, powers.T @ (value[where] - end)])
        sums = problem.comm.allreduce(sums)
        slope, offset = np.linalg.solve(sums[:, :2], sums[:, 2])
        radii.append((-offset / slope) ** (-1 / 3))
    return float(np.mean(radii))


def cycles(problem: Problem, pressure: float, steps: int) -> list[Level]:
    """Return the last levels of loading, unloading, reloading and unloading; raise if one fails."""
    on, off = {"bore": pressure, "outside": 0.0}, {"bore": 0.0}
    stages = [Stage(on, steps), Stage(off, 2), Stage(on, 2), Stage(off, 2)]
    levels = list(stage_path(Newton(problem), LoadingHistory(problem, stages)))
    assert all(level.report.converged for level in levels)
    return [levels[i] for i in np.cumsum([stage.steps for stage in stages]) - 1]


def vessel(problem: Problem, ends: Sequence[Level], outer: float) -> dict[str, float]:
    """Return stresses and displacements after two cycles. Collective."""
    gdim = problem.tagged_mesh.mesh.geometry.dim
    first, again = (
        {name: abs(work) for name, work in ends[i].report.works.items()} for i in (0, 2)
    )
    area = math.pi / 2  # area of the bore: an eighth of a sphere, or a quarter of a circle
    around = (1 + ends[0].report.plastic_fraction * (outer**gdim - 1)) ** (1 / gdim)
    residual = [hoop_at_bore(problem, ends[i].stress) for i in (1, 3)]
    return {
        "u(a)": first["bore"] / area,
        "u(b)": first["outside"] / (area * outer ** (gdim - 1)),
        "residual hoop stress": residual[0],
        "plastic radius": plastic_radius(problem, ends[0], around) if gdim == 3 else math.nan,
        "second cycle, u(a)": again["bore"] / first["bore"] - 1,
        "second cycle, stress": residual[1] / residual[0] - 1,
        "solves": sum(end.report.linear_solves for end in ends),
    }


# %% [markdown]
# ## A path with a change of direction


# %%
HARD = Hardening(200e3, 0.3, 240.0, isotropic=20e3)
SIDEWAYS = 200.0


def _at(axis: int, place: int) -> Callable[[npt.NDArray[np.int64]], npt.NDArray[np.bool_]]:
    """Return a function that marks the grid points with a given index along one axis."""
    return lambda x: x[axis] == place


def block_strain(comm: MPI.Intracomm, steps: int) -> tuple[float, int, int]:
    """Return the final plastic strain along z, the unknowns and the linear solves. Collective."""
    sides = {"x0": (0, 0), "x1": (0, 1), "y0": (1, 0), "z0": (2, 0), "z1": (2, 1)}
    surfaces = [Surface(name, ("block",), _at(*side)) for name, side in sides.items()]
    block = structured_mesh(comm, [Box("block", (0, 0, 0), (1, 1, 1), (1, 1, 1))], surfaces)
    supports = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]
    loads = [Pressure("z1", 1.0), Pressure("x1", -1.0)]
    problem = Problem(block, {"block": Flow(HARD)}, supports, loads)
    stages = [Stage({"z1": HARD.yield_stress}), Stage({"x1": SIDEWAYS}, steps)]
    levels = list(stage_path(Newton(problem), LoadingHistory(problem, stages)))
    assert all(level.report.converged for level in levels)
    strain = levels[-1].state.history["plastic_strain"].x.array.reshape(-1, 6)[:, 2]
    solves = sum(level.report.linear_solves for level in levels)
    return comm.allreduce(float(strain.min(initial=0)), MPI.MIN), problem.num_dofs, solves


def exact_strain() -> float:
    """Return the final plastic strain along z in the limit of small steps, by Gauss quadrature."""
    points, weights = np.polynomial.legendre.leggauss(40)
    x, z = SIDEWAYS * (points + 1) / 2, -HARD.yield_stress
    equivalent2 = z**2 - z * x + x**2
    rate = (2 * z - x) * (2 * x - z) / (4 * equivalent2 * HARD.isotropic)
    return float(rate @ weights * SIDEWAYS / 2)


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return residual stresses of sphere and tube, and the error of load steps. Collective."""
    exact = sphere()
    allowed = {"u(a)": 2e-3, "u(b)": 2e-3, "residual hoop stress": 5e-3, "plastic radius": 2e-3}
    same = dict.fromkeys(("second cycle, u(a)", "second cycle, stress"), 0.0)
    allowed |= dict.fromkeys(same, 1e-8)
    planes = [Support("x0", "x"), Support("y0", "y")]
    rows = []
    for case, write, sizes, outer, expected, pressure, steps in (
        ("sphere", write_thick_sphere, (0.5, 0.3, 0.15), OUTER_SPHERE, exact, exact["pressure"], 4),
        ("tube", write_thick_tube, (0.2, 0.1, 0.05), OUTER_TUBE, TUBE, TUBE_PRESSURE, 16),
    ):
        for size in sizes[:1] if coarse else sizes[1:]:
            arguments = {"size": size, "order": 2} | ({"outer": outer} if case == "tube" else {})
            tagged_mesh = mesh(folder, write, **arguments)
            held = planes if case == "tube" else [*planes, Support("z0", "z")]
            materials = dict.fromkeys(tagged_mesh.volumes, Flow(MATERIAL))
            problem = Problem(tagged_mesh, materials, held, LOADS, degree=2)
            began = time.perf_counter()
            ends = cycles(problem, pressure, 4 if coarse else steps)
            found = vessel(problem, ends, outer)
            seconds = time.perf_counter() - began
            for name, value in (expected | same).items():
                if name != "pressure":
                    about = (case, name, "P2, curved", size, problem.num_dofs, found[name], value)
                    tight = size == sizes[-1] or name in same
                    limit = allowed[name] if tight else None
                    rows.append(Row(*about, limit, int(found["solves"]), seconds))
    scene, by = Scene(TITLE, LOADS), Prescribed.LOAD_FACTOR
    writer = ResultWriter(folder, problem, scene, Newton.method, prescribed=by)
    for level in ends[:2]:
        writer.write(level)
    draw(folder)
    for steps in (4, 8) if coarse else (4, 8, 16, 32, 64, 128):
        began = time.perf_counter()
        strain, dofs, solves = block_strain(comm, steps)
        seconds, limit = time.perf_counter() - began, 0.1 / steps
        turning = ("block, path that turns", "plastic strain", "P1", 1 / steps, dofs)
        rows.append(Row(*turning, strain, exact_strain(), limit, solves, seconds))
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
