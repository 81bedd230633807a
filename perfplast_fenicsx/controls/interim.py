"""Report a partial result when a signal ends a search."""

from collections.abc import Iterator
from contextlib import contextmanager

from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch


@contextmanager
def of_other_loads(known: AdaptiveBounds | None = None) -> Iterator[None]:
    """An inner search uses other loads or strengths than the case.

    So its partial result is not an answer to the case.

    Args:
        known: The answer so far, which is reported instead.

    Raises:
        StopSearch: With the known answer.
    """
    try:
        yield
    except StopSearch as stop:
        stop.found, stop.adapted = None, known
        raise
