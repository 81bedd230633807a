"""Write outcomes in words: factors of safety, estimates of meshes, brackets of paths, forces.

The limit load of a mesh is an estimate for the body, not a bound. A mesh has a static side: the
load of a stress that is in equilibrium and satisfies the yield condition at certain points. Its
kinematic side is the power of a mechanism. The two sides bound the limit load of the finite element
model from below and above, but bound the limit load of the body on neither side. So the program
prints the estimate with few digits, and not the sides but the distance between them.

A loading path loses equilibrium at a load factor between those of two levels. If no limit theorem
holds, as with Coulomb's friction, only the levels bound this factor. The highest solved level
bounds it from below. The lowest level for which no equilibrium exists bounds it from above.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from perfplast_fenicsx.rounding import rounded_down, rounded_up, without_rounding

Row = tuple[str, list[float]]


def force_rows(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    moments: bool = False,
    zeta: str = "zeta",
) -> list[Row]:
    """Return forces or moments of loads at ζ = 1 and at bounds, and of supports at the limit.

    Args:
        loads: Tables of :class:`resultants.LoadResultant`.
        lower: Load factor that the bodies provably carry.
        upper: Load factor at which the bodies provably collapse.
        at_limit: Table of :class:`limit_forces.LimitForces`, in which loads and supports balance,
            for the strict lower bound or for the limit load of the mesh.
        moments: Whether to return moments instead of forces.
        zeta: Name of the load factor.

    Returns:
        Pairs of words and numbers; an empty list if there are no loads.
    """
    rows = list(_rows(loads, lower, upper, at_limit, moments, zeta))
    shown = without_rounding([row for _, row in rows])
    return [(name, row) for (name, _), row in zip(rows, shown, strict=True)]


def _rows(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    moments: bool,
    zeta: str,
) -> Iterator[Row]:
    strict = at_limit is not None and at_limit.get("strict", False)
    for load in loads:
        named = load["name"] not in ("", load["on"])
        name = f"load {load['name']} on {load['on']}" if named else f"load {load['on']}"
        one = load["moment" if moments else "force"]
        if load["constant"]:
            yield f"{name}, constant", one
            continue
        yield f"{name}, {zeta} = 1", one
        if lower is not None:
            shown = rounded_down(lower)
            words = f"{name}, {zeta} = {shown}, carried for certain"
            yield words, [float(shown) * number for number in one]
        if upper is not None:
            shown = rounded_up(upper)
            words = f"{name}, {zeta} = {shown}, collapse for certain"
            yield words, [float(shown) * number for number in one]
        if at_limit is not None and not strict:
            words = f"{name}, {zeta} = {at_limit['zeta']:.6g}, limit load of the mesh"
            yield words, [at_limit["zeta"] * number for number in one]
    if at_limit is not None and loads:
        at = f"{at_limit['zeta']:.6g}, limit load of the mesh"
        if strict:
            at = f"{rounded_down(at_limit['zeta'])}, carried for certain"
        for name, one in at_limit["moments" if moments else "reactions"].items():
            if name != "loads":
                yield f"{name}, {zeta} = {at}", one


@dataclass(frozen=True)
class MeshEstimate:
    """Loads that bracket or estimate the limit load of a mesh.

    Attributes:
        static: Load factor ζ of the static side, or the largest load factor that a loading path has
            reached; −∞ if neither is known.
        estimate: The limit load; None if it was not found.
        kinematic: Load factor of the kinematic side; None if no mechanism was found.
    """

    static: float
    estimate: float | None
    kinematic: float | None

    @property
    def apart(self) -> float | None:
        """Return the distance between the two sides, relative to the static side.

        None if a side is missing, or if the static side is 0.
        """
        if self.kinematic is None or self.static == 0 or not math.isfinite(self.static):
            return None
        return abs((self.kinematic - self.static) / self.static)

    @property
    def shown(self) -> str:
        """Return the estimate with a few digits; "none" if there is no estimate."""
        if self.estimate is None:
            return "none"
        # Relative distance between the sides above which an estimate has one digit less.
        widest = 0.01
        wide = self.apart is not None and self.apart > widest
        # Number of significant digits of an estimate; meshes are hardly ever fine enough for more.
        digits = 4
        return f"{self.estimate:.{digits - wide}g}"

    def in_words(self, zeta: str = "") -> str:
        """Return the estimate and its reliability in words, to follow "limit load of the mesh:".

        Args:
            zeta: Text before load factors, such as "ζ = ".
        """
        if self.estimate is None:
            known = self.static != 0 and math.isfinite(self.static)
            sides = [f"at least {zeta}{rounded_down(self.static)}"] if known else []
            if self.kinematic is not None:
                sides.append(f"at most {zeta}{self.kinematic:.6g}")
            return f"not found, but {' and '.join(sides)} on this mesh" if sides else "not found"
        apart = self.apart
        if apart is None:
            side = "static" if self.kinematic is None else "kinematic"
            known_by = f"only the {side} side is known"
        else:
            known_by = f"static and kinematic sides {percent(apart)} apart"
        return f"{zeta}{self.shown} ({known_by}), an estimate for the body, not a bound"


def percent(share: float) -> str:
    """Return a share in percent with two digits, such as "0.74 %" or "430 %"."""
    touching = 1e-5  # relative distance below which the number has no meaning
    if share < touching:
        return f"less than {100 * touching:g} %"
    return f"{float(f'{100 * share:.2g}'):g} %"


SAID = (
    "No limit theorem holds with Coulomb's friction. These loads hold only for this mesh and this"
    " loading path, which starts from rest with all constant loads. Another path may end at"
    " another load."
)
"""Sentences on the scope of the bracket."""

NO_PAIR = (
    "Drucker's bounds were not sought: they need a problem without constant loads that the"
    " interior point method accepts."
)
"""The sentence for results without Drucker's bounds."""


@dataclass(frozen=True)
class PathBracket:
    """Load factors of one path between which equilibrium is lost.

    Attributes:
        carried: Largest load factor of a solved level; 0 if no level is solved.
        refused: Least load factor of a level without equilibrium; None if there is no such level.
    """

    carried: float
    refused: float | None

    def in_words(self, zeta: str = "") -> str:
        """Return the load at which equilibrium is lost, in words that follow "the path".

        Args:
            zeta: Text before load factors, such as "ζ = ".
        """
        low = f"{zeta}{rounded_down(self.carried)}"
        if self.refused is None:
            solved = f"; levels are solved up to {low}" if self.carried > 0 else ""
            return f"loses equilibrium at a load that was not found{solved}"
        high = f"{zeta}{rounded_up(self.refused)}"
        return (
            f"loses equilibrium between {low}, where a level is solved, and {high}, where no "
            "equilibrium exists"
        )


def factor_so_far(lower: float | None, upper: float | None, estimate: bool) -> str:
    """Return, in words, the bounds that a search for the factor of safety has found so far.

    Args:
        lower: Largest factor with which the bodies stand; None if it is not known.
        upper: Least factor at which the bodies fall; None if it is not known.
        estimate: Whether both factors are for Davis' associated ground.
    """
    proven = "Davis' estimate of the" if estimate else "proven"
    if lower is not None and upper is not None:
        known = f"{rounded_down(lower)} ... {rounded_up(upper)} ({proven} lower and upper bound)"
    elif lower is not None:
        known = f"{rounded_down(lower)} or more ({proven} lower bound)"
    elif upper is not None:
        known = f"{rounded_up(upper)} or less ({proven} upper bound)"
    else:
        known = "no proven bound"
    return f"factor of safety so far: {known}"


def factor_words(
    lower: float | None, upper: float | None, estimate: bool, many: bool = False
) -> list[str]:
    """Return a clause for each known bound: with which factor the bodies stand or fall.

    Args:
        lower: Factor with which the bodies stand; None if it is not known.
        upper: Factor at which the bodies fall; None if it is not known.
        estimate: Whether both factors are estimates, computed for other bodies.
        many: Whether the sentence has a plural subject.
    """
    ending, sides = "" if many else "s", []
    if lower is not None:
        certain = "" if estimate else " for certain"
        sides.append(f"stand{ending} with F = {rounded_down(lower)}{certain}")
    if upper is not None:
        latest = "" if estimate else " at the latest"
        sides.append(f"fall{ending} at F = {rounded_up(upper)}{latest}")
    return sides
