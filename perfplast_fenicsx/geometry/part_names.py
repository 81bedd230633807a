"""Create names that mesh files can hold from the names of a model's parts."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet

from perfplast_fenicsx.errors import InputError

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


def cracks_among(
    curves: Mapping[str, AbstractSet[int]], inside: AbstractSet[int]
) -> list[tuple[str, str]]:
    """Return the names of both sides of each open crack inside a body, the left one first.

    A crack consists of curves inside bodies that have two names, ``NAME_left`` and ``NAME_right``.
    On boundaries and between bodies such names are ordinary ones.

    Args:
        curves: Curves by their names.
        inside: Curves inside a body, not on its boundary.

    Raises:
        InputError: If both names have curves inside bodies, but not the same ones, or also others.
    """
    found = []
    for left in curves:
        right = f"{left.removesuffix(LEFT)}{RIGHT}"
        both = curves[left] | curves.get(right, frozenset())
        if not left.endswith(LEFT) or right not in curves or not both & inside:
            continue
        if curves[left] != curves[right] or not both <= inside:
            raise InputError(
                f"the curves '{left}' and '{right}' are the sides of an open crack, but not each of"
                " them has both names and lies inside a body; give both names to the curves of the"
                " crack only, or other names."
            )
        found.append((left, right))
    return found
