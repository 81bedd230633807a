"""Ranks that work by themselves, and meet where one of them has something to report."""

from collections.abc import Callable

from mpi4py import MPI

from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep
from perfplast_fenicsx.solvers.linear.mumps_memory import TooLarge


class Meeting:
    """All ranks meet after each step of any; those that have ended their work wait."""

    def __init__(self, comm: MPI.Intracomm, monitor: Callable[[InteriorStep], None] | None) -> None:
        """Begin meetings of these ranks.

        Args:
            comm: The ranks.
            monitor: Called on every rank after each step of any.
        """
        self._comm, self._monitor = comm, monitor
        self.monitor = None if monitor is None else self._tell
        """Called on its own after each step of a rank; other ranks know of it when they meet."""

    def after(self, work: Callable[[], None]) -> bool:
        """Do this rank's work, which calls no other, and wait for that of all. Collective.

        Returns:
            Whether it is done; not where that of any rank does not fit into memory.

        Raises:
            InputError: Of the work of any rank, on all.
            StopSearch: Of the monitor, on all, whether they are at work or wait.
        """
        fault, fits = None, True
        try:
            work()
        except TooLarge:
            fits = False
        except InputError as error:
            fault = str(error)
        while self._meet(None):
            pass
        raise_together(self._comm, fault)
        return self._comm.allreduce(fits, MPI.LAND)

    def _tell(self, step: InteriorStep) -> None:
        """Report a step of this rank, and receive those of others."""
        self._meet(step)

    def _meet(self, step: InteriorStep | None) -> bool:
        """Report a step, or None once the work has ended; return whether any rank still works."""
        told = [it for it in self._comm.allgather(step) if it is not None]
        if self._monitor is not None:
            for it in told:
                self._monitor(it)
        return bool(told)
