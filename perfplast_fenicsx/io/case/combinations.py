"""Read ``[[combination]]`` and ``[design]``: loads times factors, strengths divided by factors."""

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

    Each combination is solved separately, on the same mesh and with the same contact. Loads without
    a factor do not act in it, and ζ multiplies those that are not constant. Without ``design``
    under [loading] the combination itself is the design load, ζ = 1. With control = "strength",
    each combination has its own factor of safety, and is verified if the factor is at least 1.

    Args:
        name: Name of the combination, and of the folder of its results.
        factors: Factors of loads, by their names, or by their surfaces or volumes if they have no
            names.
        strength: Partial factor on strengths in this combination, in addition to that of [design]:
            one number for all bodies, or one for each body by its name.
    """

    name: str
    factors: dict[str, float]
    strength: float | dict[str, float] = 1.0

    def __post_init__(self) -> None:
        outside = self.name.strip(" .") != self.name  # ".." would be another folder
        # Characters that some system forbids in names of folders.
        barred = '/\\:*?"<>|'
        if outside or not self.name or not self.name.isprintable() or set(self.name) & set(barred):
            raise InputError(
                f"name = {self.name!r} cannot be the name of a folder; give one without "
                f"{barred}, and without a blank or a dot at its ends."
            )
        for load, factor in self.factors.items():
            if not (factor >= 0 and math.isfinite(factor)):
                raise InputError(
                    f"the factor of '{load}' is {factor:g}; give 0 or more, and reverse "
                    "the load if it acts in the opposite direction."
                )
        if not any(self.factors.values()):
            raise InputError(
                f"'{self.name}' has no factor above 0; give one, or remove the combination."
            )

    def of(self, loads: Sequence[Load], idle: Collection[str] = ()) -> list[Load]:
        """Return the loads that act in it.

        Args:
            loads: Loads of the case.
            idle: Names of strains and motions, which do not change a limit load.

        Raises:
            InputError: If a factor has the name of no load.
        """
        known = [called(load) for load in loads]
        for name in self.factors:
            if name in idle and name not in known:
                raise InputError(
                    f"'{name}' is not a load: temperatures, initial stresses, preloads and "
                    "given motions do not change the limit load and have no factor; "
                    "remove it from factors."
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
    """Partial factors, by which strengths are divided before any computation.

    Args:
        strength: Partial factor on yield stresses, cohesions and slopes of friction: one number for
            all bodies, or one for each body by its name. Bodies without a factor keep their
            strength.
        code: Source of the factors of strengths and combinations, as results print it.
    """

    strength: float | dict[str, float] = 1.0
    code: str = ""


def read_combinations(tables: Sequence[tuple[str, Table]]) -> list[Combination]:
    """Return the combinations of a case.

    Args:
        tables: Tables with their places.

    Raises:
        InputError: If keys are wrong, or if two combinations share a name.
    """
    found: list[Combination] = []
    for place, table in tables:
        check_filled_in(table, place)
        one = convert(table, Combination, place)
        if one.name.casefold() in [other.name.casefold() for other in found]:
            raise InputError(
                f"{place}: there are two combinations '{one.name}'; rename one of them."
            )
        found.append(one)
    return found


def designed_for(loading: Control, place: str) -> Control:
    """Return a control whose design load is the combination itself, unless it has one.

    Raises:
        InputError: If no limit load is sought, or not by the interior point method.
    """
    known: Any = loading
    if loading.divides:
        return loading
    if not hasattr(known, "design") or loading.limit_tolerance is None or loading.in_turn():
        raise InputError(
            f"{place}: combinations need limit loads or bounds; give control = 'bounds', "
            "or 'work' with until = 'limit', under [loading]."
        )
    try:
        found: Control = known if loading.design else replace(known, design=1.0)
    except (TypeError, ValueError):
        raise InputError(
            f"{place}: this control computes no load factor, by which combinations are "
            "compared; give control = 'bounds', or 'work' with until = 'limit', under "
            "[loading]."
        ) from None
    return found


def reduced(
    materials: Mapping[str, Material], table: Table, place: str
) -> tuple[dict[str, Material], str]:
    """Return materials with strengths divided by partial factors, and a sentence on it.

    Raises:
        InputError: If a body is unknown, a factor is not valid, or a material has no strength to
            reduce.
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
    """Return materials with strengths divided by partial factors, and a text on it.

    Args:
        materials: Materials by the names of their bodies.
        strength: One factor for all bodies, or one for each body by its name.

    Raises:
        InputError: If a body is unknown, a factor is not valid, or a material has no strength to
            reduce.
    """
    factors = dict.fromkeys(materials, strength) if isinstance(strength, float | int) else strength
    found: dict[str, Material] = dict(materials)
    for body, factor in factors.items():
        if body not in materials:
            raise InputError(
                f"strength names '{body}', which is not a body; {nearest(body, materials)}"
            )
        if not (factor > 0 and math.isfinite(factor)):
            raise InputError(f"strength = {factor:g} is not positive; give one above 0.")
        if factor == 1:
            continue
        weaker = getattr(materials[body], "divided_by", None)
        if weaker is None:
            raise InputError(
                f"the material of '{body}' has no strength to reduce; remove it from strength."
            )
        found[body] = weaker(factor)
    changed = {body: factor for body, factor in factors.items() if factor != 1}
    if len(set(changed.values())) == 1 and len(changed) == len(materials):
        return found, f"all strengths are divided by {next(iter(changed.values())):g}"
    parts = [f"of '{body}' by {factor:g}" for body, factor in changed.items()]
    return found, f"strengths are divided: {', '.join(parts)}" if parts else ""


def _source(code: str) -> str:
    """Return a sentence on the source of factors."""
    return (
        f"factors are those of the case, which names {code} as their source; the program "
        "does not check them"
    )
