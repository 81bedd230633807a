"""Declare interactions of two named surfaces: contact with its friction, and ties."""

import math
from dataclasses import dataclass
from typing import Literal

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


@dataclass(frozen=True)
class Contact(FrictionTerms):
    """Contact of two surfaces, without friction by default.

    The surfaces may touch or be apart. They may be flat, curved or have edges, and their nodes need
    not match.

    Args:
        primary: Physical name of the first surface; the normal points out of its body.
        secondary: Physical name of the second surface.
        gap: Initial gap g (length): a number or a formula in x, y, z of the primary surface. By
            default it is measured along the normal.
        interference: Whether a negative gap is intended, as in a press fit: the bodies are too
            large by this amount and push each other apart.
        constant: Whether the overlap is the same at any load factor. Otherwise control =
            "displacement", or the factor of stages that name it, multiplies the overlap; positive
            gaps do not change.
        formulation: "nodes" for pairs of opposite nodes, where the order of the surfaces does not
            affect the result; "mortar" for weighted means of the jump, which needs no opposite
            nodes. The default is "nodes" where nodes match and "mortar" elsewhere.
        hosts: The surface, "primary" or "secondary", whose nodes carry mortar contact. The default
            is the surface that the other one covers, or the one with smaller facets.
        tresca: Tresca's friction: the shear stress, not negative, at which slip begins. It does not
            depend on the pressure and also acts where the surfaces are apart.
        coulomb: Coulomb's coefficient of friction μ, not negative. In addition, ``tresca`` is an
            adhesion, the shear stress at which slip begins without pressure.
        associated: Whether slip follows the normal of the friction cone, as in a dilating joint:
            the surfaces separate by μ times the slip. Only bounds of the body support it.
        reduced: Whether F of ``control = "strength"`` divides its friction, as by default.
        name: Name of a growing overlap in stages; by default the name of the primary surface.

    Raises:
        InputError: If friction is negative, or if an overlap is to grow that does not exist.
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


@dataclass(frozen=True)
class Tie:
    """Two surfaces that move together in all directions; their nodes need not match.

    Args:
        primary: Physical name of the first surface.
        secondary: Physical name of the second surface.
        hosts: The surface, "primary" or "secondary", whose nodes follow the other. The default is
            the surface that the other one covers, or the one with smaller facets.
    """

    primary: str
    secondary: str
    hosts: Literal["primary", "secondary"] | None = None


INTERFACES: dict[str, type[Contact]] = {"friction": Contact}
"""Dataclasses whose fields are the keys of ``[[contact]]`` besides ``interface``.

Each is a :class:`Contact`. It provides the strength of
the interface as ``tresca`` (stress) and ``coulomb``, which levels, limit loads, strict bounds,
proofs and reports read. A class with other parameters computes these two from its own numbers.
"""
