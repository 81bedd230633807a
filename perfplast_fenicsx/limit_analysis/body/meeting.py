"""Let ranks work independently, and synchronise them when one has something to report."""

from collections.abc import Callable

from mpi4py import MPI

from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge


class Meeting:
    """All ranks synchronise after each step of any rank; ranks that have finished wait."""

    def __init__(self, comm: MPI.Intracomm, monitor: Callable[[InteriorStep], None] | None) -> None:
        """Begin the synchronisation of these ranks.

        Args:
            comm: The ranks.
            monitor: Called on every rank after each step of any.
        """
        self._comm, self._monitor = comm, monitor
        self.monitor = None if monitor is None else self._tell
        """Called after each step of this rank; other ranks receive the step when they synchronise.
        """

    def after(self, work: Callable[[], None]) -> bool:
        """Do this rank's work, which must not be collective, and wait for that of all ranks.

        Collective.

        Returns:
            Whether the work is done; False if the work of any rank does not fit into memory.

        Raises:
            InputError: On all ranks, from the work of any rank.
            StopSearch: On all ranks, from the monitor, whether they work or wait.
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
        """Report a step, or None at the end of the work; return whether any rank still works."""
        told = [it for it in self._comm.allgather(step) if it is not None]
        if self._monitor is not None:
            for it in told:
                self._monitor(it)
        return bool(told)
