"""Read numbers from text files, and from the data lines of an ``.inp`` file, into arrays."""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.inp_keywords import MOST_BYTES, Keyword
from perfplast_fenicsx.proof.stored_file import check_regular


def text_of(path: Path) -> str:
    """Return the text of a file, decoded as UTF-8, or as Latin-1 if it is not UTF-8.

    Raises:
        InputError: If the file cannot be read, or is not text.
    """
    try:
        check_regular(path)
        if path.stat().st_size > MOST_BYTES:
            raise InputError(
                f"'{path}' has more than {MOST_BYTES:.0e} bytes, the limit for a "
                "file; give a smaller model."
            )
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}; check the path.") from error
    if b"\0" in raw:
        raise InputError(f"'{path}' is not a text file; export the mesh again.")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def whole_numbers(lines: Iterable[str], what: str) -> Longs:
    """Return all integers in some lines.

    Args:
        lines: Lines with blanks between the numbers.
        what: Name of the objects that the numbers describe, for messages.

    Raises:
        InputError: If a line contains anything else.
    """
    return np.asarray(_numbers(" ".join(lines), np.int64, what), dtype=np.int64)


def real_numbers(lines: Iterable[str], what: str) -> Floats:
    """Return all numbers in some lines, which may have Fortran's exponents (1.0D+00).

    Raises:
        InputError: If a line contains anything else, or if a number is not finite.
    """
    text = re.sub("[dD]", "e", " ".join(lines))
    found = np.asarray(_numbers(text, np.float64, what), dtype=np.float64)
    if not np.isfinite(found).all():
        raise InputError(f"{what} have coordinates that are not finite; export the mesh again.")
    return found


def _numbers(text: str, kind: type[np.generic], what: str) -> np.ndarray:
    if not text.strip():
        return np.zeros(0, dtype=kind)
    with warnings.catch_warnings():
        # NumPy issues this warning for other text
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=kind, sep=" ")
        except (DeprecationWarning, ValueError) as error:
            raise InputError(
                f"{what} contain text where numbers are expected; export the mesh again."
            ) from error


NOBODY: Longs = np.zeros(0, dtype=np.int64)

Sets = dict[tuple[str, str], Longs]
"""Numbers of the members of sets, by kind of set ("NSET", "ELSET") and name."""


class NumberIndex:
    """Finds the index of nodes or elements in the assembly by their numbers in a part."""

    def __init__(self, ids: Longs, first: int, what: str) -> None:
        self._order = np.argsort(ids, kind="stable")
        self._sorted, self._first, self._what = ids[self._order], first, what

    def of(self, numbers: Longs, missing_is_fine: bool = False) -> Longs:
        """Return the indices for numbers; for a number given twice in the part, its last index."""
        if not len(self._sorted):
            if numbers.size and not missing_is_fine:
                raise InputError(
                    f"there is no {self._what} with the number {numbers.ravel()[0]}, so the file "
                    "is cut off or damaged; export the mesh again."
                )
            return NOBODY
        at = np.searchsorted(self._sorted, numbers, side="right") - 1
        there = self._sorted[np.maximum(at, 0)] == numbers
        if missing_is_fine:
            return self._first + self._order[at[there]]
        if not there.all():
            raise InputError(
                f"there is no {self._what} with the number {numbers[~there].ravel()[0]}, to which "
                "an element refers, so the file is cut off or damaged; export the mesh again."
            )
        return self._first + self._order[at]


def first_has(keyword: Keyword, count: int) -> bool:
    """Return whether the first element has ``count`` numbers, including the element number."""
    found = 0
    for line in keyword.lines:
        found += len([cell for cell in line.split(",") if cell.strip()])
        if not line.endswith(","):
            break
    return found == count


def table_of(keyword: Keyword) -> Floats:
    """Return the data lines as a table, with 0 for missing cells."""
    if not keyword.lines:
        return np.zeros((0, 4))
    lines = [line.rstrip(", ") for line in keyword.lines]
    width = lines[0].count(",") + 1
    try:
        return np.array(",".join(lines).split(","), dtype=np.float64).reshape(-1, width)
    except ValueError:
        pass  # lines have different lengths, or cells are empty
    try:
        rows = [[float(cell.strip() or 0) for cell in line.split(",")] for line in lines]
    except ValueError as error:
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has an entry that is not a number ({error}), "
            "so the file is damaged; export it again."
        ) from error
    width = max(map(len, rows))
    return np.array([row + [0.0] * (width - len(row)) for row in rows])


def names_of(keyword: Keyword) -> list[str]:
    """Return the names in the data lines of a keyword."""
    return [cell for row in keyword.rows() for cell in row if cell and not _is_whole(cell)]


def _is_whole(cell: str) -> bool:
    return cell.lstrip("+-").isdigit()


def members_of(keyword: Keyword, kind: str, known: Sets) -> Longs:
    """Return the numbers of the members of a set."""
    rows = keyword.rows()
    if "GENERATE" in keyword.options:
        found = []
        for row in rows:
            try:
                first, last, step = (*map(int, row), 1)[:3]
            except ValueError as error:
                raise InputError(
                    f"line {keyword.number}: *{kind}, GENERATE needs three integers: first, last "
                    "and step, so the file is damaged; export it again."
                ) from error
            if step < 1 or (last - first) // step > 100_000_000:
                raise InputError(
                    f"line {keyword.number}: *{kind} has the invalid step {step}, so the file is "
                    "damaged; export it again."
                )
            found.append(np.arange(first, last + 1, step, dtype=np.int64))
        return np.concatenate([NOBODY, *found])
    plain = np.array([int(c) for row in rows for c in row if _is_whole(c)], dtype=np.int64)
    others = [known[kind, n.upper()] for n in names_of(keyword) if (kind, n.upper()) in known]
    return np.concatenate([plain, *others])


def add_to(sets: Sets, key: tuple[str, str], members: Longs) -> None:
    """Add members to a set; create the set if it does not exist."""
    before = sets.get(key)
    sets[key] = members if before is None else np.union1d(before, members)
