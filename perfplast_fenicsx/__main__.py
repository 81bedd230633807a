"""Run the command line: ``perfplast run CASE.toml -o DIR``, and the other commands.

Commands import MPI, PETSc and DOLFINx when they begin. Help, the version and shell completion do
not import them. A case file that is not TOML is refused before PETSc and DOLFINx are imported.
"""

import io
import signal
import sys
import traceback
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from perfplast_fenicsx.cli.json_answer import (
    FIELDS,
    Answer,
    answer_by,
    libraries_on_stderr,
    wants_json,
)
from perfplast_fenicsx.cli.launch import launched_first, prepare
from perfplast_fenicsx.cli.parser import BAD_INPUT, FAULT, read_arguments
from perfplast_fenicsx.environment import forms_fault
from perfplast_fenicsx.errors import InputError, on_rank0

if TYPE_CHECKING:
    from mpi4py import MPI


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, and return its exit status.

    Collective, except for help, the version, ``doctor`` and ``mcp``.

    Args:
        argv: Arguments; by default the arguments of the process.

    Returns:
        The exit status, the same on every rank.
    """
    for stream in (sys.stdout, sys.stderr):  # a message may contain Greek letters
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    arguments = list(sys.argv[1:] if argv is None else argv)
    if wants_json(arguments):
        return answer_by(lambda answer: _run(arguments, answer), launched_first)
    return _run(arguments, None)


def _run(arguments: Sequence[str], answer: Answer | None) -> int:
    """Run a command, and return its exit status.

    Args:
        arguments: The arguments.
        answer: The answer to print as JSON; None without ``--json``.
    """
    kept = answer or Answer()
    kept.command = next((word for word in arguments if word in FIELDS), "")
    try:
        chosen = read_arguments(arguments)
        kept.command = chosen.command
        if chosen.command == "doctor":
            from perfplast_fenicsx.cli.doctor import doctor

            return doctor(kept)
        if chosen.command == "mcp":
            from perfplast_fenicsx.cli.tool_server import serve

            return serve(chosen.folders)
        fault = prepare(chosen, arguments)
        if fault is not None:  # MPI may be the fault, so do not start it
            kept.refuse(InputError(fault))
            if launched_first():
                print(f"perfplast: {fault}", file=sys.stderr, flush=True)
            return BAD_INPUT

        with libraries_on_stderr() if answer else nullcontext():
            if getattr(chosen, "case", None) is not None:
                _check_readable(chosen.case)

            from perfplast_fenicsx.cli.commands import execute

            status = execute(_world(), chosen, kept)
    except InputError as error:
        kept.refuse(error)
        if _world().rank == 0:
            print(f"perfplast: {error}", file=sys.stderr, flush=True)
        status = BAD_INPUT
    except SystemExit as end:  # from --help and --version
        return int(end.code or 0)
    except KeyboardInterrupt as stop:
        number = signal.Signals(stop.args[0] if stop.args else signal.SIGINT)
        told = f"perfplast: ended at once by {number.name}; solved levels are saved."
        kept.fail("interrupted", told)
        return _at_once(told, 128 + number)
    except Exception as error:
        # this form was not compiled in advance, and the machine may not be able to compile
        fault = forms_fault() if _while_compiling(error) else None
        if fault is not None:
            kept.refuse(InputError(fault))
            return _at_once(f"perfplast: {fault}", BAD_INPUT)
        kept.fail("fault", f"{type(error).__name__}: {error}")
        return _at_once(traceback.format_exc().rstrip(), FAULT)
    _world().barrier()  # a launcher may end all ranks as soon as one ends
    return status


def _check_readable(path: str) -> None:
    """Refuse a case file that cannot be read or is not TOML, before the slow imports. Collective.

    Args:
        path: The case file.

    Raises:
        InputError: If the file is refused, on every rank.
    """
    from perfplast_fenicsx.io.case.schema import parse, read_text

    file = Path(path)
    on_rank0(_world(), lambda: parse(read_text(file), file.name))


def _world() -> "MPI.Intracomm":
    """Return the communicator of all ranks; the first call starts MPI."""
    from mpi4py import MPI

    return MPI.COMM_WORLD


def _while_compiling(error: Exception) -> bool:
    """Return whether an error was raised while FFCx compiled a form."""
    frames = traceback.walk_tb(error.__traceback__)
    return any(frame.f_globals.get("__name__", "").startswith("ffcx.") for frame, _ in frames)


def _at_once(told: str, status: int) -> int:
    """Print ``told``, end the other ranks, which may wait for this rank, and return ``status``."""
    print(told, file=sys.stderr, flush=True)
    if _world().size > 1:
        _world().Abort(status)
    return status


if __name__ == "__main__":
    sys.exit(main())
