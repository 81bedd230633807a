"""Measure the additional cost of a constant load, a prescribed motion and a history.

python3 -m benchmarks.terms --n 2 --degree 2 -o terms.json      (benchmarks/run.py does this)

One level has these three terms, the other level has none. Both levels start and end at the same
load factors, and are solved alternately several times. The script measures processor time, on which
other work on the machine has little effect.
"""

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from benchmarks.platform_facts import libraries
from benchmarks.problems import MODELS, STEEL
from perfplast_fenicsx import BodyForce, Flow, Level, Newton, Problem, State

FROM, TO = 0.4, 0.7
"""Load factors at the start and at the end of a level; the factor 1 is a traction of 200."""

WEIGHT = BodyForce("plate", (0.0, -0.1, 0.0), constant=True)
SQUEEZE = -1e-5
"""Prescribed change of the plate's thickness, which is 1: a hundredth of the yield strain."""


def with_terms(plain: Problem) -> Problem:
    """Return the plate with a weight, a prescribed thickness change and a history. Collective."""
    given = plain.given
    supports = [
        replace(support, value=SQUEEZE) if support.on == "z1" else support
        for support in given.supports
    ]
    materials = {name: Flow(STEEL) for name in given.materials}
    loads = [*given.loads, WEIGHT]
    return Problem(plain.tagged_mesh, materials, supports, loads, degree=plain.degree)


def measure(comm: MPI.Intracomm, n: int, degree: int, repeats: int) -> dict[str, Any]:
    """Measure both levels alternately, ``repeats`` times. Collective.

    Returns:
        A record for JSON; the same keys on every rank.
    """
    without = MODELS["l_plate"].problem(comm, n, degree)
    both = (without, with_terms(without))
    solvers = [Newton(problem) for problem in both]
    starts = [solver.solve(FROM).state for solver in solvers]
    spent: tuple[list[float], list[float]] = ([], [])
    levels: list[Level] = []
    for _ in range(repeats):
        for solver, start, seconds in zip(solvers, starts, spent, strict=True):
            level, taken = _timed(comm, solver, start)
            seconds.append(taken)
            levels.append(level)
    reports = [level.report for level in levels[-2:]]
    ratios = [terms / plain for plain, terms in zip(*spent, strict=True)]
    plain, terms = (statistics.median(seconds) for seconds in spent)
    return {
        "model": "l_plate",
        "n": n,
        "degree": degree,
        "ranks": comm.size,
        "dofs": without.num_dofs,
        "libraries": libraries(),
        "converged": all(report.converged for report in reports),
        "newton_iterations": reports[1].newton_iterations,
        "newton_iterations_without": reports[0].newton_iterations,
        "linear_iterations": reports[1].linear_iterations,
        "setups": reports[1].setups,
        "seconds": {"path": terms, "run": terms, "without": plain},
        "ratio": statistics.median(ratios),
        "ratios": ratios,
    }


def _timed(comm: MPI.Intracomm, solver: Newton, start: State) -> tuple[Level, float]:
    """Return a solved level, and its processor time (s), summed over ranks. Collective."""
    comm.Barrier()
    began = time.process_time()
    level = solver.solve(TO, start)
    return level, comm.allreduce(time.process_time() - began)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure both levels of the plate, and write the record. Collective."""
    parser = argparse.ArgumentParser(description="A level with all terms beside one without.")
    parser.add_argument("--n", type=int, required=True, help="cubes per unit length")
    parser.add_argument("--degree", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5, help="how often each is solved")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(argv)
    PETSc.Options()["options_left"] = False
    comm = MPI.COMM_WORLD
    measure(comm, MODELS["l_plate"].smallest, arguments.degree, 1)  # compiles the forms
    record = measure(comm, arguments.n, arguments.degree, max(arguments.repeats, 1))
    if comm.rank == 0:
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
