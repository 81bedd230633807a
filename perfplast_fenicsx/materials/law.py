"""Define the interfaces of a material law, its yield set in UFL at a point, and of a material.

A law is one class, in one file with the material that uses it. :class:`Problem` evaluates a law
only through its expressions, for all bodies with the law together. The program calls the class with
the parameters of the materials as keywords, each a function over the mesh.

Define the yield set of a law, in UFL at a point: admissible stresses and dissipation.
Stresses s and strain rates are Mandel vectors, shape (m,) (:mod:`mandel`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import ufl

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.mandel import Expr, spherical
from perfplast_fenicsx.spatial_fields import Strength


@dataclass(frozen=True)
class Cone:
    """‖matrix·s‖ ≤ bound − slope·s, a second-order cone of stresses.

    If the matrix does not contain the mean stress, the mean stress is not bounded. If it has rank
    m, the set is an ellipsoid, whose centre is zero if the slope is.

    Args:
        bound: Positive (stress), shape ().
        slope: Decrease of the bound per stress, shape (m,); zero without friction.
        matrix: Full row rank, shape (k, m).
    """

    bound: Expr
    slope: Expr
    matrix: Expr


@dataclass(frozen=True)
class PrincipalCone:
    """(1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound and σ₁ ≤ tension, principal stresses σ₁ ≥ σ₂ ≥ σ₃.

    It must be the only cone of its set, and acts on symmetric 3 × 3 tensors.

    Args:
        bound: Positive (stress), shape ().
        sine: In [0, 1), shape (); zero without friction.
        tension: Positive (stress), shape (); None if no tensile strength bounds σ₁.
    """

    bound: Expr
    sine: Expr
    tension: Expr | None = None


@dataclass(frozen=True)
class ParabolicCone:
    """R² ≤ curvature (tension − p − R), with the in-plane mean stress p and radius R of Mohr.

    It must be the only cone of its set. The out-of-plane stress is in no condition.

    Args:
        curvature: Positive (stress), shape ().
        tension: Positive (stress), shape (); the tensile strength.
    """

    curvature: Expr
    tension: Expr


class YieldSet(Protocol):
    """A closed convex set of stresses with zero inside.

    Gauge, support and cones are three descriptions of one set.
    """

    def gauge(self, s: Expr) -> Expr:
        """1 on the surface, and t times as much for t s; 0 where no multiple of s yields."""
        ...

    def support(self, rate: Expr) -> Expr:
        """Return the supremum of s:rate over the set, power per volume, for an admissible rate."""
        ...

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a symmetric bilinear form of rates for the mechanism search along loading paths.

        It is positive. If such a form exists, its value at an admissible rate is proportional to
        the square of :meth:`support`. The program uses it only where :meth:`inadmissible` is
        linear.
        """
        ...

    def cones(self, size: int) -> Sequence[Cone | PrincipalCone | ParabolicCone] | None:
        """Return the cones whose intersection is the set; () without yield, None if there are none.

        The interior point method, strict bounds and their proofs support only one cone: of
        principal stresses, a parabola in plane strain, or with a matrix of rank m − 1 or m and zero
        inside. For limit loads of meshes it may also be an object of another class
        (:class:`perfplast_fenicsx.limit_analysis.conic.cone.LawSet`).

        Args:
            size: The number of Mandel components m.
        """
        ...

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the part of a rate, shape (k,) and linear in it, that must vanish, or None.

        If this part vanishes, :meth:`support` is finite. None if no linear condition describes
        admissible rates, as when they form a cone.
        """
        ...


class NeverYields:
    """The set of all stresses; see :class:`YieldSet` for the methods."""

    def gauge(self, s: Expr) -> Expr:
        """Return 0."""
        return ufl.as_ufl(0)

    def support(self, rate: Expr) -> Expr:
        """Return 0, the power of a rate of zero."""
        return ufl.as_ufl(0)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """Return no cones."""
        return ()

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the whole rate."""
        return rate


def axial_cone(bound: Expr, alpha: Expr | float, size: int) -> Cone:
    """Return the cone ‖dev s‖ ≤ bound − αp about the hydrostatic axis; p is the mean stress.

    Args:
        bound: γ > 0 (stress).
        alpha: α ≥ 0.
        size: The number of Mandel components m.
    """
    return Cone(bound, spherical(ufl.as_ufl(alpha) / 3, size), deviators(size))


def deviators(size: int) -> Expr:
    """Return orthonormal deviators as rows, shape (m − 1, m).

    Their product with s has the norm of dev s.

    Args:
        size: The number of Mandel components m.
    """
    a, b = 1 / math.sqrt(2), 1 / math.sqrt(6)
    shears = [[float(i == j) for j in range(size)] for i in range(3, size)]
    rest = [0.0] * (size - 3)
    return ufl.as_matrix([[a, -a, 0.0, *rest], [b, b, -2 * b, *rest], *shears])


Old = Mapping[str, Expr]
"""The history at a point by name, after the last accepted level; {} for a law without history."""


class Elasticity(Protocol):
    """Hooke's tensor C of an isotropic body, in space or in a sheet.

    Attributes:
        bulk: κ (stress).
        shear: μ (stress).
    """

    @property
    def bulk(self) -> Expr:
        """Return the bulk modulus of the body in space."""
        ...

    @property
    def shear(self) -> Expr:
        """Return the shear modulus of the body."""
        ...

    def hooke(self, e: Expr) -> Expr:
        """Return C e."""
        ...

    def compliance(self, s: Expr) -> Expr:
        """Return C⁻¹ s."""
        ...


class Law(Protocol):
    """A law that derives from a convex potential, so that Σ = Dψ is monotone.

    Strains e, rates and stresses s are Mandel vectors, shape (m,) with m = 6, or 4 in plane strain
    (:mod:`mandel`); ``old`` is the history. A class that derives from this one inherits
    :meth:`history`, :meth:`flow` and :meth:`updated` for laws without a history (Hencky's laws).

    Attributes:
        projects: Whether Σ(e) is the projection of C(e − p) on a fixed yield set in the norm of
            C⁻¹, with the strain p of :meth:`unstressed`, as in perfect plasticity. ALG2 requires
            it.
        dilates: Whether the volume of bodies grows where they flow, so that confinement may carry
            any load.
        carries_any_load: Whether hardening is unlimited, so that there is no limit load.
        plane_strain_only: Whether the law has no meaning in space and around an axis.
    """

    projects: ClassVar[bool]
    dilates: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = False
    plane_strain_only: ClassVar[bool] = False

    @property
    def elastic(self) -> Elasticity:
        """Return C, which defines the norms ‖e‖_C of strains and ‖σ‖_E of stresses."""
        ...

    @property
    def yields(self) -> YieldSet:
        """Return the yield set of the virgin body; after hardening, stresses may lie outside it."""
        ...

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """Return the shape of each internal variable at a point by name, for m components."""
        return {}

    def unstressed(self, old: Old) -> Expr | None:
        """Return the strain without stress, shape (m,); None if it is zero."""
        return None

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of the potential, shape (m,)."""
        ...

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e), energy per volume; with a history, the energy of the step."""
        ...

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ψ*(s) of an admissible stress, energy per volume, with ψ(e) + ψ*(Σ(e)) = Σ(e):e.

        In perfect plasticity it is ½ s:C⁻¹s. Its integral is the term S of the duality gap.
        """
        ...

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e is outside the elastic range, else 0."""
        ...

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields at the points from which :meth:`tangent` computes; any shapes.

        Args:
            e: The strain.
            old: The history.
            rho: ρ in [0, 1] of Σ^{o,ρ} = ρC + (1 − ρ)Σ°, where Σ° is in the generalised derivative
                of Σ at e.
        """
        ...

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d] from the stored fields, shape (m,); it is positive semidefinite."""
        ...

    def flow(self, e: Expr) -> Expr:
        """Return the plastic strain of the virgin body at e, shape (m,): e − C⁻¹Σ(e) if perfect."""
        elastic = self.elastic.compliance(self.stress(e, {}))
        return self.plastic(e, {}) * (e - elastic)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """Return the history after a level accepted with the strain e."""
        return {}


@runtime_checkable
class Material(Protocol):
    """Parameters of a body and their law.

    Attributes:
        law: The class of the law; calling it with the parameters as keywords gives a :class:`Law`.
    """

    @property
    def law(self) -> type[Any]:
        """Return the class of the law."""
        ...

    def parameters(self) -> Mapping[str, Strength]:
        """Return the numbers or fields of the law, by the names of its arguments."""
        ...


def carries_any_load(material: Material) -> bool:
    """Return whether a body hardens without limit; False if its law does not say."""
    return bool(getattr(material.law, "carries_any_load", False))


@runtime_checkable
class Thin(Protocol):
    """A material that supports plane stress."""

    def in_plane_stress(self) -> Material | None:
        """Return the same body with σ_zz = 0, whatever ε_zz is; None if there is no such law."""
        ...


def thin(material: Material) -> Material | None:
    """Return the material for plane stress; None if it has no such law."""
    return material.in_plane_stress() if isinstance(material, Thin) else None


def in_plane_stress(materials: Mapping[str, Material]) -> dict[str, Material]:
    """Return the materials of bodies for plane stress.

    Args:
        materials: Materials of each volume.

    Raises:
        InputError: If a material does not support plane stress.
    """
    found = {}
    for name, material in materials.items():
        flat = thin(material)
        if flat is None:
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, does not support "
                "plane stress; give VonMises, Hill or Elastic, or kind = 'plane-strain'."
            )
        found[name] = flat
    return found
