"""Make the man page from the parser of the command line.

./fenicsx python3 -m docs.man_page > share/man/man1/perfplast.1
"""

import argparse
import re

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.parser import make_parser


def man_page() -> str:
    """Return the whole page as troff."""
    parser = make_parser()
    (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    short = {action.dest: action.help or "" for action in commands._choices_actions}
    lines = [
        f'.TH PERFPLAST 1 "" "perfplast {__version__}" "User Commands"',
        *(".SH NAME", f"perfplast \\- {_plain((parser.description or '').rstrip('.'))}"),
        ".SH SYNOPSIS",
    ]
    for name, command in commands.choices.items():
        lines += [f".B perfplast {name}", *_synopsis(command), ".br"]
    lines.append(".SH COMMANDS")
    for name, command in commands.choices.items():
        text = command.description or f"{short[name][:1].upper()}{short[name][1:]}."
        lines += [f".SS perfplast {name}", _plain(text)]
        for action in _told(command):
            lines += [".TP", _heading(action), _plain(_help(action))]
        if command.epilog:
            lines += [".PP", _plain(command.epilog)]
    status, _, text = (parser.epilog or "").partition(": ")
    lines += [f".SH {status.upper()}", _plain(text)]
    lines += [".SH EXAMPLES", ".nf"]
    lines += [_plain(line) for line in EXAMPLES]
    lines += [".fi"]
    return "\n".join(lines) + "\n"


EXAMPLES = (
    "perfplast mesh part.step -o part --material s235",
    "perfplast check part/case.toml",
    "mpirun -n 2 perfplast run part/case.toml -o part/results",
    "perfplast plot --follow part/results",
)


def _synopsis(command: argparse.ArgumentParser) -> list[str]:
    """Return the arguments of a command: options in brackets, and bars between alternatives."""
    grouped = {
        action.dest: group
        for group in command._mutually_exclusive_groups
        for action in group._group_actions
    }
    shown: list[str] = []
    for action in _told(command):
        group = grouped.get(action.dest)
        if group is None:
            shown.append(_heading(action) if action.required else f"[{_heading(action)}]")
        elif action is group._group_actions[0]:
            either = " | ".join(map(_heading, group._group_actions))
            shown.append(f"({either})" if group.required else f"[{either}]")
    return [" ".join(shown)] if shown else []


def _told(command: argparse.ArgumentParser) -> list[argparse.Action]:
    return [a for a in command._actions if not isinstance(a, argparse._HelpAction)]


def _heading(action: argparse.Action) -> str:
    """Return the names of an option in bold, and its value in italics."""
    takes = ""
    if action.nargs != 0:
        choices = "|".join(map(str, action.choices or ()))
        takes = f"\\fI{_plain(str(action.metavar or choices or action.dest.upper()))}\\fR"
    names = ", ".join(f"\\fB{_plain(name)}\\fR" for name in action.option_strings)
    return " ".join(filter(None, (names, takes)))


def _help(action: argparse.Action) -> str:
    return re.sub(r"\s+", " ", action.help or "")


def _plain(text: str) -> str:
    """Return text in which the characters that troff interprets are escaped."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return f"\\&{text}" if text.startswith((".", "'")) else text


if __name__ == "__main__":
    print(man_page(), end="")
