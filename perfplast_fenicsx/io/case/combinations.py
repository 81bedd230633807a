"""Read ``[[combination]]`` and ``[design]``: factors on loads and on strengths."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.io.case.code_templates import check_filled_in
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.problem.declared.loads import Load, scaled
from perfplast_fenicsx.problem.declared.stage import called


@dataclass(frozen=True)
class Combination:
    """Loads that act together, each multiplied by a factor.

    Each combination is solved separately, on the same mesh and with the same contacts. Loads
    without a factor do not act in the combination, and ζ multiplies its loads that are not
    constant. Without ``design`` under [loading], the design load is the combination itself (ζ = 1).
    With control = "strength", each combination has its own factor of safety; the combination is
    verified if this factor is at least 1.

    Args:
        name: Name of the combination and of its result folder.
        factors: Factors by names of loads; for a load without a name, use its surface or volume.
        strength: Partial factor that divides strengths in this combination, in addition to the
            factor in [design]: one number for all bodies, or one for each body by its name.
    """

    name: str
    factors: dict[str, float]
    strength: float | dict[str, float] = 1.0

    def __post_init__(self) -> None:
        outside = self.name.strip(" .") != self.name  # the name ".." would be another folder
        # characters that some operating systems forbid in the name of a folder
        barred = '/\\:*?"<>|'
        if outside or not self.name or not self.name.isprintable() or set(self.name) & set(barred):
            raise InputError(
                f"name = {self.name!r} cannot be the name of a folder; give a name without "
                f"{barred}, and without a blank or a dot at its start or end."
            )
        for load, factor in self.factors.items():
            if not (factor >= 0 and math.isfinite(factor)):
                raise InputError(
                    f"the factor of '{load}' is {factor:g}; give 0 or more, and reverse "
                    "the load if it acts in the opposite direction."
                )
        if not any(self.factors.values()):
            raise InputError(
                f"'{self.name}' has no factor above 0; give a positive factor, or remove the "
                "combination."
            )

    def of(self, loads: Sequence[Load], idle: Collection[str] = ()) -> list[Load]:
        """Return the loads that act in the combination, multiplied by their factors.

        Args:
            loads: Loads of the case.
            idle: Names of initial strains and given motions, which do not change a limit load.

        Raises:
            InputError: If a factor belongs to no load.
        """
        known = [called(load) for load in loads]
        for name in self.factors:
            if name in idle and name not in known:
                raise InputError(
                    f"'{name}' is not a load: temperatures, initial stresses, preloads and given "
                    f"motions do not change the limit load and have no factor; remove '{name}' "
                    "from factors."
                )
            if name not in known:
                raise InputError(f"there is no load '{name}'; {nearest(name, known)}")
        factors = [self.factors.get(name, 0.0) for name in known]
        return [scaled(load, f) for load, f in zip(loads, factors, strict=True) if f > 0]

    def in_words(self) -> str:
        """Return the combination in words."""
        parts = [f"{factor:g} × {name}" for name, factor in self.factors.items() if factor > 0]
        told = f"combination '{self.name}': {' + '.join(parts)}"
        if isinstance(self.strength, dict):
            by_body = (f"of '{body}' by {factor:g}" for body, factor in self.strength.items())
            return f"{told}; strengths divided {', '.join(by_body)}"
        return told if self.strength == 1 else f"{told}; strengths divided by {self.strength:g}"


@dataclass(frozen=True)
class DesignTable:
    """Partial factors that divide the strengths of bodies.

    Args:
        strength: Partial factor that divides yield stresses, cohesions and the tangents of friction
            angles: one number for all bodies, or one for each body by its name. Bodies without a
            factor keep their strength.
        code: Source of the factors on strengths and loads; results print this text.
    """

    strength: float | dict[str, float] = 1.0
    code: str = ""


def read_combinations(tables: Sequence[tuple[str, Table]]) -> list[Combination]:
    """Return the combinations of a case.

    Args:
        tables: Tables with their places.

    Raises:
        InputError: If a key or value is not valid, or if two combinations have the same name.
    """
    found: list[Combination] = []
    for place, table in tables:
        check_filled_in(table, place)
        one = convert(table, Combination, place)
        if one.name.casefold() in [other.name.casefold() for other in found]:
            raise InputError(
                f"{place}: two combinations are called '{one.name}'; rename one of them."
            )
        found.append(one)
    return found


def designed_for(loading: Control, place: str) -> Control:
    """Return a control for combinations; its design load is ζ = 1 unless the case gives another.

    Raises:
        InputError: If the control computes no limit load, or no load factor for comparison.
    """
    known: Any = loading
    if loading.divides:
        return loading
    if not hasattr(known, "design") or loading.limit_tolerance is None or loading.in_turn():
        raise InputError(
            f"{place}: combinations need a control that computes limit loads or bounds; give "
            "control = 'bounds', or 'work' with until = 'limit', under [loading]."
        )
    try:
        found: Control = known if loading.design else replace(known, design=1.0)
    except (TypeError, ValueError):
        raise InputError(
            f"{place}: combinations are compared by one load factor each, but this control "
            "computes other quantities; give control = 'bounds', or 'work' with until = 'limit', "
            "under [loading]."
        ) from None
    return found


def reduced(
    materials: Mapping[str, Material], table: Table, place: str
) -> tuple[dict[str, Material], str]:
    """Return materials with strengths divided by the factors in ``[design]``, and a remark.

    Raises:
        InputError: If a body is unknown, if a factor is not valid, or if a material has no strength
            that can be reduced.
    """
    check_filled_in(table, place)
    design = convert(table, DesignTable, place)
    with at(place):
        found, words = weakened(materials, design.strength)
    told = [words] if words else []
    if design.code:
        told.append(_source(design.code))
    return found, "; ".join(told)


def weakened(
    materials: Mapping[str, Material], strength: float | Mapping[str, float]
) -> tuple[dict[str, Material], str]:
    """Return materials with strengths divided by partial factors, and a remark.

    Args:
        materials: Materials by the names of their bodies.
        strength: One factor for all bodies, or one for each body by its name.

    Raises:
        InputError: If a body is unknown, if a factor is not valid, or if a material has no strength
            that can be reduced.
    """
    factors = dict.fromkeys(materials, strength) if isinstance(strength, float | int) else strength
    found: dict[str, Material] = dict(materials)
    for body, factor in factors.items():
        if body not in materials:
            raise InputError(
                f"strength has an entry for '{body}', which is not a body; "
                f"{nearest(body, materials)}"
            )
        if not (factor > 0 and math.isfinite(factor)):
            raise InputError(f"strength = {factor:g} is not positive; give a factor above 0.")
        if factor == 1:
            continue
        weaker = getattr(materials[body], "divided_by", None)
        if weaker is None:
            raise InputError(
                f"the material of '{body}' has no strength that can be reduced; remove '{body}' "
                "from strength."
            )
        found[body] = weaker(factor)
    changed = {body: factor for body, factor in factors.items() if factor != 1}
    if len(set(changed.values())) == 1 and len(changed) == len(materials):
        return found, f"all strengths are divided by {next(iter(changed.values())):g}"
    parts = [f"of '{body}' by {factor:g}" for body, factor in changed.items()]
    return found, f"strengths are divided: {', '.join(parts)}" if parts else ""


def _source(code: str) -> str:
    """Return a remark on the source of the factors."""
    return (
        f"the case gives {code} as the source of its factors; the program does not check the "
        "factors"
    )
