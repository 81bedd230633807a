"""The yield set that the interior point method knows, as a cone: ‖dev σ‖ + αp ≤ γ."""

from dataclasses import dataclass

from perfplast_fenicsx.materials.mandel import Expr


@dataclass(frozen=True)
class YieldCone:
    """‖dev σ‖/γ + (α/γ)p ≤ 1 at a point, p being the mean stress, in UFL.

    In plane strain σ is the stress in the plane, and the one out of it is the best there is: no
    equation of equilibrium has it.

    Attributes:
        weakness: 1/γ (1/stress), 0 of bodies that never yield.
        slope: α/γ (1/stress), 0 where the mean stress plays no part.
    """

    weakness: Expr
    slope: Expr
