"""Advise on a limit load that is not known accurately enough, with the approximate cost."""

from collections.abc import Iterator
from dataclasses import dataclass

from perfplast_fenicsx.limit_analysis.body.body_bounds import NOT_SOUGHT, BodyBounds
from perfplast_fenicsx.limit_analysis.facets.bound_body import UNMATCHED
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED, ENTERS
from perfplast_fenicsx.limit_analysis.statements.bound import NO_MECHANISM
from perfplast_fenicsx.outcome_words import percent


@dataclass(frozen=True)
class Effort:
    """The cost of a search.

    Attributes:
        dim: Dimension of the bodies.
        cells: Number of cells of the mesh; of several meshes, of the first one.
        seconds: Wall time.
        ended: Why there is no finer mesh, if the mesh was adapted; empty without adaptation.
    """

    dim: int
    cells: int
    seconds: float
    ended: str = ""


def next_steps(body: BodyBounds, effort: Effort) -> list[str]:
    """Return sentences without a full stop; an empty list if both bounds hold and are close.

    Args:
        body: Proven bounds of the body.
        effort: Cost of these bounds.
    """
    return list(_steps(body, effort))


def _steps(body: BodyBounds, effort: Effort) -> Iterator[str]:
    seconds, dim = effort.seconds, effort.dim
    lower, upper = body.lower, body.upper
    if lower == NOT_SOUGHT:
        # Why an upper bound is missing or not strict although a lower one may still be computed.
        answered = {NO_MECHANISM, CURVED, ENTERS}
        if body.mesh.estimate is not None and set(upper.why_not) <= answered:
            # Cost of bounds relative to that of the mesh's limit load, by dimension.
            bounded = {2: (2, 5), 3: (4, 8)}
            yield (
                'control = "bounds" under [loading] bounds what the bodies provably '
                f"carry, and takes about {_times(bounded[dim], seconds)}"
            )
    elif lower.strict and upper.strict and (apart := lower.apart(upper)) is not None:
        # Relative distance of bounds above which a message advises how to reduce it.
        wide = 0.1
        if apart > wide and effort.ended:
            yield (
                f"the bounds are {percent(apart)} apart, and {effort.ended}; more meshes "
                "(a smaller until, more cells), or a smaller size of the first one, bring "
                "them closer"
            )
        elif apart > wide:
            # Relative cost of bounds with half the element size, by dimension: there are 4 or 8
            # times as many cells, and the factors grow faster than this number.
            longer = {2: (4, 8), 3: (15, 50)}
            # Relative cost of bounds on several meshes, the last one with twice as many cells.
            adapting = (2, 5)
            yield (
                f"the bounds are {percent(apart)} apart, as the mesh is coarse. adapt = {{ "
                f"until = {wide}, cells = {_rounded(2 * effort.cells)} }} under [mesh] "
                f"brings them closer, and takes about {_times(adapting, seconds)}; "
                f"elements of half the size (some {_rounded(2**dim * effort.cells)} cells) "
                f"take about {_times(longer[dim], seconds)}"
            )
    if NO_MECHANISM in upper.why_not:
        locked = " and ".join(map(repr, body.mesh.locked))
        whose = f": {locked} {'locks' if len(body.mesh.locked) == 1 else 'lock'}" if locked else ""
        divided = ', or control = "bounds", which divides all elements,' if dim == 3 else ""
        yield (
            f"no mechanism of this mesh preserves all volumes{whose}. Elements of half the "
            f"size there (sizes under [geometry]){divided if lower == NOT_SOUGHT else ''} "
            "may have one"
        )
    if UNMATCHED in (*lower.why_not, *upper.why_not):
        where = "" if dim == 3 else ", or let both surfaces end at the same places without a gap"
        yield (
            "matching surfaces have bounds: mesh their bodies as one and split "
            f"them{where}; a gap does not change the limit load"
        )
    if CURVED in upper.why_not and lower.strict and lower.value:
        yield (
            "rely on the lower bound; there is no strict upper bound for contact on "
            "curved obstacles, or with friction on curved faces, however fine the mesh"
        )


def _times(many: tuple[int, int], seconds: float) -> str:
    """Return the cost in multiples and in time."""
    least, most = (clock(number * seconds) for number in many)
    return f"{many[0]} to {many[1]} times as long as this ({least} to {most})"


def clock(seconds: float) -> str:
    """Return a time in words, with two digits."""
    if seconds < 90:
        return f"{max(seconds, 1):.2g} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _rounded(cells: int) -> int:
    """Return a number of cells rounded up to two digits."""
    step = 10 ** max(len(str(cells)) - 2, 0)
    return -(-cells // step) * step
