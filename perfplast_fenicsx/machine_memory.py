"""Measure the memory of the machines on which the ranks run."""

import math
import os
from pathlib import Path

from mpi4py import MPI


def has_memory(comm: MPI.Intracomm, needed: float) -> tuple[bool, float, float]:
    """Return whether the machines have the memory that their ranks need, and both amounts.

    Collective.

    Args:
        comm: The ranks.
        needed: Memory that this rank needs (bytes).

    Returns:
        Whether each machine has as much memory as its ranks need; the memory that all ranks need
        (bytes); and the memory of all machines (bytes).
    """
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    has = physical_memory()
    fits = machine.allreduce(needed) <= has
    first = machine.rank == 0
    machine.Free()
    enough: bool = comm.allreduce(fits, MPI.LAND)
    return enough, comm.allreduce(needed), comm.allreduce(has if first else 0)


def physical_memory() -> int:
    """Return the memory of this machine (bytes)."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def spare_memory(comm: MPI.Intracomm) -> float:
    """Return the free memory of a machine divided by its number of ranks (MB). Collective.

    The result is the least value over all machines; ∞ if it is not known.
    """
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    spare, table = math.inf, Path("/proc/meminfo")
    if table.exists():
        sizes = dict(line.split(":") for line in table.read_text(encoding="ascii").splitlines())
        spare = int(sizes["MemAvailable"].split()[0]) / 1000 / machine.size
    machine.Free()
    return float(comm.allreduce(spare, MPI.MIN))
