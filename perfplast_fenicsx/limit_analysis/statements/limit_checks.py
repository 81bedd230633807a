"""Refuse problems without a limit load, or without one that a method can find."""

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import carries_any_load
from perfplast_fenicsx.materials.nonassociated_flow import check_flows
from perfplast_fenicsx.problem.declared.loads import PorePressure
from perfplast_fenicsx.problem.judged.state import check_slip_is_true
from perfplast_fenicsx.problem.problem import Problem


def check_tolerance(rtol: float) -> None:
    """Refuse an invalid relative difference of bounds.

    Raises:
        InputError: If it is not between 0 and 1.
    """
    if not 0 < rtol < 1:
        raise InputError(f"limit_tolerance = {rtol} is not between 0 and 1; try 1e-4.")


def check_friction_has_limits(problem: Problem) -> None:
    """Refuse friction for which no limit theorem holds.

    Raises:
        InputError: If any friction is Coulomb's.
    """
    if problem.friction.follows_pressure:
        check_slip_is_true(problem)
        raise InputError(
            "with Coulomb's friction (coulomb = ...) no limit theorem holds, so the interior "
            "point method cannot be used; search along a loading path (control = 'work', "
            "until = 'limit', limit_method = 'path'), bound it by Drucker's pair "
            "(control = 'bounds'), or give tresca = ... instead."
        )


def check_bodies_have_limits(problem: Problem) -> None:
    """Refuse bodies that carry any load, or for which only bounds of the limit load are known.

    Raises:
        InputError: If a body hardens, or is ground that represents a pair of materials.
    """
    check_flows(problem.given.materials)
    for name, material in problem.given.materials.items():
        if carries_any_load(material):
            raise InputError(
                f"the material of '{name}' hardens, so that bodies carry any load, and there is no"
                " limit load; give load values, or a law that is perfectly"
                " plastic."
            )


def check_flat_guides(problem: Problem) -> None:
    """Refuse curved surfaces that move along their normals, which bounds do not support.

    Raises:
        InputError: Naming the first such surface.
    """
    guides = problem.guides
    for surface, curved in zip(guides.surfaces, guides.curved, strict=True):
        if curved:
            raise InputError(
                f"the support on '{surface}' moves a curved surface along its normals, which change"
                " from node to node, and strict bounds do not support that; give letters as"
                " components, or ask for levels (control = 'displacement')."
            )


def collapses_by_loads(problem: Problem) -> bool:
    """Return whether only loads do work at collapse, and there are any. Collective.

    Constant displacements, overlaps and strains do none. Supports are at rest in a mechanism, and
    stresses in equilibrium without loads do no work on its strain rates.
    """
    return _is_loaded(problem) and not problem.motion.driven


def _is_loaded(problem: Problem) -> bool:
    return problem.loads.grows() or problem.loads.has_dead()


def check_loads(problem: Problem) -> None:
    """Refuse motions that grow, and bodies without loads. Collective.

    Raises:
        InputError: If ζ moves supports or obstacles, or there is no load.
    """
    what = "strict bounds and the interior point method are for loads"
    if problem.motion.driven:
        raise InputError(
            f"the load factor moves supports or obstacles, and {what}; let these rest."
        )
    if not _is_loaded(problem):
        raise InputError(f"there is no load, and {what}; give a load.")


def idle_pores(problem: Problem) -> list[str]:
    """Return a note if pore pressures change no bounds of bodies of revolution."""
    pores = any(isinstance(load, PorePressure) for load in problem.given.loads)
    if not (pores and problem.tagged_mesh.axisymmetric):
        return []
    return ["pore pressures do no work where volumes are preserved, and are ignored"]


def ignored(problem: Problem) -> list[str]:
    """Return a sentence on the parts of a problem that change no limit load. Collective."""
    bolts = problem.shanks.bolts
    found = {
        "displacements of supports": problem.motion.moves_supports,
        "overlaps": problem.interferes,
        "temperatures and initial stresses": len(problem.given.initial) > len(bolts),
        "preloads of bolts": bool(bolts),
    }
    names = [name for name, there in found.items() if there]
    if not names:
        return []
    return [
        f"{', '.join(names)} stay, and do no work at collapse: they change no limit load of perfect"
        " plasticity, and are ignored"
    ]
