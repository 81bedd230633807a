"""What may be said of the friction of a contact or an obstacle."""

import math

from perfplast_fenicsx.errors import InputError


def check_friction(
    tresca: float | None, coulomb: float | None, without_name: str | None = None
) -> None:
    """Refuse friction that is none.

    Args:
        tresca: Shear stress that slip has to overcome.
        coulomb: Coefficient of friction.
        without_name: Surface of an obstacle that has no name of its own.

    Raises:
        InputError: If friction is negative or not finite, of both kinds, or on an obstacle without
            a name.
    """
    for key, value in (("tresca", tresca), ("coulomb", coulomb)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise InputError(
                f"{key} = {value} is no friction; give zero or more, or leave it out for none."
            )
    if tresca is not None and coulomb is not None:
        raise InputError(
            f"tresca = {tresca} and coulomb = {coulomb} are two laws of friction for one surface;"
            " give one of them."
        )
    if without_name is not None and (tresca or coulomb):
        raise InputError(
            f"the obstacle at '{without_name}' has friction but no name, by which results tell its"
            " force; give name = ..., or leave the friction out."
        )
