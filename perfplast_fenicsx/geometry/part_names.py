"""Create names that mesh files can hold from the names of a model's parts."""

import re
from collections import Counter
from collections.abc import Iterable


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
