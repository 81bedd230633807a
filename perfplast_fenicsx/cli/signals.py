"""Handle Ctrl-C and SIGTERM: all ranks end the run together, between two iterations.

A signal may reach only one rank, at any point of the program. The rank stores the signal. After
each iteration all ranks check together whether any rank has received one. A second identical signal
ends the process at once, without damage to files. If the first signal also ends a child process,
such as a compiler, the process ends at once too.
"""

import signal
import threading
from types import FrameType, TracebackType

from mpi4py import MPI

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch


class Interrupted(StopSearch):
    """Raised on all ranks together after a signal.

    Attributes:
        status: Exit status by the convention of shells: 128 plus the signal's number.
    """

    def __init__(self, number: int) -> None:
        self.status = 128 + number
        super().__init__(signal.Signals(number).name)


class Interrupts:
    """Stores signals within a ``with`` block; outside the main thread it has no effect."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        """Create the object; no signal is stored yet."""
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
        # the signal may also have interrupted a compiler or file access, which is no fault of the
        # program
        expected = (StopSearch, InputError)
        if self._noted and isinstance(error, Exception) and not isinstance(error, expected):
            raise KeyboardInterrupt(self._noted) from error

    def check(self) -> None:
        """Raise an exception on all ranks if any rank has received a signal. Collective.

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
    """Make a closed pipe raise BrokenPipeError; otherwise PETSc would end the process."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
