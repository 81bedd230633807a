"""Declare the friction of a contact or an obstacle."""

import math

from perfplast_fenicsx.errors import InputError


class FrictionTerms:
    """The friction of a contact or an obstacle.

    Attributes:
        tresca: Shear stress at which slip begins, whatever the pressure.
        coulomb: Coefficient of friction, multiplied by the pressure.
        associated: Whether slip follows the normal of the friction cone, so that surfaces separate
            by ``coulomb`` times the slip.
        reduced: Whether a factor of safety divides it.
    """

    tresca: float | None
    coulomb: float | None
    associated: bool = False
    reduced: bool = True

    def __post_init__(self) -> None:
        """Refuse invalid friction.

        Raises:
            InputError: If friction is negative or not finite. If friction is associated but does
                not depend on the pressure. If ``reduced = false`` is given without friction.
        """
        if self.associated and not self.coulomb:
            raise InputError(
                "associated = true needs friction that grows with the pressure; give "
                "coulomb, a number above zero, or remove associated."
            )
        if not (self.reduced or self.rubs):
            raise InputError(
                "reduced = false applies only to friction, which a factor of safety "
                "divides; give tresca or coulomb, or remove reduced."
            )
        for key, value in (("tresca", self.tresca), ("coulomb", self.coulomb)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(
                    f"{key} = {value} is not a valid friction; give zero or more, or remove it."
                )

    @property
    def rubs(self) -> bool:
        """Return whether there is friction."""
        return bool(self.tresca or self.coulomb)
