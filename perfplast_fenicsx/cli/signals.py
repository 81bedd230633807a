"""Handle Ctrl-C and SIGTERM: the ranks end together, between two iterations.

A signal may reach only one rank, at any point of the program. The rank stores it, and after each
iteration all ranks check together whether any has one. A second identical signal ends the process
at once, without damage to files. A signal that ends a child process, such as a compiler, has the
same effect.
"""

import signal
import threading
from types import FrameType, TracebackType

from mpi4py import MPI

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch


class Interrupted(StopSearch):
    """Raised on all ranks together.

    Attributes:
        status: Exit status, as in shells: 128 plus the signal's number.
    """

    def __init__(self, number: int) -> None:
        self.status = 128 + number
        super().__init__(signal.Signals(number).name)


class Interrupts:
    """Stores signals within a ``with`` block; outside the main thread it does nothing."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        """Start without a signal."""
        self._comm = comm
        self._noted = 0
        self._before: dict[int, object] = {}

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            signals = (signal.SIGINT, signal.SIGTERM)
            self._before = {number: signal.signal(number, self._note) for number in signals}
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        # a compiler or a file that was interrupted too is not a fault of the program
        expected = (StopSearch, InputError)
        if self._noted and isinstance(error, Exception) and not isinstance(error, expected):
            raise KeyboardInterrupt(self._noted) from error

    def check(self) -> None:
        """Check whether any rank has received a signal. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        number = self._comm.allreduce(self._noted, MPI.MAX)
        if number:
            raise Interrupted(number)

    def _note(self, number: int, _: FrameType | None) -> None:
        self._noted = self._noted or number
        signal.signal(number, self._before.pop(number))  # type: ignore[arg-type]


def leave_pipes_to_python() -> None:
    """Let a closed pipe raise BrokenPipeError, instead of PETSc ending the process."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
