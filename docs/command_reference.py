"""Make the reference of the command line from ``perfplast --help`` of each command.

Sphinx replaces :data:`MARK` in ``command_line.md`` with the reference.
"""

import argparse
from collections.abc import Mapping
from functools import partial
from typing import Any

from docs.marks import replace_mark
from perfplast_fenicsx.cli.json_answer import COMMON, FIELDS
from perfplast_fenicsx.cli.parser import make_parser

MARK = "<!-- the commands, from the program -->"

JSON = (
    "With `--json` a command prints one JSON object on standard output, and text and progress"
    " on standard error. The exit status is the same. After a refusal, `error` has its"
    " [code](codes.md), and the keys of the command are null. A fault of the program on one of"
    " several ranks can leave standard output empty. Every object has these keys:"
)

WIDTH = 96
"""Characters in a line of help."""


def reference() -> str:
    """Return the whole reference as MyST."""
    parser = make_parser()
    text = _help(parser)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                text += f"\n## `perfplast {name}`\n\n{_help(command)}"
                if name in FIELDS:
                    text += f"\nWith `--json` the object also has:\n\n{_keys(FIELDS[name])}"
    return text + f"\n## JSON\n\n{JSON}\n\n{_keys(COMMON)}"


def _keys(meaning: Mapping[str, str]) -> str:
    """Return a table of keys."""
    rows = "".join(f"| `{key}` | {text} |\n" for key, text in meaning.items())
    return f"| key | value |\n|---|---|\n{rows}"


def _help(parser: argparse.ArgumentParser) -> str:
    parser.formatter_class = partial(argparse.HelpFormatter, width=WIDTH)
    return f"```text\n{parser.format_help()}```\n"


def setup(app: Any) -> dict[str, bool]:
    """Insert the reference where a page has :data:`MARK`; Sphinx calls this function."""
    return replace_mark(app, MARK, reference)
