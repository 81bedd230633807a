"""The friction of a contact or an obstacle, as it is declared."""

import math

from perfplast_fenicsx.errors import InputError


class FrictionTerms:
    """The friction of a contact or an obstacle.

    Attributes:
        tresca: Shear stress that slip has to overcome, whatever the pressure.
        coulomb: Coefficient of friction: so many times the pressure comes to it.
        associated: Whether slip follows the normal of friction's cone, so that surfaces part by
            ``coulomb`` times what they slip.
        reduced: Whether a factor of safety divides it.
    """

    tresca: float | None
    coulomb: float | None
    associated: bool = False
    reduced: bool = True

    def __post_init__(self) -> None:
        """Refuse invalid friction.

        Raises:
            InputError: If friction is negative or not finite. If slip parts surfaces, and no
                friction follows the pressure. If none is there that could stay as it is.
        """
        if self.associated and not self.coulomb:
            raise InputError(
                "associated = true needs friction that grows with the pressure; give coulomb, a"
                " number above zero, or leave associated out."
            )
        if not (self.reduced or self.rubs):
            raise InputError(
                "reduced = false applies to friction, which a factor of safety divides; give tresca"
                " or coulomb, or leave reduced out."
            )
        for key, value in (("tresca", self.tresca), ("coulomb", self.coulomb)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(
                    f"{key} = {value} is not a valid friction; give zero or more, or leave it out."
                )

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return bool(self.tresca or self.coulomb)
