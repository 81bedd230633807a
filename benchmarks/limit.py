"""Measure one search for a limit load and the unit E on the same mesh, on any number of ranks.

python3 -m benchmarks.limit bolted --n 2 --degree 2 -o limit.json      (benchmarks/run.py does this)
"""

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from benchmarks.elastic import Elasticity
from benchmarks.platform_facts import libraries
from benchmarks.problems import MODELS, Model
from perfplast_fenicsx import Problem, limit_load
from perfplast_fenicsx.io.results.result_folder import peak_memory


def measure(
    comm: MPI.Intracomm, name: str, n: int, degree: int, rtol: float, units: int
) -> dict[str, Any]:
    """Measure E, and then a search by the method that the program chooses. Collective.

    Returns:
        A record for JSON; the same keys on every rank.
    """
    model = MODELS[name]
    problem = model.problem(comm, n, degree)
    elasticity = _elasticity(comm, model, problem, n, degree)
    runs = [elasticity.measure() for _ in range(units)]
    comm.Barrier()
    began = time.perf_counter()
    limit = limit_load(problem, rtol)
    comm.Barrier()
    spent = time.perf_counter() - began
    memory = comm.allgather(peak_memory())
    unit = statistics.median(one.seconds for one in runs)
    return {
        "model": name,
        "n": n,
        "degree": degree,
        "ranks": comm.size,
        "dofs": problem.num_dofs,
        "method": limit.method,
        "libraries": libraries(),
        "converged": limit.levelled_off,
        "reason": limit.reason,
        "lower": limit.lower,
        "upper": limit.upper,
        "iterations": limit.iterations,
        "setups": limit.factorisations,
        "linear_solves": limit.linear_solves,
        "seconds": {"path": spent, "run": spent},
        "E": {"seconds": unit, "runs": [asdict(one) for one in runs]},
        "E_path": spent / unit,
        "peak_memory_mb": {"total": sum(memory), "largest": max(memory)},
    }


def _elasticity(
    comm: MPI.Intracomm, model: Model, problem: Problem, n: int, degree: int
) -> Elasticity:
    glued = problem if model.glued is None else model.glued(comm, n, degree)
    return Elasticity(glued, model.material, model.elastic_supports)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the search that the command line describes, and write the record. Collective."""
    parser = argparse.ArgumentParser(description="One measured search for a limit load.")
    parser.add_argument("model", choices=MODELS)
    parser.add_argument("--n", type=int, required=True, help="cubes per unit length")
    parser.add_argument("--degree", type=int, default=1)
    parser.add_argument("--rtol", type=float, default=1e-3, help="what the bounds may differ by")
    parser.add_argument("--units", type=int, default=3, help="how often E is measured")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(argv)
    PETSc.Options()["options_left"] = False
    comm, name = MPI.COMM_WORLD, arguments.model
    measure(comm, name, MODELS[name].smallest, arguments.degree, arguments.rtol, 1)  # compiles
    record = measure(
        comm, name, arguments.n, arguments.degree, arguments.rtol, max(arguments.units, 1)
    )
    if comm.rank == 0:
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
