"""Measure one load path and the unit E on the same mesh, on any number of ranks.

python3 -m benchmarks.case two_blocks --n 16 -o case.json      (benchmarks/run.py does this)
"""

import argparse
import gc
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from benchmarks.elastic import Elasticity, Unit
from benchmarks.platform_facts import libraries
from benchmarks.problems import MODELS, Model
from perfplast_fenicsx import (
    Iteration,
    Level,
    Newton,
    NewtonOptions,
    Problem,
    WorkNewton,
    load_path,
)
from perfplast_fenicsx.io.results.result_folder import peak_memory
from perfplast_fenicsx.profiling import PHASES, seconds
from perfplast_fenicsx.solvers.linear.linear_solver import DIRECT, MULTIGRID
from perfplast_fenicsx.solvers.newton_options import CONTACT_SOLVERS

SOLVERS = {"default": {}, "multigrid": MULTIGRID, "direct": DIRECT}

LEVEL_KEYS = (
    *("zeta", "alpha", "converged", "reason", "newton_iterations", "active_set_iterations"),
    *("linear_solves", "setups", "linear_iterations", "damping_min", "plastic_fraction"),
    *("active_contacts", "contact_pairs", "duality_gap", "seconds"),
)


class Run:
    """The measurement of one load path, with its clocks."""

    def __init__(self, comm: MPI.Intracomm, arguments: argparse.Namespace) -> None:
        """Store the communicator and the arguments, and start the clock; nothing is solved yet."""
        self.comm, self.arguments = comm, arguments
        self.model: Model = MODELS[arguments.model]
        self.first_step: float | None = None
        self._clock = time.perf_counter()

    def lap(self) -> float:
        """Return the seconds since the previous lap, after a barrier. Collective."""
        self.comm.Barrier()
        before, self._clock = self._clock, time.perf_counter()
        return self._clock - before

    def stepped(self, iteration: Iteration) -> None:
        """Store the time after the first Newton step; the solver calls this after each step."""
        if self.first_step is None:
            self.first_step = time.time()

    def warm_up(self) -> None:
        """Load the compiled forms by solving the smallest problem of this kind. Collective."""
        problem = self.model.problem(self.comm, self.model.smallest, self.arguments.degree)
        zeta = self.model.levels[0] / 2
        options = NewtonOptions(max_iterations=2, contact_solver=self.arguments.contact_solver)
        Newton(problem, options).solve(zeta)
        if self.arguments.units:
            self._elasticity(problem, self.model.smallest).measure()
        del problem
        gc.collect()
        PETSc.garbage_cleanup(self.comm)

    def measure(self) -> dict[str, Any]:
        """Measure E and the load path. Collective.

        Returns:
            A record for JSON; the same keys on every rank.
        """
        arguments = self.arguments
        for key, value in SOLVERS[arguments.solver].items():
            PETSc.Options()[f"perfplast_{key}"] = value
        self.lap()
        before = self._phases()
        problem = self.model.problem(self.comm, arguments.n, arguments.degree)
        parts = {"mesh and problem": self.lap()}
        units = self._units(problem, arguments.units and 1)
        self.lap()
        method = WorkNewton if arguments.works else Newton
        options = NewtonOptions(
            tolerance=arguments.tolerance, contact_solver=arguments.contact_solver
        )
        solver = method(problem, options)
        parts["solver"] = self.lap()
        values = arguments.works or arguments.levels or self.model.levels
        levels = list(load_path(solver, values, self.stepped))
        parts["path"] = self.lap()
        phases = {name: spent - before[name] for name, spent in self._phases().items()}
        memory = self.comm.allgather(peak_memory())
        traffic = self.comm.allgather(_traffic())
        units += self._units(problem, max(arguments.units - 1, 0))
        return {
            "model": arguments.model,
            "n": arguments.n,
            "degree": arguments.degree,
            "ranks": self.comm.size,
            "dofs": problem.num_dofs,
            "solver": solver.linear.name,
            "contact_solver": arguments.contact_solver,
            "libraries": libraries(),
            **_path_record(levels, parts, phases),
            **_unit_record(units, levels, parts["path"]),
            "peak_memory_mb": {"total": sum(memory), "largest": max(memory)},
            "ranks_detail": self._detail(problem, memory, traffic),
        }

    def _elasticity(self, problem: Problem, n: int) -> Elasticity:
        if self.model.glued is not None:
            problem = self.model.glued(self.comm, n, self.arguments.degree)
        return Elasticity(problem, self.model.material, self.model.elastic_supports)

    def _units(self, problem: Problem, count: int) -> list[Unit]:
        if not count:
            return []
        elasticity = self._elasticity(problem, self.arguments.n)
        return [elasticity.measure() for _ in range(count)]

    def _phases(self) -> dict[str, float]:
        """Return the seconds spent in each phase so far, averaged over the ranks. Collective."""
        spent = self.comm.allgather(seconds())
        return {name: sum(one[name] for one in spent) / self.comm.size for name in PHASES}

    def _detail(
        self, problem: Problem, memory: list[float], traffic: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """Return sizes, memory (MB) and numbers of messages of each rank. Collective."""
        index_map, block = problem.V.dofmap.index_map, problem.V.dofmap.index_map_bs
        mine = (
            index_map.size_local * block,
            index_map.num_ghosts * block,
            len(problem.constraints.host),
        )
        return [
            {
                "owned_dofs": owned,
                "ghost_dofs": ghosts,
                "pairs_hosted": pairs,
                "peak_memory_mb": peak,
                **sent,
            }
            for (owned, ghosts, pairs), peak, sent in zip(
                self.comm.allgather(mine), memory, traffic, strict=True
            )
        ]


def _traffic() -> dict[str, Any]:
    """Return PETSc's counts of messages, bytes and reductions on this rank, summed over phases.

    Reductions are also given for each phase.
    """
    events = {name: PETSc.Log.Event(f"perfplast {name}").getPerfInfo() for name in PHASES}
    keys = {"messages": "numMessages", "bytes": "messageLength", "reductions": "numReductions"}
    return {
        **{name: sum(event[key] for event in events.values()) for name, key in keys.items()},
        "reductions_by_phase": {name: event["numReductions"] for name, event in events.items()},
    }


def _path_record(
    levels: list[Level], parts: dict[str, float], phases: dict[str, float]
) -> dict[str, Any]:
    """Return the iterations on the path, summed over levels, and the seconds of each phase.

    Args:
        levels: Levels of the path.
        parts: Seconds for mesh and problem, solver, and path.
        phases: Seconds of each phase, averaged over the ranks.
    """
    reports = [level.report for level in levels]
    path_phases = {name: spent for name, spent in phases.items() if name != "contact set-up"}
    run = sum(parts.values())
    totals = {
        key: sum(getattr(report, key) for report in reports)
        for key in (
            *("newton_iterations", "active_set_iterations"),
            *("linear_solves", "linear_iterations", "setups"),
        )
    }
    return {
        "alpha": reports[-1].alpha,
        "converged": all(report.converged for report in reports),
        **totals,
        "active_set_changes": sum(map(_changes, levels)),
        "iterations_per_solve": totals["linear_iterations"] / max(totals["linear_solves"], 1),
        "levels": [{key: getattr(report, key) for key in LEVEL_KEYS} for report in reports],
        "seconds": {
            **parts,
            "run": run,
            "phases": {**phases, "rest": parts["path"] - sum(path_phases.values())},
        },
        "contact_share": phases["contact set-up"] / run,
    }


def _changes(level: Level) -> int:
    """Return the number of Newton steps after which the number of closed pairs changed."""
    counts = [iteration.active_contacts for iteration in level.iterations]
    return int(np.count_nonzero(np.diff(counts)))


def _unit_record(units: list[Unit], levels: list[Level], path: float) -> dict[str, Any]:
    """Return E, and the time of the path in E; an empty record if E was not measured."""
    if not units:
        return {}
    unit = statistics.median(one.seconds for one in units)
    steps = [max(level.report.newton_iterations, 1) for level in levels]
    return {
        "E": {"seconds": unit, "runs": [asdict(one) for one in units]},
        "E_path": path / unit,
        "E_per_newton_step": path / sum(steps) / unit,
        "E_per_newton_step_by_level": [
            level.report.seconds / count / unit for level, count in zip(levels, steps, strict=True)
        ],
    }


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the path that the command line describes, and write the record. Collective."""
    parser = argparse.ArgumentParser(description="One measured load path.")
    parser.add_argument("model", choices=MODELS)
    parser.add_argument("--n", type=int, required=True, help="cubes per unit length")
    parser.add_argument("--degree", type=int, default=1)
    parser.add_argument("--levels", type=float, nargs="+", help="instead of the model's own")
    parser.add_argument("--works", type=float, nargs="+", help="works α instead of loads (ALG3)")
    parser.add_argument("--solver", choices=SOLVERS, default="default")
    parser.add_argument("--contact-solver", choices=CONTACT_SOLVERS, default=CONTACT_SOLVERS[0])
    parser.add_argument("--tolerance", type=float, default=1e-8)
    parser.add_argument("--units", type=int, default=3, help="how often E is measured")
    parser.add_argument("--cold", action="store_true", help="without a run that warms up")
    parser.add_argument("--began", type=float, help="time of day when this run was started")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(argv)
    PETSc.Log.begin()
    PETSc.Options()["options_left"] = False
    run = Run(MPI.COMM_WORLD, arguments)
    if not arguments.cold:
        run.warm_up()
        run.first_step = None
    record = run.measure()
    if arguments.began and run.first_step:
        record["seconds"]["to_first_step"] = run.first_step - arguments.began
    if run.comm.rank == 0:
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
