"""Create valid names for mesh files from the names of a model's parts."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet

from perfplast_fenicsx.errors import InputError

LEFT, RIGHT = "_left", "_right"
"""Endings of the names of both sides of an open crack inside a body."""


def plain_name(name: str) -> str:
    """Return a name of lower-case letters, digits and _; "" if it has no letter and no digit."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def unique_names(wanted: Iterable[str]) -> list[str]:
    """Return unique names of lower-case letters, digits and _; equal names are numbered."""
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
    """Return the names of both sides of each open crack inside a body, the left side first.

    A crack consists of curves inside bodies that have both names, ``NAME_left`` and ``NAME_right``.
    On boundaries and between bodies these names have no special meaning.

    Args:
        curves: Tags of curves by name.
        inside: Curves inside a body that are not on its boundary.

    Raises:
        InputError: If both names have curves inside bodies, but not the same curves, or if they
            also have curves elsewhere.
    """
    found = []
    for left in curves:
        right = f"{left.removesuffix(LEFT)}{RIGHT}"
        both = curves[left] | curves.get(right, frozenset())
        if not left.endswith(LEFT) or right not in curves or not both & inside:
            continue
        if curves[left] != curves[right] or not both <= inside:
            raise InputError(
                f"'{left}' and '{right}' name both sides of an open crack, but some curves have "
                "only one of these names or do not lie inside a body; give both names to all "
                "curves of the crack and to no other curves, or rename the curves."
            )
        found.append((left, right))
    return found
