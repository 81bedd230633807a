"""Declare the mesh refinement that the bounds control, with its stopping criterion."""

from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, DesignFactor
from perfplast_fenicsx.mesh.refinement import check_refinable
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

DECIDED = "decided"
"""Value of ``until`` that ends the adaptation when it is proven that the bodies carry the design
load, or that they do not."""


@dataclass(frozen=True)
class Adaptation:
    """Mesh refinement that the bounds on the limit load control, with its stopping criterion.

    Args:
        until: Gap between the proven bounds at which refinement ends, relative to the lower bound,
            between 0 and 1. If neither bound can be proven, the gap between the unproven values
            counts. With "decided", refinement ends when it is proven that the bodies carry the
            design load, or that they do not.
        cells: Largest number of cells of a refined mesh. If the first mesh has more cells, it is
            not refined.

    Raises:
        InputError: If ``until`` or ``cells`` is out of range.
    """

    until: float | Literal["decided"] = 0.01
    cells: int = 50000

    def __post_init__(self) -> None:
        if not isinstance(self.until, str) and not 0 < self.until < 1:
            raise InputError(
                f'until = {self.until} is not between 0 and 1; try 0.01, or "decided".'
            )
        if self.cells < 1:
            raise InputError(f"cells = {self.cells} is less than 1; give at least 1.")

    def check_design(self, design: float | None) -> None:
        """Refuse ``until = "decided"`` if there is no design load.

        Args:
            design: Load factor of the design load; None without a design load.

        Raises:
            InputError: If ``until`` is "decided" and there is no design load.
        """
        if self.until == DECIDED and design is None:
            raise InputError(
                'until = "decided" needs a design load; give design (often 1.0) '
                "under [loading] with control = 'bounds', or a gap such as until = 0.01."
            )

    def ends(self, lower: Bound, upper: Bound, design: float | None) -> str | None:
        """Return the reason to end the adaptation; None if the bounds are not yet close enough.

        Args:
            lower: The best lower bound so far.
            upper: The best upper bound so far.
            design: See :meth:`check_design`.
        """
        if design is not None and self.until == DECIDED:
            low, high = (lower.strict_value, upper.strict_value)
            found = DesignFactor.of(design, low, high, None)
            return (
                "it is proven whether the bodies carry the design load" if found.decided else None
            )
        gap = lower.apart(upper)
        if gap is None or isinstance(self.until, str) or gap > self.until:
            return None
        if (
            lower.strict != upper.strict
        ):  # The unproven bound may lie on the wrong side of the proven one.
            return None
        strict = lower.strict and upper.strict
        what = "bounds" if strict else "values, which are not bounds of the body,"
        closer = "a smaller until brings them closer"
        return f"{what} are within {self.until:g} of each other, as requested; {closer}"

    def check(self, tagged_mesh: TaggedMesh) -> None:
        """Refuse a first mesh that cannot be adapted. Collective.

        Raises:
            InputError: If the mesh has curved cells.
        """
        check_refinable(tagged_mesh)
