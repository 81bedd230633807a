"""Complete arguments in the shell, if argcomplete is installed."""

import argparse
import os
from typing import Any

ENDINGS = {
    "CASE.toml": ("toml",),
    "DRAWING": (
        *("step", "stp", "brep", "iges", "igs", "geo"),
        *("inp", "med", "unv", "bdf", "nas", "fem", "vtu", "vtk"),
    ),
    "FILE": ("gif", "webp"),
    "PAGE": ("html",),
    "SCHEMA": ("json",),
}
"""Suffixes of the files that arguments name, by metavar."""


def complete(parser: argparse.ArgumentParser, **settings: Any) -> None:
    """Answer a completion request of the shell and end the process; otherwise do nothing.

    Args:
        parser: Parser of all commands.
        settings: Arguments of ``argcomplete.autocomplete``, for tests.
    """
    if "_ARGCOMPLETE" not in os.environ:
        return
    try:
        import argcomplete
        from argcomplete.completers import DirectoriesCompleter, FilesCompleter
    except ImportError:
        return
    folders = ("DIR", "FOLDER")  # metavars of arguments that name folders
    for action in _actions(parser):
        if action.metavar in folders:
            vars(action)["completer"] = DirectoriesCompleter()
        elif isinstance(action.metavar, str) and action.metavar in ENDINGS:
            vars(action)["completer"] = FilesCompleter(ENDINGS[action.metavar])
    argcomplete.autocomplete(parser, **settings)


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the actions of the parser and of its commands."""
    found = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found += [deeper for command in action.choices.values() for deeper in _actions(command)]
    return found
