"""Define the interfaces of material laws, yield sets and materials.

A law is a class, in the same file as the material that uses it. :class:`Problem` evaluates a law
only through its UFL expressions, for all bodies with this law together. The program calls the class
with the material parameters as keywords; each parameter is a function on the mesh.

The yield set of a law defines the admissible stresses and the dissipation, in UFL at a point.
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
    """The second-order cone ‖matrix·s‖ ≤ bound − slope·s of stresses s.

    If the product matrix·s does not depend on the mean stress and the slope is zero, the mean
    stress is unbounded. If the matrix has rank m and the set is bounded, the set is an ellipsoid;
    its centre is zero if the slope is zero.

    Args:
        bound: Positive (stress), or zero if the slope is not zero, shape ().
        slope: Decrease of the bound per stress, shape (m,); zero without friction.
        matrix: Matrix of full row rank, shape (k, m).
    """

    bound: Expr
    slope: Expr
    matrix: Expr


@dataclass(frozen=True)
class PrincipalCone:
    """The set (1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound, σ₁ ≤ tension of principal stresses σ₁ ≥ σ₂ ≥ σ₃.

    This cone must be the only cone of its yield set. Its elements are symmetric 3 × 3 tensors.

    Args:
        bound: Positive (stress), or zero if the sine is positive, shape ().
        sine: In [0, 1), shape (); zero without friction.
        tension: Positive (stress), shape (); None if no tensile strength bounds σ₁.
    """

    bound: Expr
    sine: Expr
    tension: Expr | None = None


@dataclass(frozen=True)
class ParabolicCone:
    """The set R² ≤ curvature (tension − p − R), for the in-plane mean stress p and Mohr radius R.

    This cone must be the only cone of its yield set. No condition contains the out-of-plane stress.

    Args:
        curvature: Positive (stress), shape ().
        tension: Positive (stress), shape (); the tensile strength.
    """

    curvature: Expr
    tension: Expr


class YieldSet(Protocol):
    """A closed convex set of stresses that contains zero stress.

    The gauge, the support function and the cones describe the same set.
    """

    def gauge(self, s: Expr) -> Expr:
        """Return the least t ≥ 0 with s/t in the set; 0 if no positive multiple of s yields."""
        ...

    def support(self, rate: Expr) -> Expr:
        """Return the supremum of s:rate over the set (power per volume), for an admissible rate."""
        ...

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a symmetric bilinear form of rates for mechanism searches along loading paths.

        The form is positive. Its value at an admissible rate is proportional to the square of
        :meth:`support`, if a quadratic form with this property exists. The program uses the form
        only if :meth:`inadmissible` is linear.
        """
        ...

    def cones(self, size: int) -> Sequence[Cone | PrincipalCone | ParabolicCone] | None:
        """Return the cones whose intersection is the set; () if nothing yields, None if unknown.

        The interior point method, strict bounds and their proofs support sets of only one cone.
        This cone is a cone of principal stresses, a parabola in plane strain, or a second-order
        cone that contains zero and has a matrix of rank m − 1 or m. For limit loads of the mesh,
        the cone may also be an object of another class
        (:class:`perfplast_fenicsx.limit_analysis.conic.cone.LawSet`).

        Args:
            size: The number of Mandel components m.
        """
        ...

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the part of a rate that must vanish, linear in the rate, shape (k,); or None.

        If this part vanishes, :meth:`support` is finite. The method returns None if no linear
        condition describes the admissible rates, for example if these rates form a cone.
        """
        ...


class NeverYields:
    """The set of all stresses; :class:`YieldSet` describes the methods."""

    def gauge(self, s: Expr) -> Expr:
        """Return 0."""
        return ufl.as_ufl(0)

    def support(self, rate: Expr) -> Expr:
        """Return 0, because only a zero rate is admissible."""
        return ufl.as_ufl(0)

    def resistance(self, a: Expr, b: Expr) -> Expr:
        """Return a:b."""
        return ufl.dot(a, b)

    def cones(self, size: int) -> Sequence[Cone]:
        """Return no cones."""
        return ()

    def inadmissible(self, rate: Expr) -> Expr:
        """Return the rate itself, which must vanish."""
        return rate


def axial_cone(bound: Expr, alpha: Expr | float, size: int) -> Cone:
    """Return the cone ‖dev s‖ ≤ bound − αp about the hydrostatic axis, for the mean stress p.

    Args:
        bound: γ > 0 (stress).
        alpha: α ≥ 0.
        size: The number of Mandel components m.
    """
    return Cone(bound, spherical(ufl.as_ufl(alpha) / 3, size), deviators(size))


def deviators(size: int) -> Expr:
    """Return a matrix whose rows are orthonormal deviators, shape (m − 1, m).

    The product of the matrix and s has the norm of dev s.

    Args:
        size: The number of Mandel components m.
    """
    a, b = 1 / math.sqrt(2), 1 / math.sqrt(6)
    shears = [[float(i == j) for j in range(size)] for i in range(3, size)]
    rest = [0.0] * (size - 3)
    return ufl.as_matrix([[a, -a, 0.0, *rest], [b, b, -2 * b, *rest], *shears])


Old = Mapping[str, Expr]
"""The internal variables at a point by name, after the last accepted level; {} for laws without a
history.
"""


class Elasticity(Protocol):
    """Hooke's tensor C of an isotropic body, in 3D or in a sheet.

    Attributes:
        bulk: κ (stress).
        shear: μ (stress).
    """

    @property
    def bulk(self) -> Expr:
        """Return the bulk modulus of the body in 3D."""
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
    """A law that derives from a convex potential; Σ = Dψ is therefore monotone.

    Strains e, rates and stresses s are Mandel vectors, shape (m,) with m = 6, or 4 in plane strain
    (:mod:`mandel`); ``old`` is the history. A subclass inherits :meth:`history`, :meth:`flow` and
    :meth:`updated` for laws without a history (Hencky's laws).

    Attributes:
        projects: Whether Σ(e) is the projection of C(e − p) onto a fixed yield set in the norm of
            C⁻¹, with the strain p of :meth:`unstressed`, as in perfect plasticity. ALG2 requires
            this property.
        dilates: Whether bodies dilate in plastic flow. Confined bodies that dilate may carry any
            load.
        carries_any_load: Whether hardening is unlimited. A body that hardens without limit has no
            limit load.
        plane_strain_only: Whether the law is valid only in plane strain.
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
        """Return the yield set of the virgin body; stresses after hardening may lie outside it."""
        ...

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """Return the shape of each internal variable at a point by name, for m components."""
        return {}

    def unstressed(self, old: Old) -> Expr | None:
        """Return the strain at zero stress, shape (m,); None if this strain is zero."""
        return None

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return Σ(e), the derivative of the potential, shape (m,)."""
        ...

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ψ(e) (energy per volume); with a history, the energy of the step."""
        ...

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ψ*(s) of an admissible stress (energy per volume), with ψ(e) + ψ*(Σ(e)) = Σ(e):e.

        In perfect plasticity ψ*(s) is ½ s:C⁻¹s. The integral of ψ* is the term S of the duality
        gap.
        """
        ...

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 1 where e is outside the elastic range, else 0."""
        ...

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return fields at a point, of any shapes, from which :meth:`tangent` computes the tangent.

        Args:
            e: The strain.
            old: The history.
            rho: Number ρ in [0, 1] of Σ^{o,ρ} = ρC + (1 − ρ)Σ°, where Σ° is an element of the
                generalised derivative of Σ at e.
        """
        ...

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return Σ^{o,ρ}(e)[d] from the stored fields, shape (m,); positive semidefinite in d."""
        ...

    def flow(self, e: Expr) -> Expr:
        """Return the plastic strain of the virgin body at the strain e, shape (m,).

        In perfect plasticity the plastic strain is e − C⁻¹Σ(e).
        """
        elastic = self.elastic.compliance(self.stress(e, {}))
        return self.plastic(e, {}) * (e - elastic)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """Return the internal variables after a level is accepted with the strain e."""
        return {}


@runtime_checkable
class Material(Protocol):
    """Parameters of a body and their law.

    Attributes:
        law: The class of the law. A call with the parameters as keywords returns a :class:`Law`.
    """

    @property
    def law(self) -> type[Any]:
        """Return the class of the law."""
        ...

    def parameters(self) -> Mapping[str, Strength]:
        """Return the parameters of the law (numbers or fields), by the names of its arguments."""
        ...


def carries_any_load(material: Material) -> bool:
    """Return whether a body of the material hardens without limit.

    The result is False if the law does not define ``carries_any_load``.
    """
    return bool(getattr(material.law, "carries_any_load", False))


@runtime_checkable
class Thin(Protocol):
    """A material that defines whether it supports plane stress."""

    def in_plane_stress(self) -> Material | None:
        """Return the same material with σ_zz = 0 and free ε_zz; None if no such law exists."""
        ...


def thin(material: Material) -> Material | None:
    """Return the material for plane stress; None if the material does not support plane stress."""
    return material.in_plane_stress() if isinstance(material, Thin) else None


def in_plane_stress(materials: Mapping[str, Material]) -> dict[str, Material]:
    """Return the materials of bodies for plane stress.

    Args:
        materials: Material of each volume.

    Raises:
        InputError: If a material does not support plane stress.
    """
    found = {}
    for name, material in materials.items():
        flat = thin(material)
        if flat is None:
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, does not support plane "
                "stress; give law = 'von-mises', 'hill' or 'elastic', or kind = 'plane-strain'."
            )
        found[name] = flat
    return found
