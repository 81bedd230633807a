"""Read numbers in the data lines of an ``.inp`` file: tables, sets, and indices of numbers."""

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.inp_keywords import Keyword

NOBODY: Longs = np.zeros(0, dtype=np.int64)

Sets = dict[tuple[str, str], Longs]
"""Numbers of members by the kind of set ("NSET", "ELSET") and its name."""


class NumberIndex:
    """The index in the assembly of each node or element, by its number in a part."""

    def __init__(self, ids: Longs, first: int, what: str) -> None:
        self._order = np.argsort(ids, kind="stable")
        self._sorted, self._first, self._what = ids[self._order], first, what

    def of(self, numbers: Longs, missing_is_fine: bool = False) -> Longs:
        """Return the indices of numbers; if a number occurs twice, that of its last occurrence."""
        if not len(self._sorted):
            if numbers.size and not missing_is_fine:
                raise InputError(f"there is no {self._what} {numbers.ravel()[0]}.")
            return NOBODY
        at = np.searchsorted(self._sorted, numbers, side="right") - 1
        there = self._sorted[np.maximum(at, 0)] == numbers
        if missing_is_fine:
            return self._first + self._order[at[there]]
        if not there.all():
            raise InputError(
                f"there is no {self._what} {numbers[~there].ravel()[0]}, which an element has; the"
                " file is cut off or damaged."
            )
        return self._first + self._order[at]


def first_has(keyword: Keyword, count: int) -> bool:
    """Return whether the first element has ``count`` numbers, including its own number."""
    found = 0
    for line in keyword.lines:
        found += len([cell for cell in line.split(",") if cell.strip()])
        if not line.endswith(","):
            break
    return found == count


def table_of(keyword: Keyword) -> Floats:
    """Return the data lines as a table; missing cells are zero."""
    if not keyword.lines:
        return np.zeros((0, 4))
    lines = [line.rstrip(", ") for line in keyword.lines]
    width = lines[0].count(",") + 1
    try:
        return np.array(",".join(lines).split(","), dtype=np.float64).reshape(-1, width)
    except ValueError:
        pass  # lines of unequal length, or cells without a number
    try:
        rows = [[float(cell.strip() or 0) for cell in line.split(",")] for line in lines]
    except ValueError as error:
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has a text that is not a number ({error})."
        ) from error
    width = max(map(len, rows))
    return np.array([row + [0.0] * (width - len(row)) for row in rows])


def names_of(keyword: Keyword) -> list[str]:
    """Return the names in the data."""
    return [cell for row in keyword.rows() for cell in row if cell and not _is_whole(cell)]


def _is_whole(cell: str) -> bool:
    return cell.lstrip("+-").isdigit()


def members_of(keyword: Keyword, kind: str, known: Sets) -> Longs:
    """Return the numbers of a set."""
    rows = keyword.rows()
    if "GENERATE" in keyword.options:
        found = []
        for row in rows:
            try:
                first, last, step = (*map(int, row), 1)[:3]
            except ValueError as error:
                raise InputError(
                    f"line {keyword.number}: *{kind}, GENERATE needs first, last and step."
                ) from error
            if step < 1 or (last - first) // step > 100_000_000:
                raise InputError(f"line {keyword.number}: *{kind} has the step {step}.")
            found.append(np.arange(first, last + 1, step, dtype=np.int64))
        return np.concatenate([NOBODY, *found])
    plain = np.array([int(c) for row in rows for c in row if _is_whole(c)], dtype=np.int64)
    others = [known[kind, n.upper()] for n in names_of(keyword) if (kind, n.upper()) in known]
    return np.concatenate([plain, *others])


def add_to(sets: Sets, key: tuple[str, str], members: Longs) -> None:
    """Add members to a set, which is created if it does not exist."""
    before = sets.get(key)
    sets[key] = members if before is None else np.union1d(before, members)
