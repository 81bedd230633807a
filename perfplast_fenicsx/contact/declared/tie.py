"""Declare two named surfaces that are glued together."""

from dataclasses import dataclass
from typing import Literal


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
