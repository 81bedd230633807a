"""Contact of two named surfaces."""

from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.contact.declared.friction_terms import FrictionTerms
from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class Contact(FrictionTerms):
    """Contact of two surfaces, without friction unless it is given.

    They may touch or be apart, flat, curved or with edges, and their nodes need not match.

    Args:
        primary: Physical name of the first surface; the normal points out of its body.
        secondary: Physical name of the second surface.
        gap: Initial gap g (length) between them: a number or a formula in x, y, z of the primary
            surface; without it, it is measured along the normal.
        interference: Whether a negative gap is meant, as in a press fit: bodies are made so much
            too large, and push each other apart.
        constant: Whether the overlap is the same at any load factor. If not, control =
            "displacement", or the factor of stages that name it, multiplies it; gaps are as given.
        formulation: "nodes" for pairs of opposite nodes, where which of the surfaces is called
            primary does not matter for the result; "mortar" for weighted means of the jump, which
            needs no opposite nodes; without it, nodes where they match, and mortar where not.
        hosts: The surface, "primary" or "secondary", whose nodes carry mortar contact; without it,
            the one that the other covers, or that with smaller facets.
        tresca: Friction of Tresca: the shear stress, not negative, that slip has to overcome,
            whatever the pressure, and where the surfaces are apart, too.
        coulomb: Friction of Coulomb: its coefficient μ, not negative. Beside it ``tresca`` is an
            adhesion, the shear stress that is to be overcome without pressure.
        associated: Whether slip follows the normal of that friction's cone, as of a joint that
            dilates: surfaces part by μ times what they slip. Bounds of the body alone know it.
        reduced: Whether F of ``control = "strength"`` divides its friction, as by default.
        name: Name of an overlap that grows, for stages; by default that of the primary surface.

    Raises:
        InputError: If friction is negative, or if nothing overlaps that could grow.
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
                f"the contact of '{self.primary}' and '{self.secondary}' has constant = false, but"
                " no overlap that could grow; give interference = true, or leave constant out."
            )

    @property
    def on(self) -> str:
        """The surface that it goes by where it has no name."""
        return self.primary
