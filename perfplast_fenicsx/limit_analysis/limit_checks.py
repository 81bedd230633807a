"""What has no limit load, or none that a method can find, and is refused."""

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.hardening import Hardening
from perfplast_fenicsx.materials.plastic_flow import Flow
from perfplast_fenicsx.problem.problem import Problem


def check_tolerance(rtol: float) -> None:
    """Refuse what bounds of a limit load cannot differ by.

    Raises:
        InputError: If it is not between 0 and 1.
    """
    if not 0 < rtol < 1:
        raise InputError(f"limit_tolerance = {rtol} is not between 0 and 1; try 1e-4.")


def check_friction_has_limits(problem: Problem) -> None:
    """Refuse friction that no limit theorem holds for.

    Raises:
        InputError: If any is Coulomb's.
    """
    if problem.friction.follows_pressure:
        raise InputError(
            "with Coulomb's friction (coulomb = ...) no limit theorem holds; give values of the"
            " load factor or the work, beside which Drucker's bounds of the limit load are told, or"
            " tresca = ... in its place."
        )


def check_bodies_have_limits(problem: Problem) -> None:
    """Refuse bodies that carry any load.

    Raises:
        InputError: If one of them hardens.
    """
    for name, material in problem.given.materials.items():
        body = material.body if isinstance(material, Flow) else material
        if isinstance(body, Hardening):
            raise InputError(
                f"the material of '{name}' hardens, so that bodies carry any load, and there is no"
                " limit load to be sought; load by given values, or give VonMises in its place."
            )


def check_proportional(problem: Problem) -> None:
    """Refuse loads and motions of which some do not grow with the load factor. Collective.

    Raises:
        InputError: If supports or obstacles move, loads are constant, or bodies are strained at
            first.
    """
    if not problem.is_proportional():
        raise InputError(
            "supports move, loads are constant or bodies are strained at first, and strict bounds"
            " and the interior point method are for loads that all grow; give method = 'path', or"
            " leave out what does not grow with the load factor."
        )
