"""Bodies with strengths that are divided by a factor, and what such a factor can be sought of."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

Rubs = TypeVar("Rubs", bound=Contact | Obstacle)
"""What has friction."""


def weakened(problem: Problem, factor: float) -> Problem:
    """The same problem with strengths divided by a factor, of contacts as well. Collective.

    Raises:
        InputError: If a body has no reduced strength.
    """
    given = problem.given
    materials = {}
    for name, material in given.materials.items():
        reduced = getattr(material, "reduced", None)
        if reduced is None:
            raise InputError(
                f"the material of '{name}' ({type(material).__name__}) has no reduced strength; a"
                " factor of safety is of materials that have one, such as those of case files."
            )
        materials[name] = reduced(factor)
    rubbing = (
        [_less(it, factor) for it in given.contacts],
        [_less(it, factor) for it in given.obstacles],
    )
    return variant(problem, materials=materials, rubbing=rubbing)


def _less(rubs: Rubs, factor: float) -> Rubs:
    """A contact or an obstacle with adhesion and friction divided by a factor."""
    tresca, coulomb = (
        None if value is None else value / factor for value in (rubs.tresca, rubs.coulomb)
    )
    return replace(rubs, tresca=tresca, coulomb=coulomb)


def check_stands(loads: Sequence[Load], elastic: bool) -> None:
    """Refuse loads that grow, and bodies of which none can yield.

    Args:
        loads: Of the bodies.
        elastic: Whether none of them can yield.

    Raises:
        InputError: Naming the first one that grows.
    """
    if elastic:
        raise InputError(
            "all bodies are elastic, and have no strength that could fall; give those that may"
            " yield another law."
        )
    for load in loads:
        if not load.constant:
            raise InputError(
                f"the load on '{load.on}' grows, and a factor of safety is that of loads that stay;"
                " make it constant, or seek its limit load."
            )
