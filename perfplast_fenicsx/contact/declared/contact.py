"""Declare interactions of two named surfaces: contacts with their friction, and ties."""

import math
from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.errors import InputError


class FrictionTerms:
    """The friction of a contact or an obstacle.

    Attributes:
        tresca: Shear stress at which slip begins, independent of the pressure.
        coulomb: Coefficient of friction, which multiplies the pressure.
        associated: Whether slip follows the normal of the friction cone, so that surfaces separate
            by ``coulomb`` times the slip.
        reduced: Whether a factor of safety divides the friction.
    """

    tresca: float | None
    coulomb: float | None
    associated: bool = False
    reduced: bool = True

    def __post_init__(self) -> None:
        """Refuse invalid friction.

        Raises:
            InputError: If friction is negative or not finite, if friction is associated but does
                not depend on the pressure, or if ``reduced = false`` is given without friction.
        """
        if self.associated and not self.coulomb:
            raise InputError(
                "associated = true needs friction that grows with the pressure; give "
                "coulomb a number above zero, or remove associated."
            )
        if not (self.reduced or self.rubs):
            raise InputError(
                "reduced = false has no effect without friction, which a factor of safety would "
                "divide; give tresca or coulomb, or remove reduced."
            )
        for key, value in (("tresca", self.tresca), ("coulomb", self.coulomb)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(f"{key} = {value} is not valid; give a number >= 0, or remove it.")

    @property
    def rubs(self) -> bool:
        """Return whether the contact or obstacle has friction."""
        return bool(self.tresca or self.coulomb)


@dataclass(frozen=True)
class Contact(FrictionTerms):
    """Contact of two surfaces; by default without friction.

    The surfaces may touch or be apart. They may be flat or curved, and may have edges. Their nodes
    need not match.

    Args:
        primary: Physical name of the first surface; the normal points out of its body.
        secondary: Physical name of the second surface.
        gap: Initial gap g (length): a number, or a formula in x, y, z at the primary surface. By
            default the gap is measured along the normal.
        interference: Whether a negative gap is intended, as in a press fit: the bodies initially
            overlap by this amount and push each other apart.
        constant: Whether the overlap is the same at any load factor. If not, the load factor of
            ``control = "displacement"``, or the factor of the stages that name the contact,
            multiplies the overlap; positive gaps do not change.
        formulation: "nodes" uses pairs of opposite nodes, and the order of the surfaces does not
            affect the result. "mortar" uses weighted means of the jump, and needs no opposite
            nodes. By default "nodes" if the nodes match, and "mortar" if not.
        hosts: The surface, "primary" or "secondary", whose nodes have the multipliers of mortar
            contact. By default the surface that the other surface covers, or the surface with
            smaller facets.
        tresca: Tresca's friction: the shear at which slip begins, not negative (stress). It does
            not depend on the pressure, and it also acts where the surfaces are apart.
        coulomb: Coulomb's coefficient of friction μ, not negative. Together with it, ``tresca`` is
            an adhesion: the shear stress at which slip begins without pressure.
        associated: Whether slip follows the normal of the friction cone, as in a dilating joint:
            the surfaces separate by μ times the slip. Only bounds of the body support this.
        reduced: Whether the factor F of ``control = "strength"`` divides the friction of the
            contact; by default it does.
        name: Name by which stages refer to a growing overlap; by default the name of the primary
            surface.

    Raises:
        InputError: If the friction is not valid, or if ``constant`` is false without an overlap.
    """

    primary: str
    secondary: str
    gap: float | str | None = None
    interference: bool = False
    formulation: Literal["nodes", "mortar"] | None = None
    hosts: Literal["primary", "secondary"] | None = None
    tresca: float | None = None
    coulomb: float | None = None
    constant: bool = True
    name: str = ""
    associated: bool = False
    reduced: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.constant or self.interference):
            raise InputError(
                f"the contact of '{self.primary}' and '{self.secondary}' has constant = "
                "false, but no overlap that could grow; give interference = true, or "
                "remove constant."
            )

    @property
    def on(self) -> str:
        """Return the surface that identifies the contact if it has no name."""
        return self.primary

    @property
    def label(self) -> str:
        """Return the name of the contact among the sources of contact rows."""
        return f"contact {self.primary} {self.secondary}"


@dataclass(frozen=True)
class Tie:
    """Two surfaces that move together in all directions; their nodes need not match.

    Args:
        primary: Physical name of the first surface.
        secondary: Physical name of the second surface.
        hosts: The surface, "primary" or "secondary", whose nodes follow the other surface. By
            default the surface that the other surface covers, or the surface with smaller facets.
    """

    primary: str
    secondary: str
    hosts: Literal["primary", "secondary"] | None = None


INTERFACES: dict[str, type[Contact]] = {"friction": Contact}
"""Dataclasses for the values of ``interface``; their fields are the other keys of ``[[contact]]``.

Each dataclass is a :class:`Contact`. It provides the strength of the interface as ``tresca``
(stress) and ``coulomb``. Levels, limit loads, strict bounds, proofs and reports use only these two.
A class with other parameters computes them from its own numbers.
"""
