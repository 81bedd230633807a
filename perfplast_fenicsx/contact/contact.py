"""Contact of two named surfaces."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Contact:
    """Frictionless contact of two surfaces whose nodes match.

    They may touch or be apart, flat, curved or with edges. Which of the two is called primary does
    not matter for the result.

    Args:
        primary: Physical name of the first surface; the normal points out of its body.
        secondary: Physical name of the second surface.
        gap: Initial gap g (length) between them: a number or a formula in x, y, z of the primary
            surface; without it, it is measured along the normal.
        interference: Whether a negative gap is meant, as in a press fit: bodies are made so much
            too large, and push each other apart.
    """

    primary: str
    secondary: str
    gap: float | str | None = None
    interference: bool = False
