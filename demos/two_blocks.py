# %% [markdown]
# # Two blocks in frictionless contact
#
# Two steel cantilevers lie on top of each other. A traction on the outer half of the upper block
# bends it down. The upper block slides on the lower block and deflects it too. At what load do the
# blocks yield, where do they yield, and how does the curve of load over work level off?
#
#                              ζ (0, 0, -1)
#                             ↓ ↓ ↓ ↓ ↓ ↓ ↓
#         ▒ ┌───────────────────────────────┐
#         ▒ │            upper              │   z = 1 … 2
#         ▒ ├───────────────────────────────┤   contact without friction
#         ▒ │            lower              │   z = 0 … 1
#         ▒ └───────────────────────────────┘
#           x = 0                           3   one unit thick
#
# For each load factor ζ the displacement u minimises
#
#     J_ζ(v) = Ψ(ε(v)) − ζ L(v)   over   K_h = {v : (v_a − v_b)·n ≤ g at every pair of nodes},
#
# where Ψ is the elastic–perfectly plastic potential (Hencky, von Mises), and L is the work of the
# loads at ζ = 1. The result is the curve of ζ over α = L(u).
#
# **Limits.** Strains are small; there is no friction and no unloading. The elements are quadratic,
# because linear tetrahedra lock: plastic flow preserves volume, and linear elements have few
# motions that preserve it. With one plastic hinge in each block, the blocks would carry ζ = 67
# (beam theory, plane stress) to 77 (plane strain). The values of α in the assertions at the end
# hold for this mesh. The bounds on the limit load hold for the bodies.
#
# Run it with `make demo`, or
#
#     ./fenicsx mpirun -n 2 python3 demos/two_blocks.py -o results/two_blocks

# %%
import argparse
import math
from collections.abc import Sequence

from mpi4py import MPI

from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Level,
    Newton,
    NewtonOptions,
    Problem,
    Support,
    Traction,
    Units,
    VonMises,
    adaptive_bounds,
    load_path,
    two_blocks,
)
from perfplast_fenicsx.cli import Terminal
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.limit_analysis import AdaptiveBounds
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.report import report_on

TITLE = "Two blocks in frictionless contact"

# %% [markdown]
# ## The problem
#
# Lengths are in mm and stresses in MPa. The steel is that of the square plate with a hole in E.
# Stein (ed.), *Error-Controlled Adaptive Finite Elements in Solid Mechanics*, 2003. The mesh
# defines the names of volumes and surfaces. It has `n` cubes per unit length, with six tetrahedra
# each.

# %%
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
SUPPORTS = [Support("left")]  # x = 0, all components
LOADS = [Traction("top", (0.0, 0.0, -1.0))]  # z = 2, x ≥ 3/2; times ζ
CONTACTS = [Contact("upper_bottom", "lower_top", gap=0.0)]

ZETAS = [20.0, 40.0, 50.0, 55.0, 60.0, 65.0, 70.0]


def blocks(comm: MPI.Intracomm, n: int) -> Problem:
    """Return the problem of two cantilevers, divided into cubes with edges 1/n. Collective."""
    materials = {"lower": STEEL, "upper": STEEL}
    return Problem(two_blocks(comm, n), materials, SUPPORTS, LOADS, CONTACTS, degree=2)


# %% [markdown]
# ## How the Newton iteration converges
#
# In each step ALG1 minimises a quadratic model of J_ζ over K_h, and moves by a fraction β ≤ 1 of
# the step to the minimum. The regularisation replaces the fraction ρ of the tangent by the elastic
# stiffness, and ρ decreases to zero. The order of convergence therefore tends to 2.


# %%
def orders(level: Level) -> list[float]:
    """Return the order of convergence in each step from the third step on."""
    d = [step.increment for step in level.iterations]
    steps = zip(d, d[1:], d[2:], strict=False)
    return [math.log(c / b) / math.log(b / a) for a, b, c in steps]


def convergence_table(level: Level) -> str:
    """Return the Newton steps of a level as a text table."""
    columns = ["", "", *(f"{order:.2f}" for order in orders(level))]
    rows = [
        f"{step.number:>4}  {step.increment:>9.1e}  {step.beta:>5.2f}  {step.rho:>7.0e}"
        f"  {step.active_contacts:>8}  {column:>5}".rstrip()
        for step, column in zip(level.iterations, columns, strict=False)
    ]
    return "\n".join(["step  increment   beta      rho  contacts  order", *rows])


# %% [markdown]
# ## At what load do the blocks collapse?
#
# The bounds hold for the bodies, not only for the mesh. A stress field that is in equilibrium
# everywhere and does not violate the yield condition bounds the limit load from below. A velocity
# field that preserves volume everywhere bounds it from above. The program refines the mesh where
# the two bounds differ until the bounds are 6 % apart. The first mesh is half as fine.


# %%
def bracket(comm: MPI.Intracomm, n: int, terminal: Terminal) -> AdaptiveBounds:
    """Return strict bounds on the limit load of the bodies. Collective."""
    terminal.say()
    most = Adaptation(until=0.06, cells=3000 if n == 4 else 100)
    found = adaptive_bounds(blocks(comm, n // 2), most, 1e-3, terminal.mesh, terminal.interior)
    terminal.clear()
    bounds = found.body
    terminal.say(f"\n{bounds.in_words()}")
    lower, upper = bounds.lower.value, bounds.upper.value
    assert bounds.strict
    assert lower is not None
    assert upper is not None
    assert lower < upper
    if n == 4:
        assert max(ZETAS) < lower
        assert upper < 1.06 * lower
    return found


# %% [markdown]
# ## Solve
#
# Each level starts from the previous level, and is written as soon as it is solved.
#
# The known values of α hold for this mesh; runs with ρ = 0, 1e-5 and 1e-3 agree with them to eleven
# digits.

# %%
KNOWN = {
    4: {50.0: 1.400638536100e-02, 60.0: 1.719470027708e-02, 70.0: 2.203792329764e-02},
    2: {50.0: 1.382239095356e-02, 60.0: 1.665326844389e-02, 70.0: 2.090842482912e-02},
}


def main(argv: Sequence[str] | None = None) -> None:
    """Load the blocks, write the results and check them. Collective."""
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("-o", "--output", default="results/two_blocks", help="will be replaced")
    parser.add_argument("--coarse", action="store_true", help="n = 2 instead of 4")
    arguments = parser.parse_args(argv)
    n = 2 if arguments.coarse else 4

    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, arguments.output, force=True)
    problem = blocks(comm, n)
    newton = Newton(problem, NewtonOptions(stopping="displacement", tolerance=1e-8))

    folder.create()
    scene = Scene(TITLE, LOADS, CONTACTS, units=Units(system="mm-N-MPa"))
    writer = ResultWriter(folder, problem, scene, newton.method, prescribed=newton.prescribes)
    terminal = Terminal(comm)
    terminal.header(TITLE, newton.method, problem)
    for level in load_path(newton, ZETAS, terminal.iteration):
        terminal.level(level.report)
        assert level.report.converged, level.report.reason
        writer.write(level)

    terminal.say(f"\nNewton steps at zeta = {level.report.zeta:g}:")
    terminal.say(convergence_table(level))

    found = bracket(comm, n, terminal)
    writer.write_limit(found.best.mesh, found.body, found, fields=False)  # on the adapted mesh
    with writer.results.timed("pictures"):
        draw(folder)
    writer.results.write()

    # %% [markdown]
    # ## Is it right?
    #
    # J_ζ(u) + S(σ), which is zero only for the solution, is zero apart from rounding. No node
    # penetrates the other body, and α has its known value.

    # %%
    for report in writer.results.reports:
        assert abs(report.duality_gap) < 1e-10
        assert report.max_penetration < 1e-12
        if known := KNOWN[n].get(report.zeta):
            assert math.isclose(report.alpha, known, rel_tol=1e-8), (report.zeta, report.alpha)
    if n == 4:
        assert max(orders(level)) > 1.7

    terminal.say("\nAll checks passed.")
    terminal.results(folder)
    terminal.say("Pictures: fields.png and path.png. Open fields.vtkhdf.series with ParaView.")
    terminal.say(f"The report, for any browser: {report_on(folder)}")


# %%
if __name__ == "__main__":
    main()
