"""Create names that mesh files can hold from the names of a model's parts."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet

LEFT, RIGHT = "_left", "_right"
"""Ends of the names of the sides of an open crack inside a body."""


def plain_name(name: str) -> str:
    """Return the letters, digits and _ of a name in lower case; empty if there are none."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def unique_names(wanted: Iterable[str]) -> list[str]:
    """Return unique names of letters, digits and _ in lower case; equal ones are numbered."""
    plain = [plain_name(name) or "part" for name in wanted]
    plain = [f"part_{name}" if name[0].isdigit() else name for name in plain]
    how_many, seen, used = Counter(plain), Counter[str](), set[str]()
    names = []
    for name in plain:
        one = name
        while how_many[name] > 1 or one in used:
            seen[name] += 1
            one = f"{name}_{seen[name]}"
            if one not in used and one not in how_many:
                break
        used.add(one)
        names.append(one)
    return names


def cracks_among(curves: Mapping[str, AbstractSet[int]]) -> list[tuple[str, str]]:
    """Return the names of both sides of each open crack inside a body, the left one first.

    Args:
        curves: Curves by their names. The sides of a crack have the same ones.
    """
    pairs = [(name, f"{name.removesuffix(LEFT)}{RIGHT}") for name in curves if name.endswith(LEFT)]
    return [
        (left, right) for left, right in pairs if curves[left] and curves[left] == curves.get(right)
    ]
