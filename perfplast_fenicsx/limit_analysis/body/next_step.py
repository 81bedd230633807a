"""Advice for a limit load that is not known well enough, with its approximate cost."""

from collections.abc import Iterator
from dataclasses import dataclass

from perfplast_fenicsx.limit_analysis.body.body_bounds import NOT_SOUGHT, BodyBounds
from perfplast_fenicsx.limit_analysis.facets.bound_body import UNMATCHED
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED, ENTERS
from perfplast_fenicsx.limit_analysis.statements.bound import NO_MECHANISM
from perfplast_fenicsx.mesh_estimate import percent


@dataclass(frozen=True)
class Effort:
    """The effort of a search.

    Attributes:
        dim: Dimension of the bodies.
        cells: Cells of the mesh; of several, of the first one.
        seconds: Wall time.
        ended: Why there is no finer mesh, where it was adapted; empty where it was not.
    """

    dim: int
    cells: int
    seconds: float
    ended: str = ""


def next_steps(body: BodyBounds, effort: Effort) -> list[str]:
    """Sentences without a full stop; none where both bounds hold and are near each other.

    Args:
        body: Proven bounds of the body.
        effort: What it took.
    """
    return list(_steps(body, effort))


def _steps(body: BodyBounds, effort: Effort) -> Iterator[str]:
    seconds, dim = effort.seconds, effort.dim
    lower, upper = body.lower, body.upper
    if lower == NOT_SOUGHT:
        # Why an upper bound is missing or not strict where a lower one may be sought all the same.
        answered = {NO_MECHANISM, CURVED, ENTERS}
        if body.mesh.estimate is not None and set(upper.why_not) <= answered:
            # How many times as long as the limit load of the mesh its bounds take, by dimension.
            bounded = {2: (2, 5), 3: (4, 8)}
            yield (
                'what the bodies carry for certain is bounded by control = "bounds" under'
                f" [loading], which takes about {_times(bounded[dim], seconds)}"
            )
    elif lower.strict and upper.strict and (apart := lower.apart(upper)) is not None:
        # Distance of bounds, relative, beyond which a message says how to narrow them.
        wide = 0.1
        if apart > wide and effort.ended:
            yield (
                f"the bounds are {percent(apart)} apart, and {effort.ended}; more meshes (a smaller"
                " until, more cells), or a smaller size of the first one, bring them nearer"
            )
        elif apart > wide:
            # How many times as long bounds take with half the size of elements, by dimension: with
            # 4 and 8 times as many cells, whose factors grow faster than their number.
            longer = {2: (4, 8), 3: (15, 50)}
            # How many times as long as those of one mesh bounds of some meshes take,
            # the last one of twice as many cells.
            adapting = (2, 5)
            yield (
                f"the bounds are {percent(apart)} apart, as the mesh is coarse. adapt ="
                f" {{ until = {wide}, cells = {_rounded(2 * effort.cells)} }} under [mesh] brings"
                f" them nearer, and takes about {_times(adapting, seconds)}; elements of half the"
                f" size (some {_rounded(2**dim * effort.cells)} cells) take about"
                f" {_times(longer[dim], seconds)}"
            )
    if NO_MECHANISM in upper.why_not:
        locked = " and ".join(map(repr, body.mesh.locked))
        whose = f": {locked} {'locks' if len(body.mesh.locked) == 1 else 'lock'}" if locked else ""
        divided = ', or control = "bounds", which divides all elements,' if dim == 3 else ""
        yield (
            f"no mechanism of this mesh keeps all volumes{whose}. Elements of half the size there"
            f" (sizes under [geometry]){divided if lower == NOT_SOUGHT else ''} may have one"
        )
    if UNMATCHED in (*lower.why_not, *upper.why_not):
        where = "" if dim == 3 else ", or let both surfaces end at the same places without a gap"
        yield (
            f"surfaces that match have bounds: mesh their bodies as one and split them{where};"
            " a gap changes no limit load"
        )
    if CURVED in upper.why_not and lower.strict and lower.value:
        yield (
            "the lower bound is the one to rely on; there is no strict upper one of contact on"
            " curved obstacles, or with friction on curved faces, however fine the mesh"
        )


def _times(many: tuple[int, int], seconds: float) -> str:
    """Return how many times as long, and how long that is."""
    least, most = (clock(number * seconds) for number in many)
    return f"{many[0]} to {many[1]} times as long as this ({least} to {most})"


def clock(seconds: float) -> str:
    """Return a time in words, in two digits."""
    if seconds < 90:
        return f"{max(seconds, 1):.2g} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.2g} min"
    return f"{seconds / 3600:.2g} h"


def _rounded(cells: int) -> int:
    """Return a number of cells in two digits, not less than it is."""
    step = 10 ** max(len(str(cells)) - 2, 0)
    return -(-cells // step) * step
