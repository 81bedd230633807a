"""Run the drawing program: ``python3 -m perfplast_fenicsx.pictures COMMAND ...``.

:mod:`drawing_process` starts it as a separate process, so a failure of the graphics system does not
affect the run. This module does not import MPI.
"""

import sys
from collections.abc import Callable, Iterator, Sequence

from perfplast_fenicsx.environment import REFUSED
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.pictures.result_figures import animate, case, parts, plot


def main(argv: Sequence[str]) -> int:
    """Draw pictures, print the path of each on its own line, and return the exit status."""
    command, source, *output = argv
    commands: dict[str, Callable[..., Iterator[str]]] = {
        "plot": plot,
        "animate": animate,
        "parts": parts,
        "case": case,
    }
    try:
        for line in commands[command](source, *output):
            print(line, flush=True)
    except InputError as error:
        print(error, file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
