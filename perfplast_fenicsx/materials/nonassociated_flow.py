"""Ground that dilates by a smaller angle than that of friction: bodies with limits beside it.

No limit theorem holds for it, and the load at which it collapses need not be the only one. What
there is rests on associated ground, whose angle of dilatancy is that of friction:

- D. Radenkovic (Théorèmes limites pour un matériau de Coulomb à dilatation non standardisée, C. R.
  Acad. Sci. Paris 252 (1961), 4103): any such load lies between the limit loads of two associated
  grounds with the apex c cot φ in common: one with the angle of dilatancy ψ for that of friction,
  and so with the cohesion c tan ψ/tan φ, and one with c and φ. For where σ is on the surface of φ
  and the flow has the angle ψ, σ:ε ≥ c cot φ tr ε, which is the support of the weaker set.
- E. H. Davis (Theories of plasticity and the failure of soil masses, in: I. K. Lee (ed.), Soil
  Mechanics: Selected Topics, London 1968): one associated ground with βc and β tan φ, where
  β = cos φ cos ψ/(1 − sin φ sin ψ), which is an estimate and no bound. F. Tschuchnigg et al.
  (doi:10.1016/j.compgeo.2015.06.003) call it A where β is that of the given ground when strengths
  are reduced, B where it is that of the reduced angles, and C where of these ψ is kept.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal, Protocol, TypeGuard, TypeVar

from perfplast_fenicsx.errors import InputError, check_choice
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.spatial_fields import Strength

Stand = Literal["radenkovic", "davis-a", "davis-b", "davis-c"]
"""Ways to treat ground that dilates less than it rubs."""


class Ground(Material, Protocol):
    """A dataclass of ground with Mohr and Coulomb's numbers.

    Attributes:
        cohesion: c (stress).
        friction_angle: φ (degrees).
        dilatancy_angle: ψ (degrees); None for φ.
        nonassociated: What is made of ψ < φ; None where they are the same.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def cohesion(self) -> Strength:
        """Stress, or a field."""
        ...

    @property
    def friction_angle(self) -> float:
        """Degrees."""
        ...

    @property
    def dilatancy_angle(self) -> float | None:
        """Degrees."""
        ...

    @property
    def nonassociated(self) -> Stand | None:
        """Return how nonassociated ground is treated; None if its flow is associated."""
        ...


AnyGround = TypeVar("AnyGround", bound=Ground)


def check_dilatancy(ground: Ground) -> None:
    """Refuse an angle of dilatancy that nothing is made of.

    Raises:
        InputError: If it is not between 0 and that of friction, or less without a word on what is
            to stand for it; or if Radenkovic's weaker ground would have no strength.
    """
    psi, phi, stand = ground.dilatancy_angle, ground.friction_angle, ground.nonassociated
    if stand is not None:
        check_choice("nonassociated", stand, ("radenkovic", "davis-a", "davis-b", "davis-c"))
        if psi is None:
            raise InputError(
                f"nonassociated = '{stand}' needs a dilatancy_angle smaller than friction_angle;"
                " give one, or leave nonassociated out."
            )
    if psi is None:
        return
    if not 0 <= psi <= phi:
        raise InputError(
            f"dilatancy_angle = {psi:g} is not between 0 and friction_angle = {phi:g};"
            " leave it out, and ground dilates by its angle of friction."
        )
    if psi < phi and stand is None:
        raise InputError(
            f"dilatancy_angle = {psi:g} is less than friction_angle = {phi:g}, and no limit theorem"
            " holds then; leave it out, or give nonassociated = 'radenkovic' for bounds of all that"
            " it may carry, 'davis-a', 'davis-b' or 'davis-c' for an estimate by associated ground."
        )
    if psi == 0 and stand == "radenkovic":
        raise InputError(
            "dilatancy_angle = 0 has no lower bound by Radenkovic, whose weaker ground would have"
            " no strength; give a larger one, or nonassociated = 'davis-a' for an estimate."
        )


def associated(ground: AnyGround) -> AnyGround:
    """Return the associated ground that is computed with.

    By Davis that with βc and β tan φ; else that with the angle of friction of the given one.
    """
    if ground.nonassociated in (None, "radenkovic"):
        return replace(ground, dilatancy_angle=None, nonassociated=None)
    phi, psi = (math.radians(it) for it in (ground.friction_angle, _dilatancy(ground)))
    beta = math.cos(phi) * math.cos(psi) / (1 - math.sin(phi) * math.sin(psi))
    return _ground(ground, beta * ground.cohesion, math.atan(beta * math.tan(phi)))


def weaker(ground: AnyGround) -> AnyGround:
    """Return the weaker one of Radenkovic's pair, with ψ and c tan ψ/tan φ."""
    phi, psi = (math.radians(it) for it in (ground.friction_angle, _dilatancy(ground)))
    return _ground(ground, ground.cohesion * math.tan(psi) / math.tan(phi), psi)


def reduced(ground: AnyGround, factor: float) -> AnyGround:
    """Ground with c/F and tan φ/F, and where ψ matters with tan ψ/F, or by C with ψ itself.

    Args:
        ground: Any.
        factor: F > 0.
    """
    if ground.nonassociated in (None, "davis-a"):
        ground = associated(ground)
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
    """Weaker and stronger bodies between whose limit loads those of given ones lie.

    Returns:
        Both, by the names of volumes; None where each limit load is that of the bodies themselves.
    """
    if not any(_has_pair(it) for it in materials.values()):
        return None
    below, above = dict(materials), dict(materials)
    for name, material in materials.items():
        if _has_pair(material):
            below[name], above[name] = weaker(material), associated(material)
    return below, above


def check_flows(materials: Mapping[str, Material]) -> None:
    """Refuse ground of which bounds alone are known.

    Raises:
        InputError: If there is any, naming the first one.
    """
    for name, material in materials.items():
        if _has_pair(material):
            raise InputError(
                f"the ground of '{name}' has nonassociated = 'radenkovic', which bounds its limit"
                " loads and says nothing else; give control = 'bounds' or 'strength', or"
                " nonassociated = 'davis-a' for an estimate."
            )


def flow_words(materials: Mapping[str, Material]) -> list[str]:
    """Return a sentence for each kind of nonassociated ground: what the numbers hold for."""
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
                f"{psi}: bounds are Radenkovic's pair, of {with_these} from above, and with"
                f" {_numbers(weaker(material))} from below; all loads at which it may collapse lie"
                " between"
            )
        else:
            told.append(
                f"{psi}: by Davis' {str(material.nonassociated)[-1].upper()} {with_these} stands"
                " for it; all numbers are of that ground, an estimate of this one and no bound"
            )
    return told


def by_davis(materials: Mapping[str, Material]) -> bool:
    """Return whether associated ground stands for any, so that all numbers are estimates."""
    return any(_dilates_less(it) and not _has_pair(it) for it in materials.values())


def _numbers(ground: Ground) -> str:
    return f"cohesion {ground.cohesion:.5g} and angle of friction {ground.friction_angle:.5g}°"


def _dilates_less(material: Material) -> TypeGuard[Ground]:
    return getattr(material, "nonassociated", None) is not None


def _has_pair(material: Material) -> TypeGuard[Ground]:
    return getattr(material, "nonassociated", None) == "radenkovic"


def _dilatancy(ground: Ground) -> float:
    psi = ground.dilatancy_angle
    return ground.friction_angle if psi is None else psi


def _ground(ground: AnyGround, cohesion: Strength, phi: float) -> AnyGround:
    """Associated ground with c (stress) and φ (radians)."""
    return replace(
        ground,
        cohesion=cohesion,
        friction_angle=math.degrees(phi),
        dilatancy_angle=None,
        nonassociated=None,
    )
