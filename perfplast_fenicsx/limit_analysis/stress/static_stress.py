"""A lower bound of the body with the stress that proves it, or with none and the reason."""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.facets.bound_body import BoundBody
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.stress.static_certificate import StaticCertificate


@dataclass(frozen=True, eq=False)
class StaticBound:
    """A lower bound and the stress that proves it.

    Attributes:
        bound: The bound, and what it is one of.
        verdict: Whether the best stress of the mesh was found.
        reason: The reason in words.
        stress: σ at the bound, Mandel vectors in the user's units, linear between vertices, shape
            (num_owned_cells, num_points, m). In the plane of the vertices in the order of the
            mesh's geometry (that of its topology); in space of those of four parts one after the
            other, part a being the one in which the barycentre replaces vertex a. Around an axis
            Bernstein's coefficients of rσ, which is quadratic (:mod:`ring_cells`).
        aside: Factor of the loads of any factor, where there are any.
        dissipation: (γ − αp)‖dev ε‖ of the multipliers, of each owned cell, with L = 1; where
            bodies keep their volume the sum over all cells is the bound, but for the tolerance.
            Where it is large, smaller cells would help.
        certificate: Residuals of the stress; None if there are none.
        steps: Steps of the iteration.
        factorisations: Factorisations of a stiffness.
        is_part: Whether it is a part of the stress that was found, for what rounding leaves of its
            balance.
    """

    bound: Bound
    verdict: Verdict
    reason: str
    stress: Floats
    aside: float
    dissipation: Floats
    certificate: StaticCertificate | None
    steps: list[InteriorStep]
    factorisations: int
    is_part: bool = False

    def __repr__(self) -> str:
        return f"StaticBound({self.bound!r}; {len(self.steps)} steps; {self.reason})"


def no_stress(
    body: BoundBody, verdict: Verdict, reason: str, bound: Bound | None = None
) -> StaticBound:
    """Return the stress 0, and no bound unless one is given."""
    count, _, tdim = body.vertices.shape
    shape = (count, 6 if body.turned else 3, 4) if tdim == 2 else (count, 16, 6)
    return StaticBound(
        bound=bound or Bound(None, "lower", Scope.MESH, (reason,)),
        verdict=verdict,
        reason=reason,
        stress=np.zeros(shape),
        aside=0.0,
        dissipation=np.zeros(count),
        certificate=None,
        steps=[],
        factorisations=0,
    )
