"""Divide the strengths of bodies by a factor, and check that a problem has strengths to divide."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import all_elastic
from perfplast_fenicsx.materials.law import Material, in_plane_stress
from perfplast_fenicsx.materials.nonassociated_flow import pair_of
from perfplast_fenicsx.problem.assembled.law_on_cells import set_parameters
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.problem import Problem, variant

Rubs = TypeVar("Rubs", bound=Contact | Obstacle)
"""A contact or obstacle with friction."""


def weakened(problem: Problem, factor: float) -> Problem:
    """Return the problem with the strengths of bodies and contacts divided by a factor. Collective.

    Strengths of materials, contacts and obstacles with ``reduced = false`` do not change.

    Raises:
        InputError: If the strength of a body cannot be divided.
    """
    given = problem.given
    rubbing = (
        [_less(it, factor) for it in given.contacts],
        [_less(it, factor) for it in given.obstacles],
    )
    return variant(problem, materials=_reduced(given.materials, factor), rubbing=rubbing)


class Weakening:
    """A problem whose loads all grow, and whose strengths can be divided by a factor in place.

    Attributes:
        problem: The problem with the strengths divided by the last factor; initially with the given
            strengths.
    """

    def __init__(self, problem: Problem) -> None:
        """Create the problem with its own copies of laws and friction. Collective.

        Raises:
            InputError: If a load grows, if the strength of a body cannot be divided, if no body
                yields, or if only bounds are known for a kind of ground.
        """
        given: Any = problem.given
        rubbing = [*given.contacts, *given.obstacles]
        check_stands(given.loads, given.materials, rubbing)
        if all_elastic(given.materials.values()):
            raise InputError(
                "no body can yield, and blocks have no curve of F over work, because they do not "
                "deform; remove path."
            )
        if pair_of(given.materials) is not None:
            raise InputError(
                "ground with nonassociated = 'radenkovic' has no curve of F over work, because "
                "only bounds are known for it; remove path, or give nonassociated = 'davis-b'."
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
        flags = np.array([it.reduced for it in rubbing], dtype=np.bool_)
        self._divided = flags[problem.constraints.surface[friction.pair]]

    def divide(self, factor: float) -> None:
        """Set the strengths to the given strengths divided by a factor. Collective.

        Raises:
            InputError: If the factor changes the law of a body.
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
                    f"the tensile strength of '{name}' falls below the apex of its cone when "
                    f"strengths are divided by {factor:.6g}, and the curve of F cannot continue "
                    "there; give a smaller tensile strength, or remove it."
                )
            set_parameters(mesh, {name: material}, on.numbers)
        friction = problem.friction
        by = np.where(self._divided, factor, 1.0)
        friction.adhesion[:] = self._adhesion / by
        friction.coulomb[:] = self._coulomb / by
        friction.bound[:] = friction.adhesion


def _reduced(materials: Mapping[str, Any], factor: float) -> dict[str, Material]:
    """Return the materials with strengths divided by a factor, unless ``reduced = false``.

    Raises:
        InputError: If the strength of a material cannot be divided.
    """
    found = {}
    for name, material in materials.items():
        divided_by = getattr(material, "divided_by", None)
        if divided_by is None:
            raise InputError(
                f"the material of '{name}' ({type(material).__name__}) has no strength that can be "
                "divided; for a factor of safety give a material with the method divided_by, such "
                "as those in perfplast_fenicsx.materials."
            )
        found[name] = divided_by(factor if is_divided(material) else 1.0)
    return found


def _less(rubs: Rubs, factor: float) -> Rubs:
    """Return a contact or obstacle, its friction divided by a factor unless ``reduced = false``."""
    if not rubs.reduced:
        return rubs
    tresca, coulomb = (value and value / factor for value in (rubs.tresca, rubs.coulomb))
    return replace(rubs, tresca=tresca, coulomb=coulomb)


def is_divided(one: object) -> bool:
    """Return whether a factor of safety divides the strength of a material or a contact."""
    return bool(getattr(one, "reduced", True))


def divided_strengths(
    materials: Mapping[str, object], rubbing: Sequence[Contact | Obstacle]
) -> list[str]:
    """Return the strengths that a factor of safety divides, as phrases.

    See :func:`kept_strengths` for the arguments.
    """
    bodies = {name: it for name, it in materials.items() if is_divided(it)}
    told = [f"the strength of '{name}'" for name, it in bodies.items() if not all_elastic([it])]
    return told + [_friction_on(it) for it in rubbing if it.rubs and is_divided(it)]


def _friction_on(it: Contact | Obstacle) -> str:
    both = (it.primary, it.secondary) if isinstance(it, Contact) else (it.on,)
    return f"the friction on {' and '.join(repr(name) for name in both)}"


def kept_strengths(
    materials: Mapping[str, object], rubbing: Sequence[Contact | Obstacle]
) -> list[str]:
    """Return the strengths that ``reduced = false`` keeps unchanged, as phrases.

    Args:
        materials: Materials of the bodies by name.
        rubbing: Contacts and obstacles.
    """
    told = [f"the strength of '{name}'" for name, it in materials.items() if not is_divided(it)]
    return told + [_friction_on(it) for it in rubbing if not is_divided(it)]


def check_all_divided(
    materials: Mapping[str, Material],
    contacts: Sequence[Contact],
    obstacles: Sequence[Obstacle],
) -> None:
    """Check, for a run without a factor of safety, that nothing has ``reduced = false``.

    Raises:
        InputError: If a material or contact has ``reduced = false``; the message names the first.
    """
    if kept := kept_strengths(materials, [*contacts, *obstacles]):
        raise InputError(
            f"reduced = false for {kept[0]} applies only to a factor of safety, which this control "
            "does not compute; give control = 'strength', or remove reduced."
        )


def check_stands(
    loads: Sequence[Load],
    materials: Mapping[str, object],
    rubbing: Sequence[Contact | Obstacle],
) -> None:
    """Check that all loads are constant, and that there is a strength to divide.

    Args:
        loads: Loads of the bodies.
        materials: Materials of the bodies by name.
        rubbing: Contacts and obstacles.

    Raises:
        InputError: If a load grows, or if F divides no strength; the message gives the first
            growing load, or the reason.
    """
    rubs = any(it.rubs and is_divided(it) for it in rubbing)
    if all_elastic(materials.values()) and not rubs:
        raise InputError(
            "all bodies are elastic or rigid, and no contact has friction that F divides, so "
            "there is no strength to reduce; give another law to bodies that may yield, or give "
            "contacts friction (coulomb or tresca)."
        )
    falls = [it for it in materials.values() if is_divided(it) and not all_elastic([it])]
    if not falls and not rubs:
        raise InputError(
            "reduced = false leaves no strength that a factor of safety could divide; remove it "
            "from the bodies and contacts that may fail."
        )
    for load in loads:
        if not load.constant:
            raise InputError(
                f"the load on '{load.on}' grows, but a factor of safety needs constant loads; set "
                "constant = true for this load, or compute a limit load instead."
            )
