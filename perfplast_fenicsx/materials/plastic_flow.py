r"""Plastic flow: a step of Prandtl's and Reuss' law.

A step (implicit Euler) from the plastic strain p is Hencky's law of the same body, shifted:

    Σ(e)  = Σ_H(e − p)
    ψ(e)  = ψ_H(e − p)
    ψ*(s) = ψ_H*(s) + s:p

where ψ is the energy that the step stores and dissipates, and ½ e:Ce of e − p where it is elastic.
So every law that is a projection on a yield set that stays has its flow (J. C. Simo, T. J. R.
Hughes, Computational Inelasticity, 1998, chapter 3); :mod:`hardening_flow` is that of hardening.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Protocol

import ufl

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import all_elastic
from perfplast_fenicsx.materials.law import Elasticity, Law, Material, Old
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.plane_stress import thin
from perfplast_fenicsx.materials.yield_set import YieldSet
from perfplast_fenicsx.spatial_fields import Strength

STRAIN, ACCUMULATED = "plastic_strain", "accumulated_plastic_strain"
"""The history: p as a Mandel vector, and p̄ = ∫√⅔‖dp‖, which in uniaxial stress of a metal is
∫|dε^p|."""


class Step(Law, Protocol):
    """A step of flow; see :class:`Law` for the methods."""

    @abstractmethod
    def hencky(self, old: Old) -> Law:
        """Return the law of total strain with the yield set as it is now."""
        ...

    def shifted(self, e: Expr, old: Old) -> Expr:
        """Return the strain that Hencky's law sees."""
        return e - old[STRAIN]

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """Return the shapes of p and p̄, zero at first."""
        return {STRAIN: (m,), ACCUMULATED: ()}

    def stress(self, e: Expr, old: Old) -> Expr:
        """Σ(e)."""
        return self.hencky(old).stress(self.shifted(e, old), {})

    def potential(self, e: Expr, old: Old) -> Expr:
        """ψ(e)."""
        return self.hencky(old).potential(self.shifted(e, old), {})

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """ψ*(s)."""
        return self.hencky(old).conjugate(s, {}) + ufl.dot(s, old[STRAIN])

    def plastic(self, e: Expr, old: Old) -> Expr:
        """1 where the step flows, else 0."""
        return self.hencky(old).plastic(self.shifted(e, old), {})

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return those of Hencky's law."""
        return self.hencky(old).tangent_fields(self.shifted(e, old), {}, rho)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """Return p and p̄ after the step."""
        flow = self.hencky(old).flow(self.shifted(e, old))
        more = math.sqrt(2 / 3) * ufl.sqrt(ufl.dot(flow, flow))
        return {STRAIN: old[STRAIN] + flow, ACCUMULATED: old[ACCUMULATED] + more}


class FlowLaw(Step):
    """Perfect plasticity, step by step; :func:`flow_law` makes it of a law of total strain.

    Args:
        numbers: Numbers of the law of total strain.
    """

    of: ClassVar[type[Law]]
    projects: ClassVar[bool] = True

    def __init__(self, **numbers: Expr) -> None:
        self._perfect = self.of(**numbers)

    @property
    def elastic(self) -> Elasticity:
        """C."""
        return self._perfect.elastic

    @property
    def yields(self) -> YieldSet:
        """Which stays."""
        return self._perfect.yields

    def hencky(self, old: Old) -> Law:
        """It does not change."""
        return self._perfect

    def unstressed(self, old: Old) -> Expr | None:
        """Return the plastic strain."""
        return old[STRAIN]

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return the that of Hencky's law."""
        return self._perfect.tangent(stored, d)


@cache
def flow_law(law: type[Law]) -> type[FlowLaw]:
    """Return the flow of bodies of a law of total strain that is a projection on a yield set."""
    return type(f"{law.__name__}Flow", (FlowLaw,), {"of": law, "dilates": law.dilates})


@dataclass(frozen=True)
class Flow:
    """A body that remembers its plastic flow: what is loaded, unloaded and loaded again.

    Without it a body follows Hencky's law, and each level is one step from the virgin body.

    Args:
        body: Its numbers. Its law is a projection on a yield set (:attr:`Law.projects`), or the
            body names the law of its flow as ``flow_law``, as :class:`Hardening` does.

    Raises:
        InputError: If the body has no plastic flow, or has it already.
    """

    body: Material

    def __post_init__(self) -> None:
        projects = self.body.law.projects and not isinstance(self.body, Flow)
        if all_elastic([self.body]) or not (projects or hasattr(self.body, "flow_law")):
            raise InputError(
                f"{self.body!r} has no plastic flow to be remembered; give VonMises, Hill,"
                " DruckerPrager, MohrCoulomb, Tresca or Hardening."
            )

    @property
    def law(self) -> type[Law]:
        """Return the law of the flow."""
        own: type[Law] | None = getattr(self.body, "flow_law", None)
        hencky: type[Law] = self.body.law
        return flow_law(hencky) if own is None else own

    @property
    def expansion(self) -> float:
        """Strain of a change of temperature by one degree (1/temperature)."""
        return float(getattr(self.body, "expansion", 0.0))

    def parameters(self) -> Mapping[str, Strength]:
        """Return those of the body."""
        return self.body.parameters()

    def remembering(self) -> "Flow":
        """Itself."""
        return self

    def in_plane_stress(self) -> "Flow | None":
        """Return the same with σ_zz = 0; None where the body is not known there."""
        flat = thin(self.body)
        return None if flat is None else Flow(flat)


def with_memory(material: Material) -> Material | None:
    """Return a body that remembers its plastic flow, an elastic one as it is; None if it cannot.

    What a material says by a method ``remembering()`` comes first.
    """
    own = getattr(material, "remembering", None)
    if own is not None:
        found: Material | None = own()
        return found
    return Flow(material) if material.law.projects else None
