"""The interfaces of a material law, in UFL at a point, and of a material.

A law is one class, in one file with the material that names it. :class:`Problem` evaluates it by
its expressions alone, bodies of the same law together. The class is called with the parameters of
the materials as keywords, each a function over the mesh.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.materials.yield_set import YieldSet
from perfplast_fenicsx.spatial_fields import Strength

Old = Mapping[str, Expr]
"""The history at a point by name, as it was after the last accepted level; {} where a law has
none."""


class Elasticity(Protocol):
    """Hooke's tensor C of an isotropic body, in space or of a sheet.

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
        """The same."""
        ...

    def hooke(self, e: Expr) -> Expr:
        """C e."""
        ...

    def compliance(self, s: Expr) -> Expr:
        """C⁻¹ s."""
        ...


class Law(Protocol):
    """A law that derives from a convex potential: Σ = Dψ is monotone.

    Strains e, rates and stresses s are Mandel vectors, shape (m,) with m = 6, or 4 in plane strain
    (:mod:`mandel`); ``old`` is the history. :meth:`history`, :meth:`flow` and :meth:`updated` are
    here as laws without a history (those of Hencky) have them, if they derive from this class.

    Attributes:
        projects: Whether Σ(e) is the projection of C(e − p) on a yield set that stays, in the norm
            of C⁻¹, with the strain p of :meth:`unstressed`, as it is in perfect plasticity; ALG2 is
            built on that.
        dilates: Whether bodies grow where they flow, so that confinement may carry any load.
        carries_any_load: Whether it hardens without end, so that there is no limit load.
    """

    projects: ClassVar[bool]
    dilates: ClassVar[bool] = False
    carries_any_load: ClassVar[bool] = False

    @property
    def elastic(self) -> Elasticity:
        """C, which makes the norms ‖e‖_C of strains and ‖σ‖_E of stresses."""
        ...

    @property
    def yields(self) -> YieldSet:
        """The yield set of the virgin body; stresses leave it where a law has hardened."""
        ...

    def history(self, m: int) -> Mapping[str, tuple[int, ...]]:
        """Shape at a point of each internal variable by name, for vectors of m components."""
        return {}

    def unstressed(self, old: Old) -> Expr | None:
        """Return the strain without stress, shape (m,); None where that is zero."""
        return None

    def stress(self, e: Expr, old: Old) -> Expr:
        """Σ(e), the derivative of the potential, shape (m,)."""
        ...

    def potential(self, e: Expr, old: Old) -> Expr:
        """ψ(e), energy per volume; of the step where there is a history."""
        ...

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """ψ*(s) of an admissible stress, energy per volume; ψ(e) + ψ*(Σ(e)) = Σ(e):e.

        It is ½ s:C⁻¹s in perfect plasticity. Its integral is the S of the duality gap.
        """
        ...

    def plastic(self, e: Expr, old: Old) -> Expr:
        """1 where e is outside the elastic range, else 0."""
        ...

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return the fields of the strain that :meth:`tangent` needs at the points; any shapes.

        Args:
            e: The strain.
            old: The history.
            rho: ρ in [0, 1] of Σ^{o,ρ} = ρC + (1 − ρ)Σ°, with Σ° in the derivative of Σ at e.
        """
        ...

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Σ^{o,ρ}(e)[d], shape (m,), symmetric and not negative, from the stored fields."""
        ...

    def flow(self, e: Expr) -> Expr:
        """Plastic strain of the strain e of the virgin body, shape (m,): e − C⁻¹Σ(e) if perfect."""
        elastic = self.elastic.compliance(self.stress(e, {}))
        return self.plastic(e, {}) * (e - elastic)

    def updated(self, e: Expr, old: Old) -> Mapping[str, Expr]:
        """Return the history after a level that was accepted with the strain e."""
        return {}


@runtime_checkable
class Material(Protocol):
    """Parameters of a body and the law that they belong to.

    Attributes:
        law: The class of the law, a :class:`Law` when called with the parameters as keywords.
    """

    @property
    def law(self) -> type[Any]:
        """The class."""
        ...

    def parameters(self) -> Mapping[str, Strength]:
        """Return the numbers of the law, or fields, by the names of its arguments."""
        ...


def carries_any_load(material: Material) -> bool:
    """Whether a body hardens, so that it has no limit load; not where its law says nothing."""
    return bool(getattr(material.law, "carries_any_load", False))
