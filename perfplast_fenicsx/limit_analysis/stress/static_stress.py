"""Define a lower bound of the body, with the stress that proves it or the reason for none."""

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
        bound: The bound, and its scope.
        verdict: Whether the best stress of the mesh was found.
        reason: Reason in words.
        stress: Stress σ at the bound, Mandel vectors in the user's units, linear between vertices,
            shape (num_owned_cells, num_points, m). In the plane the points are the vertices in the
            order of the mesh's geometry (that of its topology). In space they are the vertices of
            four parts, one part after the other; in part a the barycentre replaces vertex a. In
            axisymmetry these are Bernstein's coefficients of rσ, which is quadratic
            (:mod:`stress_cells`).
        aside: Factor of the loads of any factor, if there are any.
        dissipation: Dissipation (γ − αp)‖dev ε‖ of the multipliers, for each owned cell, with L =
            1. If bodies keep their volume, the sum over all cells is the bound up to the tolerance.
            Smaller cells help where it is large.
        certificate: Residuals of the stress; None if there are none.
        steps: Steps of the iteration.
        factorisations: Number of factorisations of a stiffness.
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

    def __repr__(self) -> str:
        return f"StaticBound({self.bound!r}; {len(self.steps)} steps; {self.reason})"


def no_stress(
    body: BoundBody, verdict: Verdict, reason: str, bound: Bound | None = None
) -> StaticBound:
    """Return a result with zero stress, and without a bound unless one is given."""
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
