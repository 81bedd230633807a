"""Read the descriptions of arguments in docstrings, for references and schemas."""

import inspect
import re


def arguments(documented: object) -> dict[str, str]:
    """Return the ``Args`` section of a Google docstring: text by name, each text on one line.

    Args:
        documented: A class or a function with a docstring.
    """
    lines = (inspect.getdoc(documented) or "").splitlines()
    found: dict[str, list[str]] = {}
    if "Args:" not in lines:
        return {}
    name = ""
    for line in lines[lines.index("Args:") + 1 :]:
        if line and not line.startswith(" "):
            break
        entry = re.match(r"    (\w+): (.*)", line)
        if entry:
            name = entry[1]
            found[name] = [entry[2]]
        elif line.strip():
            found[name].append(line.strip())
    return {name: " ".join(text) for name, text in found.items()}


def summary(documented: object) -> str:
    """Return the text of a docstring before its first section."""
    text = inspect.getdoc(documented) or ""
    return re.split(r"\n\n(?:Args|Raises|Returns|Attributes):", text)[0]
