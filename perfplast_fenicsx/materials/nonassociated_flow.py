"""Replace ground with ψ < φ by associated ground that bounds or estimates its collapse loads.

No limit theorem holds for ground with ψ < φ, and the collapse load of this ground need not be
unique. All results use associated ground, whose dilatancy angle equals its friction angle:

- D. Radenkovic (Théorèmes limites pour un matériau de Coulomb à dilatation non standardisée, C. R.
  Acad. Sci. Paris 252 (1961), 4103): any collapse load lies between the limit loads of two
  associated grounds with the same apex c cot φ. The weaker ground has ψ as its friction angle and
  the cohesion c tan ψ/tan φ; the stronger ground has c and φ. If σ is on the yield surface for φ
  and the flow has the angle ψ, then σ:ε ≥ c cot φ tr ε. The right-hand side is the support function
  of the weaker set.
- E. H. Davis (Theories of plasticity and the failure of soil masses, in: I. K. Lee (ed.), Soil
  Mechanics: Selected Topics, London 1968): one associated ground with βc and β tan φ, where β = cos
  φ cos ψ/(1 − sin φ sin ψ). This method gives an estimate and not a bound. F. Tschuchnigg et al.
  (doi:10.1016/j.compgeo.2015.06.003) distinguish three variants for reduced strengths: A uses β for
  the given angles, B uses β for the reduced angles, and C does not reduce ψ.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal, Protocol, TypeGuard, TypeVar

from perfplast_fenicsx.errors import InputError, check_choice
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.materials.varying_friction import divided_friction
from perfplast_fenicsx.spatial_fields import SpatialField, Strength

Stand = Literal["radenkovic", "davis-a", "davis-b", "davis-c"]
"""Ways to treat ground whose dilatancy angle is below its friction angle."""


class Ground(Material, Protocol):
    """A dataclass for ground with the Mohr–Coulomb parameters.

    Attributes:
        cohesion: Cohesion c (stress).
        friction_angle: Friction angle φ (degrees).
        dilatancy_angle: Dilatancy angle ψ (degrees); None for ψ = φ.
        nonassociated: Treatment of ψ < φ; None if both angles are equal.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def cohesion(self) -> Strength:
        """Return the cohesion (stress), as a number or a field."""
        ...

    @property
    def friction_angle(self) -> Strength:
        """Return the friction angle (degrees), as a number or a field."""
        ...

    @property
    def dilatancy_angle(self) -> float | None:
        """Return the dilatancy angle (degrees); None if it is the friction angle."""
        ...

    @property
    def nonassociated(self) -> Stand | None:
        """Return the treatment of nonassociated ground; None if the flow is associated."""
        ...


AnyGround = TypeVar("AnyGround", bound=Ground)


def check_dilatancy(ground: Ground) -> None:
    """Refuse a dilatancy angle that is not valid, or that needs a treatment but has none.

    Raises:
        InputError: If the dilatancy angle is not between 0 and the friction angle, if it is smaller
            than the friction angle but ``nonassociated`` is missing, or if Radenkovic's weaker
            ground would have no strength.
    """
    psi, phi, stand = ground.dilatancy_angle, ground.friction_angle, ground.nonassociated
    if stand is not None:
        check_choice("nonassociated", stand, ("radenkovic", "davis-a", "davis-b", "davis-c"))
        if psi is None:
            raise InputError(
                f"nonassociated = '{stand}' needs a dilatancy_angle smaller than "
                "friction_angle; give one, or remove nonassociated."
            )
    if psi is None:
        return
    if not 0 <= psi <= phi:
        raise InputError(
            f"dilatancy_angle = {psi:g} is not between 0 and friction_angle = {phi:g}; give an "
            "angle in this range, or remove the key to use the friction angle."
        )
    if psi < phi and stand is None:
        raise InputError(
            f"dilatancy_angle = {psi:g} is less than friction_angle = {phi:g}, so no limit "
            "theorem holds; remove it, or give nonassociated = 'radenkovic' for bounds on "
            "all possible collapse loads, or 'davis-a', 'davis-b' or 'davis-c' for an estimate "
            "with associated ground."
        )
    if psi == 0 and stand == "radenkovic":
        raise InputError(
            "dilatancy_angle = 0 does not permit a lower bound by Radenkovic's theorem, because "
            "the weaker ground of his pair would have no strength; give a larger angle, or "
            "nonassociated = 'davis-a' for an estimate."
        )


def associated(ground: AnyGround) -> AnyGround:
    """Return the associated ground that the computation uses.

    For Davis' methods this ground has βc and β tan φ; otherwise it has c and φ.
    """
    if ground.nonassociated in (None, "radenkovic"):
        return replace(ground, dilatancy_angle=None, nonassociated=None)
    phi, psi = (math.radians(it) for it in (ground.friction_angle, _dilatancy(ground)))
    beta = math.cos(phi) * math.cos(psi) / (1 - math.sin(phi) * math.sin(psi))
    return _ground(ground, beta * ground.cohesion, math.atan(beta * math.tan(phi)))


def weaker(ground: AnyGround) -> AnyGround:
    """Return the weaker ground of Radenkovic's pair: friction angle ψ, cohesion c tan ψ/tan φ."""
    phi, psi = (math.radians(it) for it in (ground.friction_angle, _dilatancy(ground)))
    return _ground(ground, ground.cohesion * math.tan(psi) / math.tan(phi), psi)


def reduced(ground: AnyGround, factor: float) -> AnyGround:
    """Return ground with c/F and tan φ/F.

    For Davis' method A, the result is associated ground with βc/F and β tan φ/F. Method C keeps ψ,
    but at most the reduced φ. In all other cases, F also divides tan ψ.

    Args:
        ground: Any ground.
        factor: F > 0.
    """
    if ground.nonassociated in (None, "davis-a"):
        ground = associated(ground)
    if isinstance(ground.friction_angle, SpatialField):
        friction = divided_friction(ground.friction_angle, factor)
        return replace(ground, cohesion=ground.cohesion / factor, friction_angle=friction)
    phi = math.atan(math.tan(math.radians(ground.friction_angle)) / factor)
    if ground.nonassociated is None:
        return _ground(ground, ground.cohesion / factor, phi)
    psi = math.radians(_dilatancy(ground))
    if ground.nonassociated == "davis-c":
        psi = min(psi, phi)
    else:
        psi = math.atan(math.tan(psi) / factor)
    degrees = math.degrees(phi)
    return replace(
        ground,
        cohesion=ground.cohesion / factor,
        friction_angle=degrees,
        dilatancy_angle=min(math.degrees(psi), degrees),
    )


def pair_of(
    materials: Mapping[str, Material],
) -> tuple[dict[str, Material], dict[str, Material]] | None:
    """Return weaker and stronger materials whose limit loads bound the collapse loads.

    Returns:
        Weaker and stronger materials by the names of volumes; None if no ground needs such a pair.
    """
    if not any(_has_pair(it) for it in materials.values()):
        return None
    below, above = dict(materials), dict(materials)
    for name, material in materials.items():
        if _has_pair(material):
            below[name], above[name] = weaker(material), associated(material)
    return below, above


def check_flows(materials: Mapping[str, Material]) -> None:
    """Refuse ground with ``nonassociated = 'radenkovic'``, for which only bounds exist.

    Raises:
        InputError: If there is such ground; the message names the first volume.
    """
    for name, material in materials.items():
        if _has_pair(material):
            raise InputError(
                f"the ground of '{name}' has nonassociated = 'radenkovic', for which only bounds "
                "are known; give control = 'bounds' or 'strength', or nonassociated = 'davis-a' "
                "for an estimate."
            )


def flow_words(materials: Mapping[str, Material]) -> list[str]:
    """Return, for each different nonassociated ground, a clause on the meaning of the results."""
    told = []
    bodies = list(materials.values())
    for material in (it for i, it in enumerate(bodies) if it not in bodies[:i]):
        if not _dilates_less(material):
            continue
        names = " and ".join(f"'{name}'" for name, it in materials.items() if it == material)
        psi = f"the ground of {names} dilates by {_dilatancy(material):g}°"
        with_these = f"associated ground with {_numbers(associated(material))}"
        if _has_pair(material):
            told.append(
                f"{psi}: the bounds are Radenkovic's pair, from {with_these} above and from ground "
                f"with {_numbers(weaker(material))} below; all possible collapse loads lie between "
                "them"
            )
        else:
            told.append(
                f"{psi}: Davis' method {str(material.nonassociated)[-1].upper()} replaces it by "
                f"{with_these}; all numbers are for that ground, so they are estimates and not "
                "bounds"
            )
    return told


def by_davis(materials: Mapping[str, Material]) -> bool:
    """Return whether Davis' method replaces any ground; all results are then estimates."""
    return any(_dilates_less(it) and not _has_pair(it) for it in materials.values())


def _numbers(ground: Ground) -> str:
    return f"cohesion {ground.cohesion:.5g} and friction angle {ground.friction_angle:.5g}°"


def _dilates_less(material: Material) -> TypeGuard[Ground]:
    return getattr(material, "nonassociated", None) is not None


def _has_pair(material: Material) -> TypeGuard[Ground]:
    return getattr(material, "nonassociated", None) == "radenkovic"


def _dilatancy(ground: Ground) -> float:
    psi = ground.dilatancy_angle
    return ground.friction_angle if psi is None else psi


def _ground(ground: AnyGround, cohesion: Strength, phi: float) -> AnyGround:
    """Return associated ground with c (stress) and φ (radians)."""
    return replace(
        ground,
        cohesion=cohesion,
        friction_angle=math.degrees(phi),
        dilatancy_angle=None,
        nonassociated=None,
    )
