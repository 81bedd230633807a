"""Define linear elasticity and rigid blocks."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from perfplast_fenicsx.errors import InputError, check_magnitude
from perfplast_fenicsx.materials.law import Elasticity, Law, Material, NeverYields, Old
from perfplast_fenicsx.materials.mandel import Expr, IsotropicElasticity
from perfplast_fenicsx.materials.sheet import SheetElasticity
from perfplast_fenicsx.spatial_fields import SpatialField, Strength


@dataclass(frozen=True)
class ElasticLaw(Law):
    """Hooke's law Σ(e) = Ce; :class:`Law` describes the methods.

    Args:
        bulk: κ (stress).
        shear: μ (stress).
    """

    bulk: Expr
    shear: Expr
    projects: ClassVar[bool] = True

    @property
    def elastic(self) -> Elasticity:
        """Return Hooke's tensor C."""
        return IsotropicElasticity(self.bulk, self.shear)

    def stress(self, e: Expr, old: Old) -> Expr:
        """Return C e."""
        return self.elastic.hooke(e)

    def potential(self, e: Expr, old: Old) -> Expr:
        """Return ½ e:Ce."""
        return ufl.dot(self.elastic.hooke(e), e) / 2

    def conjugate(self, s: Expr, old: Old) -> Expr:
        """Return ½ s:C⁻¹s."""
        return ufl.dot(self.elastic.compliance(s), s) / 2

    def plastic(self, e: Expr, old: Old) -> Expr:
        """Return 0."""
        return ufl.as_ufl(0)

    def tangent_fields(self, e: Expr, old: Old, rho: Expr) -> Mapping[str, Expr]:
        """Return no fields, because the tangent is C."""
        return {}

    def tangent(self, stored: Mapping[str, Expr], d: Expr) -> Expr:
        """Return C d."""
        return self.elastic.hooke(d)

    @property
    def yields(self) -> NeverYields:
        """Return the set of all stresses."""
        return NeverYields()


@dataclass(frozen=True)
class Elastic:
    """A linear elastic body.

    Args:
        young: Young's modulus E > 0 (stress).
        poisson: Poisson's ratio ν in (−1, ½).
        expansion: Thermal strain per degree (1/temperature).

    Raises:
        InputError: If a number is out of its range.
    """

    young: float
    poisson: float
    expansion: float = 0.0

    @property
    def law(self) -> type[ElasticLaw]:
        """Return the class of the law."""
        return ElasticLaw

    def __post_init__(self) -> None:
        require_positive("young", self.young)
        if not math.isfinite(self.expansion):
            raise InputError(
                f"expansion = {self.expansion} is not finite; give a number, or remove it."
            )
        if not -1.0 < self.poisson < 0.5:
            raise InputError(
                f"poisson = {self.poisson} is outside (-1, 1/2); give Poisson's ratio strictly "
                "between these limits (0.499 is fine for a nearly incompressible body)."
            )

    @property
    def bulk(self) -> float:
        """Return κ = E / (3(1 − 2ν))."""
        return self.young / (3 * (1 - 2 * self.poisson))

    @property
    def shear(self) -> float:
        """Return μ = E / (2(1 + ν))."""
        return self.young / (2 * (1 + self.poisson))

    def divided_by(self, factor: float) -> "Elastic":
        """Return the material itself for any factor, since it has no strength."""
        return self

    def remembering(self) -> "Elastic":
        """Return the material itself, since it has no plastic flow."""
        return self

    def in_plane_stress(self) -> "ElasticSheet":
        """Return the same material with σ_zz = 0."""
        return ElasticSheet(self.young, self.poisson, self.expansion)

    def parameters(self) -> dict[str, float]:
        """Return κ and μ of :class:`ElasticLaw`."""
        return {"bulk": self.bulk, "shear": self.shear}


@dataclass(frozen=True)
class ElasticSheetLaw(ElasticLaw):
    """Hooke's law in plane stress."""

    @property
    def elastic(self) -> SheetElasticity:
        """Return Hooke's tensor C of a sheet."""
        return SheetElasticity(self.bulk, self.shear)


@dataclass(frozen=True)
class ElasticSheet(Elastic):
    """A linear elastic body in plane stress."""

    @property
    def law(self) -> type[ElasticSheetLaw]:
        """Return the class of the law."""
        return ElasticSheetLaw


@dataclass(frozen=True)
class Rigid:
    """A rigid block, such as a block of masonry; it moves as a whole and carries any stress.

    Bounds on limit loads and factors of safety support rigid blocks. Levels support rigid blocks
    together with bodies that deform. If no body can yield, only the joints limit the load.
    """

    @property
    def law(self) -> type[ElasticLaw]:
        """Return the class of the law."""
        return ElasticLaw

    def divided_by(self, factor: float) -> "Rigid":
        """Return the material itself for any factor, since it has no strength."""
        return self

    def remembering(self) -> "Rigid":
        """Return the material itself, since it has no plastic flow."""
        return self

    def in_plane_stress(self) -> "Rigid":
        """Return the material itself, since it has no strain."""
        return self

    def parameters(self) -> dict[str, float]:
        """Return unit moduli; bounds do not depend on them."""
        return {"bulk": 1.0, "shear": 1.0}


def with_stand_ins(materials: Mapping[str, Material]) -> dict[str, Material]:
    """Return the materials, with an elastic material in place of each rigid material.

    Rigid bodies do not strain. The stiffness of the elastic material therefore affects only the
    springs that restrain free rigid-body motions. The function uses the shear modulus of the
    stiffest other body.
    """
    known = (of.parameters().get("shear") for of in materials.values() if not isinstance(of, Rigid))
    shear = max((float(it) for it in known if isinstance(it, int | float)), default=1.0)
    stiff = Elastic(young=2 * shear, poisson=0.0)
    return {name: stiff if isinstance(of, Rigid) else of for name, of in materials.items()}


def check_deforms(materials: Mapping[str, object]) -> None:
    """Refuse a problem in which all bodies are rigid, before stresses are computed.

    With only rigid blocks, the functional J_ζ of a level is positively homogeneous on a cone of
    motions. Its infimum is therefore 0, attained at rest, or −∞ above the limit load. The dual
    problem has many solutions: all joint forces that balance the loads and lie in the friction
    cones.

    Raises:
        InputError: If all bodies are rigid; the message names the first body.
    """
    name = next((name for name, of in materials.items() if isinstance(of, Rigid)), None)
    if name is not None and all(isinstance(of, Rigid) for of in materials.values()):
        raise InputError(
            f"all bodies, such as '{name}', have law = 'rigid', and levels of rigid blocks are "
            "undefined: blocks do not move under loads that they can carry, and the forces in "
            "their joints are not unique; give control = 'bounds' or 'strength' (control = "
            "'bounds' with constant = true for all loads shows whether the bodies can carry the "
            "loads)."
        )


def check_returns(materials: Mapping[str, Material]) -> None:
    """Refuse a law that yields, but inherits the stress of :class:`ElasticLaw`, before levels.

    Raises:
        InputError: If there is such a law; the message names the first volume.
    """
    for name, material in materials.items():
        law = getattr(material, "body", material).law  # of a material that remembers its flow
        if law.yields is not ElasticLaw.yields and law.stress is ElasticLaw.stress:
            raise InputError(
                f"the law of '{name}', {law.__name__}, has no return mapping, so load levels would "
                "be elastic at any load; give control = 'bounds', or define its method stress."
            )


def require_not_negative(field: str, value: Strength) -> None:
    """Refuse a material parameter that is negative or not finite.

    The function also refuses the numbers that ``check_magnitude`` refuses. It accepts a value
    that varies in space; :mod:`law_on_cells` checks such a value on the mesh.

    Raises:
        InputError: If the value is refused; the message names the field and the value.
    """
    if isinstance(value, SpatialField):
        return
    if not (value >= 0 and math.isfinite(value)):
        raise InputError(f"{field} = {value} is negative or not a number; give zero or more.")
    check_magnitude(field, value)


def require_positive(field: str, value: Strength) -> None:
    """Refuse a material parameter that is not positive and finite.

    The function also refuses the numbers that ``check_magnitude`` refuses. It accepts a value
    that varies in space; :mod:`law_on_cells` checks such a value on the mesh.

    Raises:
        InputError: If the value is refused; the message names the field and the value.
    """
    if isinstance(value, SpatialField):
        return
    if not (value > 0 and math.isfinite(value)):
        raise InputError(
            f"{field} = {value} is not a positive number; give a positive number in stress units."
        )
    check_magnitude(field, value)


def all_elastic(materials: Iterable[object]) -> bool:
    """Return whether no material can yield."""
    return all(isinstance(material, Elastic | Rigid) for material in materials)
