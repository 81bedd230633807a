"""Check that a problem has a limit load, and that the chosen method can find this load."""

from collections.abc import Iterable

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import all_elastic
from perfplast_fenicsx.materials.law import carries_any_load
from perfplast_fenicsx.materials.nonassociated_flow import check_flows
from perfplast_fenicsx.problem.declared.loads import PorePressure
from perfplast_fenicsx.problem.judged.state import check_slip_is_true
from perfplast_fenicsx.problem.problem import Problem


def check_tolerance(rtol: float) -> None:
    """Check the tolerance, a relative difference between bounds.

    Raises:
        InputError: If the tolerance is not between 0 and 1.
    """
    if not 0 < rtol < 1:
        raise InputError(f"limit_tolerance = {rtol} is not between 0 and 1; try 1e-4.")


def check_something_yields(materials: Iterable[object], joints: bool) -> None:
    """Check that some body can yield, or that joints may limit the load.

    Args:
        materials: Materials of the bodies.
        joints: Whether there are contacts or obstacles that may limit the load.

    Raises:
        InputError: If no body can yield and there are no such joints.
    """
    if all_elastic(materials) and not joints:
        raise InputError(
            "nothing can yield: all bodies are elastic or rigid, so there is no limit load; give a "
            "law with a yield stress to the bodies that may collapse, or bound the load of bodies "
            "that collapse at their contacts (control = 'bounds')."
        )


def check_friction_has_limits(problem: Problem) -> None:
    """Check that a limit theorem holds for all friction.

    Raises:
        InputError: If any friction is Coulomb's.
    """
    if problem.friction.follows_pressure:
        check_slip_is_true(problem)
        raise InputError(
            "with Coulomb's friction (coulomb = ...) no limit theorem holds, so the interior "
            "point method cannot be used; search along a loading path (control = 'work', until = "
            "'limit', limit_method = 'path'), bound the load by Drucker's pair (control = "
            "'bounds'), or give tresca = ... instead."
        )


def check_bodies_have_limits(problem: Problem) -> None:
    """Check that no body hardens, and that no material represents a pair that only bounds can use.

    Raises:
        InputError: If a body hardens, or if the material of ground stands for a pair of materials
            that only bounds can use.
    """
    check_flows(problem.given.materials)
    for name, material in problem.given.materials.items():
        if carries_any_load(material):
            raise InputError(
                f"the material of '{name}' hardens, so this body can carry any load and there is "
                "no limit load; give load values, or a perfectly plastic law."
            )


def check_flat_guides(problem: Problem) -> None:
    """Check that no support prescribes motions of a curved surface along its normals.

    Raises:
        InputError: If a support moves such a surface, because bounds do not support this motion.
            The message names the first surface.
    """
    guides = problem.guides
    for surface, curved in zip(guides.surfaces, guides.curved, strict=True):
        if curved:
            raise InputError(
                f"the support on '{surface}' moves a curved surface along its normals, which "
                "change from node to node, and strict bounds do not support such a motion; give "
                "letters such as 'xy' as components, or compute levels (control = 'displacement')."
            )


def collapses_by_loads(problem: Problem) -> bool:
    """Return whether there are loads, and no growing motion of supports or obstacles. Collective.

    Constant displacements, overlaps and initial strains do no work at collapse: supports do not
    move in a mechanism, and self-equilibrated stresses do no work on its strain rates.
    """
    return _is_loaded(problem) and not problem.motion.driven


def _is_loaded(problem: Problem) -> bool:
    return problem.loads.grows() or problem.loads.has_dead()


def check_loads(problem: Problem) -> None:
    """Check that there is a load, and that no prescribed motion grows. Collective.

    Raises:
        InputError: If ζ moves supports or obstacles, or if there is no load.
    """
    what = "strict bounds and the interior point method need loads that grow"
    if problem.motion.driven:
        raise InputError(
            f"the load factor moves supports or obstacles, but {what}; remove these motions, or "
            "set constant = true for the supports."
        )
    if not _is_loaded(problem):
        raise InputError(f"there is no load, but {what}; give a load.")


def idle_pores(problem: Problem) -> list[str]:
    """Return a note if pore pressures do not affect the bounds in axisymmetry."""
    pores = any(isinstance(load, PorePressure) for load in problem.given.loads)
    if not (pores and problem.tagged_mesh.axisymmetric):
        return []
    return ["pore pressures do no work if bodies preserve their volume, and are ignored"]


def ignored(problem: Problem) -> list[str]:
    """Return a clause on the parts of a problem that do not affect limit loads. Collective."""
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
        f"{', '.join(names)} remain constant, and do no work at collapse: they do not change limit "
        "loads of perfectly plastic bodies, and are ignored"
    ]
