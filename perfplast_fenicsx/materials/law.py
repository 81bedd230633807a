"""Define the interfaces of a material law, in UFL at a point, and of a material.

A law is one class, in one file with the material that uses it. :class:`Problem` evaluates a law
only through its expressions, for all bodies with the law together. The program calls the class with
the parameters of the materials as keywords, each a function over the mesh.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.yield_set import YieldSet
from perfplast_fenicsx.spatial_fields import Strength

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
    """

    projects: ClassVar[bool]
    dilates: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = False

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
