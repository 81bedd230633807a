"""Read text files of numbers as arrays."""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.inp_keywords import MOST_BYTES
from perfplast_fenicsx.proof.stored_file import check_regular


def text_of(path: Path) -> str:
    """Return the text of a file in UTF-8, or in Latin-1 if it is not UTF-8.

    Raises:
        InputError: If the file cannot be read, or is not text.
    """
    try:
        check_regular(path)
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"'{path}' has more than {MOST_BYTES:.0e} bytes, which is too large.")
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}; check the path.") from error
    if b"\0" in raw:
        raise InputError(f"'{path}' is not text; export the mesh again.")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def whole_numbers(lines: Iterable[str], what: str) -> Longs:
    """Return all integers in lines.

    Args:
        lines: Lines with blanks between the numbers.
        what: Name of the numbers, for messages.

    Raises:
        InputError: If a line has anything else.
    """
    return np.asarray(_numbers(" ".join(lines), np.int64, what), dtype=np.int64)


def real_numbers(lines: Iterable[str], what: str) -> Floats:
    """Return all numbers in lines, with exponents of Fortran too (1.0D+00).

    Raises:
        InputError: If a line has anything else, or a number is not finite.
    """
    text = re.sub("[dD]", "e", " ".join(lines))
    found = np.asarray(_numbers(text, np.float64, what), dtype=np.float64)
    if not np.isfinite(found).all():
        raise InputError(f"{what} have coordinates that are not finite; the file is damaged.")
    return found


def _numbers(text: str, kind: type[np.generic], what: str) -> np.ndarray:
    if not text.strip():
        return np.zeros(0, dtype=kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # NumPy's reaction to other text
        try:
            return np.fromstring(text, dtype=kind, sep=" ")
        except (DeprecationWarning, ValueError) as error:
            raise InputError(
                f"{what} have something else where numbers are expected; the file is damaged."
            ) from error
