"""Bad input: one sentence, the same on every rank.

Everything that a user can get wrong ends in an :class:`InputError`. What only some ranks can see is
first put together by :func:`raise_together`, so that no rank raises while another waits in a
collective call.
"""

import difflib
from collections.abc import Iterable

from mpi4py import MPI


class InputError(ValueError):
    """Input that cannot be used; the message is one sentence with place, value and remedy."""


def raise_together(comm: MPI.Intracomm, message: str | None) -> None:
    """Raise on every rank if any rank has found a fault. Collective.

    Args:
        comm: Communicator whose ranks decide together.
        message: What this rank found, or None. Of several the lowest rank's is reported.

    Raises:
        InputError: With the same message on every rank.
    """
    found = [text for text in comm.allgather(message) if text is not None]
    if found:
        raise InputError(found[0])


def nearest(word: object, known: Iterable[str]) -> str:
    """The remedy for an unknown word: the nearest known one, or all of them."""
    words = list(known)
    close = difflib.get_close_matches(str(word), words, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(words)}."
