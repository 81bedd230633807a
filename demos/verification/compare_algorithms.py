# %% [markdown]
# # Four algorithms for one problem
#
# Čermák, Haslinger and Sysala (*Numerical solution of perfect plastic problems with contact: Part
# I*, COMPLAS XII, 2013) describe four methods for perfectly plastic bodies in contact, and leave
# the comparison to a Part II. Here all four solve the same problem: two steel cantilevers lie on
# top of each other, and a pressure ζ acts on the outer half of the upper one.
#
# | | prescribed | found | each iteration solves |
# |---|---|---|---|
# | ALG1, `Newton` | load ζ | work α | a contact problem with a new tangent; damped |
# | ALG2, `AugmentedLagrangian` | load ζ | work α | a contact problem, always the elastic operator |
# | ALG3, `WorkNewton` | work α | load ζ | as ALG1, with prescribed L(δu); damped |
# | ALG4, `BorderedNewton` | work α | load ζ | as ALG3, without damping |
#
# Here α = L(u) is the work of the loads at ζ = 1 on the displacement. ζ(α) levels off at the limit
# load. Above the limit load ALG1 and ALG2 have no solution, whereas ALG3 and ALG4 have a solution
# for every α.
#
# **Limits.** The comparison has one mesh, one pair of bodies and one machine. The numbers of
# iterations and solves characterise the methods. The times hold only for this size, at which a
# factorisation is cheap. On large meshes a factorisation is expensive, and ALG2 then has the
# advantage that it needs only one set-up per active set. The limit load holds for this mesh. Linear
# tetrahedra lock in bending, so this load is several times the limit load of the continuum (about
# 75).
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/compare_algorithms.py

# %%
import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx import (
    Contact,
    Level,
    Newton,
    NewtonOptions,
    Problem,
    State,
    Support,
    Traction,
    VonMises,
    two_blocks,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import limit_load
from perfplast_fenicsx.problem import Prescribed
from perfplast_fenicsx.solvers import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BorderedNewton,
    LevelSolver,
    WorkNewton,
    extrapolate,
)

TITLE = "Four algorithms for two blocks in contact"

# %% [markdown]
# ## The problem
#
# Lengths are in mm, and stresses in MPa. There are `n` cubes per unit length, with six tetrahedra
# each.

# %%
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)


def blocks(comm: MPI.Intracomm, n: int) -> Problem:
    """Return the problem of two cantilevers. Collective."""
    return Problem(
        two_blocks(comm, n),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top")],
    )


# %% [markdown]
# ## Along the loading path
#
# The levels are fractions of the limit load ζ_lim of the mesh, which the demo first computes with
# prescribed work. ALG1 and ALG2 are given ζ. ALG3 and ALG4 are given the α that ALG1 found at this
# level, and must return the same ζ. ALG1 and ALG2 start each level from the previous one. ALG3 and
# ALG4 start from a linear extrapolation of the two previous levels, which already has the
# prescribed α. If a level fails, the step is halved, repeatedly if necessary; the cost of failures
# is counted.
#
# The Newton methods stop if ‖δu‖ is below 1e-8 ‖u‖; because convergence is quadratic, the error is
# then much smaller. ALG2 converges linearly, and stops if its residuals are below 1e-6.

# %%
SHARES = (0.15, 0.30, 0.45, 0.60, 0.75, 0.90, 0.98)
NEWTON = NewtonOptions(tolerance=1e-8, max_iterations=30)
UZAWA_TOLERANCE = 1e-6
NAMES = {
    "newton": "ALG1",
    "augmented-lagrangian": "ALG2",
    "work-newton": "ALG3",
    "bordered-newton": "ALG4",
}


@dataclass
class Row:
    """The cost of one load level by one method, including failed attempts."""

    method: str
    share: float
    level: Level
    steps: int = 0
    iterations: int = 0
    solves: int = 0
    setups: int = 0
    krylov: int = 0
    seconds: float = 0.0

    def add(self, level: Level) -> None:
        """Add the cost of an attempt."""
        report = level.report
        self.level = level
        self.steps += 1
        self.iterations += report.newton_iterations
        self.solves += report.linear_solves
        self.setups += report.setups
        self.krylov += report.linear_iterations
        self.seconds += report.seconds


def follow(solver: LevelSolver, values: Sequence[float], shares: Sequence[float]) -> list[Row]:
    """Solve the levels of the path by one method, and return their costs. Collective."""
    rows: list[Row] = []
    past: list[State | None] = [None, None]
    for share, value in zip(shares, values, strict=True):
        row: Row | None = None
        targets = [value]
        while targets:
            start = past[-1]
            if solver.prescribes is Prescribed.WORK:
                start = extrapolate(solver.problem, past[-2], past[-1], targets[-1])
            level = solver.solve(targets[-1], start)
            row = row or Row(NAMES[solver.method], share, level)
            row.add(level)
            assert row.steps < 40, f"{row.method} does not reach {value}: {level.report.reason}"
            if level.report.converged:
                past.append(level.state)
                targets.pop()
            else:
                last = past[-1]
                before = 0.0 if last is None else last.alpha
                targets.append((before + targets[-1]) / 2)
        assert row is not None
        rows.append(row)
    return rows


def path_table(rows: Sequence[Row]) -> str:
    """Return the rows of all methods as a text table."""
    head = (
        "share  method  steps  iterations  solves  set-ups  Krylov  seconds          zeta"
        "         alpha  duality gap"
    )
    lines = [head]
    for share in sorted({row.share for row in rows}):
        lines += [
            f"{row.share:>5.0%}  {row.method:>6}  {row.steps:>5}  {row.iterations:>10}"
            f"  {row.solves:>6}  {row.setups:>7}  {row.krylov:>6}  {row.seconds:>7.2f}"
            f"  {row.level.report.zeta:>12.7f}  {row.level.report.alpha:>12.9f}"
            f"  {row.level.report.duality_gap:>11.1e}"
            for row in rows
            if row.share == share
        ]
    lines.append("")
    for method in NAMES.values():
        own = [row for row in rows if row.method == method]
        lines.append(
            f"  all  {method:>6}  {sum(r.steps for r in own):>5}"
            f"  {sum(r.iterations for r in own):>10}  {sum(r.solves for r in own):>6}"
            f"  {sum(r.setups for r in own):>7}  {sum(r.krylov for r in own):>6}"
            f"  {sum(r.seconds for r in own):>7.2f}"
        )
    return "\n".join(lines)


# %% [markdown]
# ## The penalty of ALG2
#
# r is the only parameter of ALG2. Relative to the elastic moduli, the best r is below 1, and
# decreases as the plastic zone grows. The adaptive rule balances primal and dual residuals, and
# finds such an r. Anderson acceleration extrapolates from the last iterations. Here the mesh of the
# same blocks is coarser, and each solution starts from zero displacement.

# %%
PENALTIES: tuple[float | str, ...] = (0.1, 1.0, 10.0, "adaptive")
ACCELERATIONS = ("none", "anderson")
UZAWA_SHARES = (0.30, 0.60, 0.90, 0.98)


def penalty_table(
    problem: Problem, limit: float, shares: Sequence[float], cap: int
) -> dict[tuple[str, float | str], list[int]]:
    """Return iterations by acceleration and penalty; values above ``cap`` mean no convergence."""
    found: dict[tuple[str, float | str], list[int]] = {}
    for acceleration in ACCELERATIONS:
        for penalty in PENALTIES:
            options = AugmentedLagrangianOptions(
                penalty=penalty,  # type: ignore[arg-type]
                acceleration=acceleration,  # type: ignore[arg-type]
                tolerance=UZAWA_TOLERANCE,
                max_iterations=cap,
            )
            solver = AugmentedLagrangian(problem, options)
            levels = [solver.solve(share * limit) for share in shares]
            found[acceleration, penalty] = [
                level.report.newton_iterations if level.report.converged else cap + 1
                for level in levels
            ]
    return found


def penalty_text(
    found: dict[tuple[str, float | str], list[int]], shares: Sequence[float], cap: int
) -> str:
    """Return the numbers of iterations as a text table."""
    lines = ["acceleration         r" + "".join(f"{share:>8.0%}" for share in shares)]
    for (acceleration, penalty), counts in found.items():
        cells = "".join(f"{f'>{cap}' if n > cap else n:>8}" for n in counts)
        lines.append(f"{acceleration:>12}  {penalty:>8}{cells}")
    return "\n".join(lines)


# %% [markdown]
# ## The picture

# %%
STYLES = {
    "ALG1": {"color": "#3b6ea5", "marker": "o", "label": "ALG1 (ζ given, damped Newton)"},
    "ALG2": {"color": "#d07020", "marker": "s", "label": "ALG2 (ζ given, elastic operator)"},
    "ALG3": {"color": "#4a8a5a", "marker": "D", "label": "ALG3 (α given, damped Newton)"},
    "ALG4": {"color": "#7a5a96", "marker": "x", "label": "ALG4 (α given, undamped)"},
}
HUES = {0.1: "#9ac0e6", 1.0: "#3b6ea5", 10.0: "#1c3452", "adaptive": "#d62020"}


def draw(
    rows: Sequence[Row],
    limit: float,
    found: dict[tuple[str, float | str], list[int]],
    shares: Sequence[float],
    cap: int,
    path: Path,
) -> None:
    """Draw the comparison. Not collective."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 9.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(TITLE, fontsize=16, fontweight="bold")
    (curve, solves), (seconds, penalty) = figure.subplots(2, 2)
    for k, (method, style) in enumerate(STYLES.items()):
        own = [row for row in rows if row.method == method]
        percent = [100 * row.share for row in own]
        alphas = [row.level.report.alpha for row in own]
        zetas = [row.level.report.zeta for row in own]
        hollow = style | {"markersize": 15 - 3 * k, "linestyle": "none", "markeredgewidth": 1.6}
        if method != "ALG4":
            hollow["markerfacecolor"] = "none"
        curve.plot(alphas, zetas, **hollow)
        solves.plot(percent, [row.solves for row in own], **style)
        seconds.plot(percent, [row.seconds for row in own], **style)
    curve.axhline(limit, color="#d62020", linewidth=1)
    curve.annotate(
        f"limit load of this mesh {limit:.5g}",
        (0.02, limit),
        (0, 5),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        color="#d62020",
    )
    curve.set(
        title="One curve: all four find the same states",
        xlabel="work of the loads α",
        ylabel="load factor ζ",
        ylim=(0, 1.12 * limit),
        xscale="log",
    )
    curve.legend(
        handles=solves.get_lines(), loc="lower right", fontsize=10, title="outer to inner mark:"
    )
    at = "load level (% of the limit load)"
    solves.set(title="Linear systems solved for each level", xlabel=at, yscale="log")
    for row in rows:
        if row.steps > 1:
            solves.annotate(
                f"{row.method} failed:\n{row.steps} attempts",
                (100 * row.share, row.solves),
                (8, -6),
                textcoords="offset points",
                va="top",
            )
    seconds.set(title="Wall time of each level (s)", xlabel=at, yscale="log")
    for (acceleration, r), counts in found.items():
        plain = acceleration == "none"
        penalty.plot(
            [100 * share for share in shares],
            [n if n <= cap else math.nan for n in counts],
            color=HUES[r],
            linestyle="--" if plain else "-",
            marker="o",
            markersize=4,
            linewidth=2.5 if r == "adaptive" else 1.5,
            label=f"r = {r}" if not plain else None,
        )
    penalty.plot([], [], "--", color="#707070", label="without acceleration")
    penalty.axhline(cap, color="#707070", linewidth=1, linestyle=":")
    penalty.set(
        title=f"ALG2: iterations to {UZAWA_TOLERANCE:g} on a coarser mesh (at most {cap})",
        xlabel=at,
        yscale="log",
    )
    penalty.legend(fontsize=10)
    for axes in (curve, solves, seconds, penalty):
        axes.grid(alpha=0.3, which="both")
    figure.savefig(path)


# %% [markdown]
# ## Run it, and is it right?
#
# All methods agree in ζ and α at every level. J_ζ(u) + S(σ), which is zero only for the solution,
# is as small as the tolerances of the methods require. The limit loads are known numbers for these
# meshes.

# %%
LIMITS = {2: 328.7764, 4: 325.722, 8: 324.58}


def main(argv: Sequence[str] | None = None) -> None:
    """Compare the methods, print and draw the results, and check them. Collective."""
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("-o", "--output", default="results/compare_algorithms")
    parser.add_argument("-n", type=int, default=4, help="cubes per unit length (4)")
    parser.add_argument("--coarse", action="store_true", help="n = 2, few levels")
    arguments = parser.parse_args(argv)
    n = 2 if arguments.coarse else arguments.n
    path_shares = (0.3, 0.6, 0.9) if arguments.coarse else SHARES
    shares = (0.3, 0.6) if arguments.coarse else UZAWA_SHARES
    cap = 300 if arguments.coarse else 2000

    comm = MPI.COMM_WORLD
    folder = ResultFolder(comm, arguments.output, force=True)
    folder.on_root(lambda: folder.path.mkdir(parents=True, exist_ok=True))

    def say(text: str) -> None:
        if comm.rank == 0:
            print(text, flush=True)

    problem = blocks(comm, n)
    ranks = f"{comm.size} rank{'s' if comm.size > 1 else ''}"
    say(f"{TITLE}: {problem.num_dofs} dofs, {problem.num_pairs} contact pairs, {ranks}")
    found = limit_load(problem, 1e-3)
    assert found.estimate is not None, found.reason
    limit = found.estimate
    say(
        f"limit load of this mesh: above {found.lower:.6g}, estimate {limit:.6g}"
        f" ({found.linear_solves} linear solves)\n"
    )

    zetas = [share * limit for share in path_shares]
    rows = follow(Newton(problem, NEWTON), zetas, path_shares)
    alphas = [row.level.state.alpha for row in rows]
    uzawa = AugmentedLagrangianOptions(tolerance=UZAWA_TOLERANCE)
    rows += follow(AugmentedLagrangian(problem, uzawa), zetas, path_shares)
    rows += follow(WorkNewton(problem, NEWTON), alphas, path_shares)
    rows += follow(BorderedNewton(problem, NEWTON), alphas, path_shares)
    say(path_table(rows))

    coarser = blocks(comm, 2)
    coarser_limit = LIMITS[2]
    counts = penalty_table(coarser, coarser_limit, shares, cap)
    say(f"\nALG2, iterations to {UZAWA_TOLERANCE:g} at shares of the limit load, n = 2:")
    say(penalty_text(counts, shares, cap))

    picture = folder.file("compare_algorithms.png")
    folder.on_root(lambda: draw(rows, limit, counts, shares, cap, picture))

    if n in LIMITS:
        assert math.isclose(limit, LIMITS[n], rel_tol=1e-3), limit
    for row in rows:
        report = row.level.report
        i = path_shares.index(row.share)
        # ALG2 converges linearly at a rate q near 1: a last step ε leaves an error of ε/(1 − q). α
        # grows ever faster as ζ approaches the limit load, so errors in the forces cause growing
        # errors in α.
        j = max(i, 1)
        steepness = math.log(alphas[j] / alphas[j - 1]) / math.log(zetas[j] / zetas[j - 1])
        forces = 30 * UZAWA_TOLERANCE if row.method == "ALG2" else 1e-8
        assert math.isclose(report.zeta, zetas[i], rel_tol=1e-7), (row, zetas[i])
        assert math.isclose(report.alpha, alphas[i], rel_tol=forces * steepness), (row, steepness)
        assert abs(report.duality_gap) < forces * steepness, row
    for acceleration in ACCELERATIONS:
        for i in range(len(shares)):
            best = min(counts[acceleration, r][i] for r in PENALTIES if r != "adaptive")
            assert counts[acceleration, "adaptive"][i] <= 2 * best, (acceleration, shares[i])
    say(f"\nAll checks passed. The picture is {picture}.")


# %%
if __name__ == "__main__":
    main()
