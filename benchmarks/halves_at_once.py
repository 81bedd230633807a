"""Compare two ways to compute both bounds on two ranks, and print times and memory.

./fenicsx mpirun -n 2 python3 -m benchmarks.halves_at_once [--plane 0.25 0.12] [--space 2 3 4]

Either each rank computes one bound, or both ranks compute one bound after the other. ``--plane``
gives cell sizes of a strip footing in plane strain. ``--space`` gives values of n for two blocks in
3D with 36 n³ cells. After a first round that is not measured, the two ways alternate. The script
prints medians of wall times, and the peak memory of each rank after the first round, including the
memory of Python and the libraries.
"""

import argparse
import resource
import time
from importlib import import_module
from statistics import median

from mpi4py import MPI

from benchmarks.limit_cases import STEEL, footing
from demos.two_blocks import blocks
from perfplast_fenicsx import Problem, limit_bounds

COMM = MPI.COMM_WORLD


def seconds(problem: Problem, at_once: bool) -> float:
    """Return the wall time (s) for both bounds of a problem. Collective.

    Args:
        problem: The problem.
        at_once: Whether each rank computes one bound.
    """
    import_module(limit_bounds.__module__).pays = lambda *_: at_once  # type: ignore[attr-defined]
    COMM.barrier()
    began = time.perf_counter()
    limit_bounds(problem)
    COMM.barrier()
    return time.perf_counter() - began


def compare(name: str, problem: Problem, rounds: int) -> None:
    """Print the wall times of both ways, and the peak memory of each rank. Collective."""
    seconds(problem, at_once=True)
    taken = COMM.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)
    times = [[seconds(problem, at_once) for at_once in (True, False)] for _ in range(rounds)]
    once, after = (median(way) for way in zip(*times, strict=True))
    if COMM.rank == 0:
        print(f"{name}: {problem}")
        print(f"    at once {once:.2f} s, one after the other {after:.2f} s, {after / once:.2f}")
        print(f"    memory {taken} MB", flush=True)


def main() -> None:
    """Compare both ways for the problems that the command line selects. Collective."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plane", nargs="*", type=float, default=[0.25, 0.12, 0.06, 0.03])
    parser.add_argument("--space", nargs="*", type=int, default=[2, 3, 4, 5])
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    for size in arguments.plane:
        compare("footing", footing(STEEL, size), arguments.rounds)
    for n in arguments.space:
        compare("two blocks", blocks(COMM, n), arguments.rounds)


if __name__ == "__main__":
    main()
