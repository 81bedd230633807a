"""Messages for a search that a signal ends."""

from collections.abc import Iterator
from contextlib import contextmanager

from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch


@contextmanager
def of_other_loads(known: AdaptiveBounds | None = None) -> Iterator[None]:
    """A search within is of other loads or strengths than those of the case.

    So what it has found when it is stopped is no answer.

    Args:
        known: The answer so far, which is reported in its place.

    Raises:
        StopSearch: The one that comes.
    """
    try:
        yield
    except StopSearch as stop:
        stop.found, stop.adapted = None, known
        raise
