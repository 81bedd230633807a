"""Define the result of a search for a shakedown load."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from dolfinx import fem

from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.shakedown.load_domain import LoadDomain
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.problem import Problem


class Failure(StrEnum):
    """The failure above a shakedown load."""

    ALTERNATING = "alternating plasticity"
    COLLAPSE = "incremental collapse"
    BOTH = "alternating plasticity and incremental collapse at once"
    NONE = "nothing that was found"

    @staticmethod
    def of(accumulated: float) -> "Failure":
        """Return the failure for the share of the flow that remains at the end of a cycle."""
        if accumulated <= 0.05:
            return Failure.ALTERNATING
        return Failure.COLLAPSE if accumulated >= 0.5 else Failure.BOTH


@dataclass(frozen=True, eq=False)
class ShakedownLoad:
    """The largest multiple of a load domain that the bodies shake down to, on this mesh.

    Attributes:
        domain: The load domain.
        problem: Problem whose points are those of the stresses.
        linear: Whether these points are the vertices of cells, in which stresses are linear.
        load: Factor λ of Melan's program, an estimate for the bodies; None if none was found.
        upper: Koiter's value; the steps have reduced its difference from ``load`` to the tolerance.
        over: Largest ratio of stress to yield at any corner and point, 1 up to rounding.
        unbalanced: Largest relative force of the residual stress.
        first_yield: Factor of the domain at which the first point yields at a corner, without
            residual stress; None with permanent loads.
        accumulated: Share of a cycle's flow that remains at its end.
        failure: Kind of failure above the load.
        mechanism: Displacement that a cycle leaves, up to a factor.
        dissipation: Dissipation of a cycle at the points, up to a factor.
        residual: Residual stress ρ, Mandel vectors at the points (stress).
        steps: Number of steps of the interior point method.
        factorisations: Total number of factorisations.
        linear_solves: Total number of linear solves.
        converged: Whether both values have met.
        reason: Reason for the end.
    """

    domain: LoadDomain
    problem: Problem
    linear: bool
    load: float | None
    upper: float | None
    over: float
    unbalanced: float
    first_yield: float | None
    accumulated: float
    failure: Failure
    mechanism: fem.Function
    dissipation: fem.Function
    residual: fem.Function
    steps: int
    factorisations: int
    linear_solves: int
    converged: bool
    reason: str

    def in_words(self) -> str:
        """Return the result in a sentence."""
        if self.load is None or not self.converged:
            return f"No shakedown load was found: {self.reason}."
        words = (
            f"Shakedown to {self.load:.5g} times the load domain (an estimate: the elastic"
            f" stresses are those of this mesh); above that, {self.failure}"
        )
        if self.first_yield is not None:
            words += f". The first point yields at {self.first_yield:.5g} times it"
        return f"{words}."

    def as_limit(self) -> LimitLoad:
        """Return the result in the form of a limit load, for files and pictures."""
        return LimitLoad(
            method=LimitMethod.INTERIOR_POINT,
            lower=self.load if self.converged and self.load is not None else -math.inf,
            estimate=self.load if self.converged else None,
            residual=None,
            upper=self.upper if self.converged else None,
            alpha=None,
            levelled_off=self.converged,
            reason=self.reason,
            iterations=self.steps,
            linear_solves=self.linear_solves,
            factorisations=self.factorisations,
            mechanism=self.mechanism,
        )

    def of_cells(self) -> fem.Function:
        """Return the dissipation of a cycle, averaged over each cell. Collective."""
        cells = fem.functionspace(self.problem.tagged_mesh.mesh, ("DG", 0))
        mean = fem.Function(cells, name="dissipation")
        mean.x.array[:] = by_cell(self.dissipation).mean(axis=1)
        return mean

    def table(self) -> dict[str, Any]:
        """Return the table for ``summary.json``."""
        return {
            "names": self.domain.names,
            "corners": self.domain.corners.tolist(),
            "load": self.load if self.converged else None,
            "koiter": self.upper if self.converged else None,
            "stress_over_yield": self.over if self.converged else None,
            "unbalanced": self.unbalanced if self.converged else None,
            "first_yield": self.first_yield,
            "accumulated": self.accumulated if self.converged else None,
            "failure": str(self.failure),
            "within_cells": self.linear,
            "in_words": self.in_words(),
        }

    def __repr__(self) -> str:
        return f"ShakedownLoad({self.load}, {self.failure})"
