"""Angles of dilatancy other than that of friction, which associated laws do not know."""

import math

from perfplast_fenicsx.errors import InputError


def check_dilatancy(dilatancy: float | None, friction: float, cohesion: float) -> None:
    """Refuse an angle of dilatancy that is not that of friction.

    The refusal has the cohesion and the angle of friction of E. H. Davis (Theories of plasticity
    and the failure of soil masses, in: I. K. Lee (ed.), Soil Mechanics: Selected Topics, London
    1968), by which associated ground stands for such ground: βc and β tan φ with β = cos φ cos ψ/
    (1 − sin φ sin ψ).

    Args:
        dilatancy: ψ (degrees), if it is given.
        friction: φ (degrees).
        cohesion: C (stress).

    Raises:
        InputError: If they differ.
    """
    if dilatancy is None:
        return
    if not 0 <= dilatancy <= friction:
        raise InputError(
            f"dilatancy_angle = {dilatancy:g} is not between 0 and friction_angle = {friction:g};"
            " leave it out, and ground dilates by its angle of friction."
        )
    if dilatancy < friction:
        phi, psi = math.radians(friction), math.radians(dilatancy)
        beta = math.cos(phi) * math.cos(psi) / (1 - math.sin(phi) * math.sin(psi))
        angle = math.degrees(math.atan(beta * math.tan(phi)))
        raise InputError(
            f"dilatancy_angle = {dilatancy:g} is less than friction_angle = {friction:g}, but"
            " flow is associated here, so leave it out; for Davis' estimate, which is no bound,"
            f" give cohesion = {beta * cohesion:.6g} and friction_angle = {angle:.6g}."
        )
