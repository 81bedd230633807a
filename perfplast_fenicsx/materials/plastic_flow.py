r"""Define plastic flow: a step of the Prandtl–Reuss law.

A step (implicit Euler) from the plastic strain p is Hencky's law of the same body with a shifted
strain:

    Σ(e)  = Σ_H(e − p)
    ψ(e)  = ψ_H(e − p)
    ψ*(s) = ψ_H*(s) + s:p

where ψ is the energy that the step stores and dissipates. In an elastic step ψ is ½ (e − p):C(e −
p). Every law that is a projection onto a fixed yield set has a flow law of this form (J. C. Simo,
T. J. R. Hughes, Computational Inelasticity, 1998, chapter 3). :mod:`hardening` defines the flow
law with hardening.
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
from perfplast_fenicsx.materials.law import Elasticity, Law, Material, Old, YieldSet, thin
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.spatial_fields import Strength

STRAIN, ACCUMULATED = "plastic_strain", "accumulated_plastic_strain"
"""Names of the internal variables: p as a Mandel vector, and p̄ = ∫√⅔‖dp‖. For a metal in uniaxial
stress, p̄ = ∫|dε^p|.
"""


class Step(Law, Protocol):
    """A step of plastic flow; :class:`Law` describes the methods."""

    @abstractmethod
    def hencky(self, old: Old) -> Law:
        """Return the law for total strain with the present yield set."""
        ...

    def shifted(self, e: Expr, old: Old) -> Expr:
        """Return the strain that is the argument of Hencky's law."""
        return e - old[STRAIN]

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """Return the shapes of p and p̄, which start at zero."""
        return {STRAIN: (m,), ACCUMULATED: ()}

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e)."""
        return self.hencky(old).stress(self.shifted(e, old), {})

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e)."""
        return self.hencky(old).potential(self.shifted(e, old), {})

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ψ*(s)."""
        return self.hencky(old).conjugate(s, {}) + ufl.dot(s, old[STRAIN])

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 if the body flows in this step, else 0."""
        return self.hencky(old).plastic(self.shifted(e, old), {})

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields of Hencky's law."""
        return self.hencky(old).tangent_fields(self.shifted(e, old), {}, rho)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """Return p and p̄ after the step."""
        flow = self.hencky(old).flow(self.shifted(e, old))
        more = math.sqrt(2 / 3) * ufl.sqrt(ufl.dot(flow, flow))
        return {STRAIN: old[STRAIN] + flow, ACCUMULATED: old[ACCUMULATED] + more}


class FlowLaw(Step):
    """Perfect plasticity, step by step; :func:`flow_law` derives subclasses from Hencky's laws.

    Args:
        numbers: Parameters of Hencky's law, the law for total strain.
    """

    of: ClassVar[type[Law]]
    projects: ClassVar[bool] = True

    def __init__(self, **numbers: Expr) -> None:
        self._perfect = self.of(**numbers)

    @property
    def elastic(self) -> Elasticity:
        """Return Hooke's tensor C."""
        return self._perfect.elastic

    @property
    def yields(self) -> YieldSet:
        """Return the yield set, which does not change."""
        return self._perfect.yields

    def hencky(self, old: Old) -> Law:
        """Return the law for total strain, which does not change."""
        return self._perfect

    def unstressed(self, old: Old) -> Expr | None:
        """Return the plastic strain."""
        return old[STRAIN]

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return the tangent of Hencky's law."""
        return self._perfect.tangent(stored, d)


@cache
def flow_law(law: type[Law]) -> type[FlowLaw]:
    """Return the flow law of a Hencky law that is a projection onto a yield set."""
    return type(f"{law.__name__}Flow", (FlowLaw,), {"of": law, "dilates": law.dilates})


@dataclass(frozen=True)
class Flow:
    """A material that remembers its plastic flow, for loading, unloading and reloading.

    Without memory a body follows Hencky's law, and each level is one step from the virgin body.

    Args:
        body: The material of the body. Its law is a projection onto a yield set
            (:attr:`Law.projects`), or the material has its own flow law ``flow_law``, as
            :class:`Hardening` has.

    Raises:
        InputError: If the body has no plastic flow, or if the material already remembers its flow.
    """

    body: Material

    def __post_init__(self) -> None:
        projects = self.body.law.projects and not isinstance(self.body, Flow)
        if all_elastic([self.body]) or not (projects or hasattr(self.body, "flow_law")):
            raise InputError(
                f"{self.body!r} has no plastic strains to store; give VonMises, Hill, "
                "DruckerPrager, MohrCoulomb, Tresca or Hardening."
            )

    @property
    def law(self) -> type[Law]:
        """Return the class of the flow law."""
        own: type[Law] | None = getattr(self.body, "flow_law", None)
        hencky: type[Law] = self.body.law
        return flow_law(hencky) if own is None else own

    @property
    def expansion(self) -> float:
        """Return the thermal strain per degree (1/temperature)."""
        return float(getattr(self.body, "expansion", 0.0))

    def parameters(self) -> Mapping[str, Strength]:
        """Return the parameters of the body."""
        return self.body.parameters()

    def remembering(self) -> "Flow":
        """Return the material itself."""
        return self

    def in_plane_stress(self) -> "Flow | None":
        """Return the same material with σ_zz = 0; None if it does not support plane stress."""
        flat = thin(self.body)
        return None if flat is None else Flow(flat)


def with_memory(material: Material) -> Material | None:
    """Return a material that remembers its plastic flow.

    The function returns an elastic material unchanged. The result is ``None`` if the material
    cannot remember its flow. A material's own method ``remembering()`` takes precedence.
    """
    own = getattr(material, "remembering", None)
    if own is not None:
        found: Material | None = own()
        return found
    return Flow(material) if material.law.projects else None
