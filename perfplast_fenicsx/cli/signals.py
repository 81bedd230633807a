"""Ctrl-C and SIGTERM: the ranks end together, between two iterations.

A signal may reach one rank alone, and at any place. It is noted there, and all ranks look together
after each iteration whether any has one. The same signal once more ends the process at once;
nothing on the disk is harmed by that either. So does a signal that ends what the process waits for,
such as a compiler.
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
        status: Exit status, as shells give it: 128 and the signal's number.
    """

    def __init__(self, number: int) -> None:
        self.status = 128 + number
        super().__init__(signal.Signals(number).name)


class Interrupts:
    """Notes signals while it is entered; outside of the main thread it cannot, and does nothing."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        """Notes none yet."""
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
        # a compiler or a file that was interrupted too is no fault of the program
        expected = (StopSearch, InputError)
        if self._noted and isinstance(error, Exception) and not isinstance(error, expected):
            raise KeyboardInterrupt(self._noted) from error

    def check(self) -> None:
        """Look whether any rank has had a signal. Collective.

        Raises:
            Interrupted: On every rank, if so.
        """
        number = self._comm.allreduce(self._noted, MPI.MAX)
        if number:
            raise Interrupted(number)

    def _note(self, number: int, _: FrameType | None) -> None:
        self._noted = self._noted or number
        signal.signal(number, self._before.pop(number))  # type: ignore[arg-type]


def leave_pipes_to_python() -> None:
    """Have a pipe that nobody reads raise BrokenPipeError: PETSc would end the process."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
