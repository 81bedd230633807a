"""Declare the stages of a loading history, and check the names in them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError, check_magnitude, nearest
from perfplast_fenicsx.problem.declared.initial import Bolt, Initial, Temperature
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support

Mover = Support | RigidSurface | Obstacle | Contact
"""Objects with a prescribed motion; a contact is one of them if its overlap grows."""


@dataclass(frozen=True)
class Stage:
    """A part of a loading history, in which factors change linearly with time.

    Args:
        factors: Factors of loads, changes of temperature and prescribed motions at the end of the
            stage, by their names, or by ``on`` for objects without a name. All factors start at
            zero. A factor that a stage does not name keeps its value. Constant loads and motions,
            and temperatures that no stage names, act in full all the time. The factor of a bolt
            times its preload is the force to which the stage tightens or loosens it, while the
            other loads act. The factor of a bolt starts at 1; in stages that do not name the bolt,
            its shortening does not change.
        steps: Number of levels in the stage, 1 to 1 000 000. If stress directions rotate, more
            levels make the result more accurate.
        name: Name of the stage in results.

    Raises:
        InputError: If a number is out of its range.
    """

    factors: dict[str, float]
    steps: int = 1
    name: str = ""

    def __post_init__(self) -> None:
        whole = isinstance(self.steps, int) and not isinstance(self.steps, bool)
        # Largest number of levels in a stage. With more levels, successive times would be too close
        # to distinguish.
        most_steps = 1_000_000
        if not (whole and 1 <= self.steps <= most_steps):
            raise InputError(
                f"steps = {self.steps!r} is not a valid number of levels; give 1 to {most_steps}."
            )
        for name, factor in self.factors.items():
            if not math.isfinite(factor):
                raise InputError(
                    f"the factor of '{name}' is {factor}, which is not finite; give a finite "
                    "number."
                )
            check_magnitude(f"the factor of '{name}'", factor)


def called(given: Load | Temperature | Mover) -> str:
    """Return the name by which stages refer to ``given``."""
    return given.name or given.on


def follows(mover: Mover) -> bool:
    """Return whether ζ or a factor of stages multiplies the motion or overlap of ``mover``."""
    if isinstance(mover, Support | RigidSurface):
        return mover.moves and not mover.constant
    if isinstance(mover, Contact):
        return not mover.constant
    return any(mover.move)


def check_stages(
    stages: Sequence[Stage],
    loads: Sequence[Load],
    initial: Iterable[Initial],
    movers: Sequence[Mover],
) -> None:
    """Check that the names in stages match the objects that factors multiply.

    Args:
        stages: The stages in order.
        loads: The loads.
        initial: Initial strains, including temperatures and bolts.
        movers: Supports, rigid surfaces, obstacles and contacts.

    Raises:
        InputError: If a stage names something other than temperatures, bolts, and loads and motions
            that are not constant. Also raised if a load or motion that is not constant is in no
            stage, if two kinds of objects share a name, or if a bolt would push.
    """
    initial = list(initial)
    loaded = {called(load) for load in loads if not load.constant}
    warmed = {called(one) for one in initial if isinstance(one, Temperature)}
    moved = {called(one) for one in movers if follows(one)}
    bolts = {one.called for one in initial if isinstance(one, Bolt)}
    names = loaded | warmed | moved | bolts
    still = {called(a) for a in movers if isinstance(a, Support | RigidSurface) and a.moves}
    still |= {called(a) for a in movers if isinstance(a, Contact) and a.interference}
    constant = {called(load) for load in loads if load.constant} | still - names
    named = [(number, name) for number, stage in enumerate(stages, 1) for name in stage.factors]
    for number, name in named:
        if name in constant:
            raise InputError(
                f"stage {number} has a factor for '{name}', which is constant; remove the "
                "factor, or set constant = false."
            )
        if name not in names:
            raise InputError(
                f"stage {number} has a factor for '{name}', but no load, change of temperature, "
                f"bolt or motion has this name; {nearest(name, names)}"
            )
        if name in bolts and name in loaded | warmed | moved | constant:
            raise InputError(
                f"stage {number} has a factor for '{name}', which is the name of a bolt "
                "and of another object; rename one of them."
            )
        if name in bolts and not stages[number - 1].factors[name] > 0:
            raise InputError(
                f"stage {number} has the factor {stages[number - 1].factors[name]:g} for "
                f"the bolt '{name}', but its force, the factor times the preload, must be "
                "tensile; give a number above 0."
            )
        if name in moved & (loaded | warmed):
            raise InputError(
                f"stage {number} has a factor for '{name}', which is the name of a load or "
                "temperature and of a motion; rename one of them."
            )
    missing = (loaded | moved) - {name for _, name in named}
    for name in sorted(missing):
        what, verb = ("load", "act") if name in loaded else ("motion of", "take place")
        raise InputError(
            f"the {what} '{name}' is in no stage, so it would never {verb}; give it a factor "
            "(0 if you need only its work or force), or set constant = true."
        )
