"""The load at which a loading path loses equilibrium, in words: between two levels of it.

Where no limit theorem holds, as with Coulomb's friction, nothing bounds such a load but levels that
were tried. One is solved, and one ended with a verdict that there is no equilibrium.
"""

from dataclasses import dataclass

from perfplast_fenicsx.rounding import rounded_down, rounded_up

SAID = (
    "No limit theorem holds with Coulomb's friction. These loads hold only for this mesh and this"
    " loading path, which starts from rest with all constant loads; another path may end at"
    " another load."
)
"""The sentences that limit what the bracket holds for."""

NO_PAIR = (
    "Drucker's bounds were not sought: they need loads that all grow, and a problem that the"
    " interior point method accepts."
)
"""The sentence for results without Drucker's bounds."""


@dataclass(frozen=True)
class PathBracket:
    """Load factors of one path between which equilibrium is lost.

    Attributes:
        carried: The largest load factor of a level that is solved; 0 without one.
        refused: The least of one that has no equilibrium; None without one.
    """

    carried: float
    refused: float | None

    def in_words(self, zeta: str = "") -> str:
        """Return where equilibrium is lost: the rest of a sentence that names the path.

        Args:
            zeta: Text before loads, such as "ζ = ".
        """
        low = f"{zeta}{rounded_down(self.carried)}"
        if self.refused is None:
            solved = f"; levels are solved up to {low}" if self.carried > 0 else ""
            return f"loses equilibrium at a load that was not found{solved}"
        high = f"{zeta}{rounded_up(self.refused)}"
        return f"loses equilibrium between {low}, where it is solved, and {high}, where it has none"
