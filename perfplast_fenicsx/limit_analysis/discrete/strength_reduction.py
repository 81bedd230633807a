"""Bodies with strengths that are divided by a factor, and what such a factor can be sought of."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import all_elastic
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.materials.nonassociated_flow import pair_of
from perfplast_fenicsx.materials.plane_stress import in_plane_stress
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

Rubs = TypeVar("Rubs", bound=Contact | Obstacle)
"""A contact or obstacle with friction."""


def weakened(problem: Problem, factor: float) -> Problem:
    """The same problem with strengths divided by a factor, of contacts as well. Collective.

    Raises:
        InputError: If a body has no reduced strength.
    """
    given = problem.given
    rubbing = (
        [_less(it, factor) for it in given.contacts],
        [_less(it, factor) for it in given.obstacles],
    )
    return variant(problem, materials=_reduced(given.materials, factor), rubbing=rubbing)


class Weakening:
    """A problem whose loads all grow, with strengths that are divided by a factor in place.

    Attributes:
        problem: With the strengths of the last factor, at first with those that are given.
    """

    def __init__(self, problem: Problem) -> None:
        """Make one with laws and friction of its own. Collective.

        Raises:
            InputError: If a load grows, a body has no reduced strength, none yields, or ground is
                of a kind of which bounds alone are known.
        """
        given: Any = problem.given
        check_stands(given.loads, all_elastic(given.materials.values()))
        if pair_of(given.materials) is not None:
            raise InputError(
                "ground with nonassociated = 'radenkovic' has no curve of F over work, as bounds"
                " alone are known of it; leave path out, or give nonassociated = 'davis-b'."
            )
        self._materials = given.materials
        self.problem = variant(
            problem,
            materials=_reduced(given.materials, 1.0),
            loads=[replace(load, constant=False) for load in given.loads],
            rubbing=(given.contacts, given.obstacles),
        )
        friction = self.problem.friction
        self._adhesion, self._coulomb = friction.adhesion.copy(), friction.coulomb.copy()

    def divide(self, factor: float) -> None:
        """Divide the strengths that are given by a factor. Not collective.

        Raises:
            InputError: If a body then has another law.
        """
        problem, mesh = self.problem, self.problem.tagged_mesh
        materials: Mapping[str, Material] = _reduced(self._materials, factor)
        if mesh.is_thin:
            materials = in_plane_stress(materials)
        laws = {type(on.law): on for on in problem.laws}
        for name, material in materials.items():
            on = laws.get(material.law)
            if on is None:
                raise InputError(
                    f"the tensile strength of '{name}' is below the apex of its cone with strengths"
                    f" divided by {factor:.6g}, and not before; give a smaller one, or leave it out"
                    " for this curve."
                )
            points = problem.Q.dofmap.list[mesh.cells(name)].ravel()
            for key, number in material.parameters().items():
                on.numbers[key].x.array[points] = number
        friction = problem.friction
        friction.adhesion[:] = self._adhesion / factor
        friction.coulomb[:] = self._coulomb / factor
        friction.bound[:] = friction.adhesion


def _reduced(materials: Mapping[str, Any], factor: float) -> dict[str, Material]:
    """Materials of volumes with strengths divided by a factor."""
    found = {}
    for name, material in materials.items():
        reduced = getattr(material, "reduced", None)
        if reduced is None:
            raise InputError(
                f"the material of '{name}' ({type(material).__name__}) has no reduced strength; a"
                " factor of safety is of materials that have one, such as those of case files."
            )
        found[name] = reduced(factor)
    return found


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
            "all bodies are elastic or rigid, and have no strength that could fall; give those that"
            " may yield another law."
        )
    for load in loads:
        if not load.constant:
            raise InputError(
                f"the load on '{load.on}' grows, and a factor of safety is that of loads that stay;"
                " make it constant, or seek its limit load."
            )
