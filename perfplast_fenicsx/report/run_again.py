"""Return the command that repeats a run."""

import re
import shlex

from perfplast_fenicsx.io.results.summary import Summary

OF_SOLVERS = re.compile(r"-perfplast_([a-z]+_)?\d+_\S+ \S+ ?")
"""Options that solvers set for themselves, each with its own number."""


def command_of(summary: Summary) -> str:
    """Return the shell command; empty if a Python program made the run."""
    if not summary.case:
        return ""
    launch = f"mpirun -n {summary.ranks} " if summary.ranks > 1 else ""
    words = ["perfplast", "run", summary.case["file"], "-o", "results"]
    command = summary.surroundings.get("command") or shlex.join(words)
    options = OF_SOLVERS.sub("", summary.surroundings.get("petsc_options", "")).strip()
    return launch + command + (f" -- {options}" if options else "")
