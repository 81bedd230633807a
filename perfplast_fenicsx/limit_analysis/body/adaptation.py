"""How meshes are adapted to bounds, and when that ends."""

from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.limit_analysis.statements.design_factor import DesignFactor
from perfplast_fenicsx.mesh.refinement import check_refinable
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

DECIDED = "decided"
"""End of adapting where it is proven what becomes of the design load, in place of a gap."""


@dataclass(frozen=True)
class Adaptation:
    """Refinement of the mesh by the bounds of the limit load, and its end.

    Args:
        until: Gap of the proven bounds at which refinement ends, relative to the lower one, between
            0 and 1; if neither bound can be proven, the gap of the values. Or "decided", to end
            when it is proven that the design load is carried, or that it is not.
        cells: Most cells of a finer mesh. The first mesh may have more, and is then the only one.

    Raises:
        InputError: A gap that is not valid.
    """

    until: float | Literal["decided"] = 0.01
    cells: int = 50000

    def __post_init__(self) -> None:
        if not isinstance(self.until, str) and not 0 < self.until < 1:
            raise InputError(
                f'until = {self.until} is not between 0 and 1; try 0.01, or "decided".'
            )

    def check_design(self, design: float | None) -> None:
        """Refuse a decision on nothing.

        Args:
            design: Load factor of the design load, if one is given.

        Raises:
            InputError: If there is none to decide on.
        """
        if self.until == DECIDED and design is None:
            raise InputError(
                'until = "decided" goes with a design load; give design, its load factor, often'
                " design = 1.0 under [loading] with control = 'bounds', or a gap such as"
                " until = 0.01."
            )

    def ends(self, lower: Bound, upper: Bound, design: float | None) -> str | None:
        """Why bounds are good enough; None where they are not.

        Args:
            lower: The best lower bound so far.
            upper: The best upper one.
            design: As :meth:`check_design` takes it.
        """
        if design is not None and self.until == DECIDED:
            low, high = (bound.value if bound.strict else None for bound in (lower, upper))
            found = DesignFactor.of(design, low, high, None)
            return "it is decided whether the design load is carried" if found.decided else None
        gap = lower.apart(upper)
        if gap is None or isinstance(self.until, str) or gap > self.until:
            return None
        if (
            lower.strict != upper.strict
        ):  # the other one may lie on the wrong side of the proven one
            return None
        strict = lower.strict and upper.strict
        what = "bounds" if strict else "values, which are no bounds of the body,"
        return f"{what} within {self.until:g} of each other are what was asked for"

    def check(self, tagged_mesh: TaggedMesh) -> None:
        """Refuse a first mesh that cannot be adapted. Collective.

        Raises:
            InputError: If it has curved cells.
        """
        check_refinable(tagged_mesh)
