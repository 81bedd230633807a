"""Write in words the load at which a loading path loses equilibrium, between two of its levels.

If no limit theorem holds, as with Coulomb's friction, only tried levels bound such a load. One is
solved, and one ended with the verdict that there is no equilibrium.
"""

from dataclasses import dataclass

from perfplast_fenicsx.rounding import rounded_down, rounded_up

SAID = (
    "No limit theorem holds with Coulomb's friction. These loads hold only for this mesh and this"
    " loading path, which starts from rest with all constant loads; another path may end at"
    " another load."
)
"""Sentences on the scope of the bracket."""

NO_PAIR = (
    "Drucker's bounds were not sought: they need loads that all grow, and a problem that the"
    " interior point method accepts."
)
"""The sentence for results without Drucker's bounds."""


@dataclass(frozen=True)
class PathBracket:
    """Load factors of one path between which equilibrium is lost.

    Attributes:
        carried: Largest load factor of a solved level; 0 without one.
        refused: Least load factor of a level without equilibrium; None without one.
    """

    carried: float
    refused: float | None

    def in_words(self, zeta: str = "") -> str:
        """Return the load at which equilibrium is lost, as the rest of a sentence about the path.

        Args:
            zeta: Text before loads, such as "ζ = ".
        """
        low = f"{zeta}{rounded_down(self.carried)}"
        if self.refused is None:
            solved = f"; levels are solved up to {low}" if self.carried > 0 else ""
            return f"loses equilibrium at a load that was not found{solved}"
        high = f"{zeta}{rounded_up(self.refused)}"
        return f"loses equilibrium between {low}, where it is solved, and {high}, where it has none"
