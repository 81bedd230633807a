"""The reference of the command line: what ``perfplast --help`` says of each command.

Sphinx puts it into ``command_line.md`` in place of :data:`MARK`.
"""

import argparse
from functools import partial
from typing import Any

from docs.marks import replace_mark
from perfplast_fenicsx.cli.parser import make_parser

MARK = "<!-- the commands, from the program -->"

WIDTH = 96
"""Characters in a line of help."""


def reference() -> str:
    """The whole reference as MyST."""
    parser = make_parser()
    text = _help(parser)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                text += f"\n## `perfplast {name}`\n\n{_help(command)}"
    return text


def _help(parser: argparse.ArgumentParser) -> str:
    parser.formatter_class = partial(argparse.HelpFormatter, width=WIDTH)
    return f"```text\n{parser.format_help()}```\n"


def setup(app: Any) -> dict[str, bool]:
    """Put the reference in where a page has :data:`MARK`; called by Sphinx."""
    return replace_mark(app, MARK, reference)
