"""Collect the yield sets of a problem's bodies from their laws, with coordinates for each set."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import ufl

from perfplast_fenicsx.arrays import Floats, Longs, matrices
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.cone import LawSet, PointSets, Provable
from perfplast_fenicsx.limit_analysis.conic.parabolas import Parabola
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import PrincipalCones
from perfplast_fenicsx.limit_analysis.discrete.standard_cones import (
    PlainCone,
    PlainPrincipal,
    Shadow,
    StandardCone,
    never_yields,
    shadow,
    standard_cone,
)
from perfplast_fenicsx.materials.law import (
    Cone,
    Material,
    ParabolicCone,
    PrincipalCone,
    in_plane_stress,
)
from perfplast_fenicsx.materials.mandel import mandel_size, numbers_of
from perfplast_fenicsx.materials.varying_friction import FrictionSine
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import TINY
from perfplast_fenicsx.spatial_fields import SpatialField

OfField: TypeAlias = Callable[[SpatialField, Longs], Floats]
"""Function that returns the values of a field in the cells, or at the points, with given
indices."""

NOMINAL_SINE = 0.5
"""Nominal value of sin φ in the cones of ground with a varying friction angle."""

NO_PROOF = "a proof file cannot contain the yield set of a body"

OUT_OF_PLANE = 2
"""Index of the out-of-plane Mandel component, which no equation contains in plane strain."""


@dataclass(frozen=True, eq=False)
class BodyCone:
    """The yield set of a body.

    Attributes:
        plain: Second-order cone of the stress components in the equations; None if the body never
            yields, or if its yield set is of another kind.
        principal: Set of principal stresses, in place of ``plain``.
        standard: The cone ``plain`` in standard coordinates; for other kinds of sets, a cone that
            encloses the set.
        shadow: Rule for the out-of-plane stress in plane strain; None otherwise.
        profile: Field that multiplies the bound c; None if the bound does not vary.
        friction: Sine of a varying friction angle; None if the angle does not vary. The slope q of
            the cone is the slope for ``NOMINAL_SINE``, and is proportional to the sine.
        other: Set of another kind, in place of ``plain``.
    """

    plain: PlainCone | None
    standard: StandardCone
    shadow: Shadow | None
    principal: PlainPrincipal | None = None
    profile: SpatialField | None = None
    friction: FrictionSine | None = None
    other: LawSet | None = None

    @property
    def yields(self) -> bool:
        """Return whether some stress is outside the set."""
        return not (self.plain is None and self.principal is None and self.other is None)

    def whole(self, stress: Floats) -> Floats:
        """Return stresses with the out-of-plane component that is deepest in the yield set."""
        if self.shadow is None:
            return stress
        free = stress @ self.shadow.along
        if self.plain is not None:
            free -= self.shadow.share * np.linalg.norm(stress @ self.plain.matrix.T, axis=1)
        return np.insert(stress, OUT_OF_PLANE, free, axis=1)


@dataclass(frozen=True, eq=False)
class BodyCones:
    """The cones of all bodies.

    Attributes:
        cones: The different cones.
        of_cells: Index in ``cones`` for each cell that this rank owns.
        normal: Number of normal stresses among the components in the equations.
    """

    cones: Sequence[BodyCone]
    of_cells: Longs
    normal: int

    @property
    def varies(self) -> bool:
        """Return whether the bound or the slope of any cone varies in space."""
        return any(cone.profile is not None or cone.friction is not None for cone in self.cones)

    def values(self, numbers: Longs, of: OfField) -> Floats | None:
        """Return values of the profiles in cells or at points; None if no bound varies.

        Args:
            numbers: Index of the cone of each cell or point, shape (n,).
            of: Function that returns the values of a profile, shape (m, ...), at indices of shape
                (m,).

        Returns:
            Values, shape (n, ...); 1 for cones whose bound does not vary.
        """
        return _values([cone.profile for cone in self.cones], numbers, of)

    def steepness(self, numbers: Longs, of: OfField) -> Floats | None:
        """Return factors of the slopes in cells or at points; None if no slope varies.

        Args:
            numbers: Index of the cone of each cell or point, shape (n,).
            of: Function that returns the values of a sine, shape (m,), at indices of shape (m,).

        Returns:
            Factors, shape (n,); 1 for cones whose slope does not vary.
        """

        def share(sine: SpatialField, here: Longs) -> Floats:
            return np.asarray(of(sine, here) / NOMINAL_SINE, np.float64)

        return _values([cone.friction for cone in self.cones], numbers, share)

    @property
    def isotropic(self) -> bool:
        """Return whether mean stress and deviator are the coordinates of all cones."""
        return all(cone.standard.isotropic for cone in self.cones)

    @property
    def dilates(self) -> bool:
        """Return whether at least one cone has a slope."""
        return any(cone.standard.slope > 0 for cone in self.cones)

    @property
    def loose(self) -> bool:
        """Return whether at least one cone has no cohesion."""
        return any(cone.standard.radius == 0 for cone in self.cones)

    def principal_at(self, numbers: Longs) -> PrincipalCones:
        """Return the sets of principal stresses at the points that have such sets.

        Args:
            numbers: Index of the cone of each point.
        """
        found = [i for i, cone in enumerate(self.cones) if cone.principal is not None]
        if not found:
            return PrincipalCones.none()
        sets = [it.principal or PlainPrincipal(0.0, 0.0) for it in self.cones]
        at = np.flatnonzero(np.isin(numbers, found))
        of_sets: Floats = np.array([astuple(it) for it in sets])[numbers[at]]
        bounds, sines, tensions = of_sets.T
        return PrincipalCones(at, bounds, sines, tensions, *self._tensors(found[0]))

    def _tensors(self, number: int) -> tuple[Floats, bool]:
        """Return the tensors of a cone's coordinates, and whether the coordinates are in-plane."""
        rows, flat = self.cones[number].standard.frame.T, self.normal == OUT_OF_PLANE
        if flat:  # the out-of-plane stress lies between the in-plane principal stresses
            rows = np.insert(rows, OUT_OF_PLANE, np.eye(len(rows))[0], axis=1)
        return matrices(rows), flat

    def sets_at(self, numbers: Longs, profile: Floats | None) -> tuple[PointSets, ...]:
        """Return the sets at points without a second-order cone, one entry for each kind of set.

        Args:
            numbers: Index of the cone of each point.
            profile: Factor of the strength at each point; None if no strength varies.
        """
        principal = self.principal_at(numbers)
        if profile is not None:
            principal = principal.scaled(profile)
        found: list[PointSets] = [principal] if principal.count else []
        for number, cone in enumerate(self.cones):
            if cone.other is not None:
                at = np.flatnonzero(numbers == number)
                found.append(cone.other.at_points(at, *self._tensors(number)))
        return tuple(found)

    def at_cells(self) -> tuple[Floats, Floats, Floats | None]:
        """Return the numbers of :meth:`at` in the cells."""
        return self.at(self.of_cells)

    def at(self, numbers: Longs) -> tuple[Floats, Floats, Floats | None]:
        """Return γ (stress), α and t, without the factors of profiles and angles.

        The result has None in place of t if all tilts are zero.

        Args:
            numbers: Index of the cone of each cell or point.
        """
        forms = [cone.standard for cone in self.cones]
        radii = np.array([form.radius for form in forms])
        slopes = np.array([form.slope for form in forms])
        size = max(len(form.tilt) for form in forms)
        tilts = np.array([np.pad(form.tilt, (0, size - len(form.tilt))) for form in forms])
        return radii[numbers], slopes[numbers], tilts[numbers] if tilts.any() else None


def _values(fields: Sequence[SpatialField | None], numbers: Longs, of: OfField) -> Floats | None:
    """Return the values of the cones' fields, 1 for cones without a field; None without fields."""
    found: Floats | None = None
    for number, field in enumerate(fields):
        if field is None:
            continue
        here = np.flatnonzero(numbers == number)
        values = of(field, here)
        if found is None:
            found = np.ones((len(numbers), *values.shape[1:]))
        found[here] = values
    return found


@once_a_problem
def body_cones(problem: Problem) -> BodyCones:
    """Return the cones of the bodies. Not collective, because all ranks have the same materials.

    Raises:
        InputError: If the interior point method does not support a body's yield set.
    """
    return _cones(problem, not problem.kinematics.whole)


@once_a_problem
def whole_cones(problem: Problem) -> BodyCones:
    """Return the bodies' cones with all stress components, including the out-of-plane one.

    Not collective.

    Raises:
        InputError: If the interior point method does not support a body's yield set.
    """
    return _cones(problem, False)


def _cones(problem: Problem, flat: bool) -> BodyCones:
    """Return the cones of the bodies.

    Args:
        problem: The bodies.
        flat: Whether the out-of-plane stress is in no equation.

    Raises:
        InputError: If the interior point method does not support a body's yield set.
    """
    tagged_mesh, materials = problem.tagged_mesh, materials_of(problem)
    topology = tagged_mesh.mesh.topology
    of_cells = np.zeros(topology.index_map(topology.dim).size_local, dtype=np.int64)
    found: list[BodyCone] = []
    for name in sorted(tagged_mesh.volumes):
        cone = _cone_of(problem, materials[name], flat)
        if cone is None and getattr(materials[name], "cohesion", None) == 0:
            raise InputError(
                f"cohesion = 0 in volume '{name}': in 3D and in axisymmetry the interior point "
                "method needs a positive cohesion for law = 'mohr-coulomb'; give a small one, "
                "such as a thousandth of the constant pressures, or of the unit weight times the "
                "height."
            )
        if cone is None:
            raise InputError(
                "the interior point method does not support the yield set of"
                f" {materials[name].law.__name__} (volume '{name}'); give limit_method = 'path',"
                ' a law whose yield set is one cone, or law = "elastic".'
            )
        number = next((i for i, it in enumerate(found) if _is_same(it, cone)), len(found))
        if number == len(found):
            found.append(cone)
        cells = tagged_mesh.cells(name)
        of_cells[cells[cells < len(of_cells)]] = number
    return BodyCones(tuple(found), of_cells, 2 if flat else 3)


def check_cones_are_provable(problem: Problem) -> None:
    """Check that proof files can describe the yield sets of all bodies. Not collective.

    Raises:
        InputError: If proof files cannot describe a yield set; the message names the first body.
    """
    if are_provable(problem):
        return
    for name, material in sorted(materials_of(problem).items()):
        cone = _cone_of(problem, material, not problem.kinematics.whole)
        if cone is not None and not _is_provable(cone):
            raise InputError(
                f"strict bounds cannot be proven for the yield set of {material.law.__name__} "
                f"(volume '{name}'); compute only the limit load of the mesh (control = 'work', "
                "until = 'limit')."
            )


def are_provable(problem: Problem) -> bool:
    """Return whether proof files can describe the yield sets of all bodies. Not collective."""
    return all(_is_provable(cone) for cone in body_cones(problem).cones)


def _is_provable(cone: BodyCone) -> bool:
    return cone.other is None or isinstance(cone.other, Provable)


def check_whole_cones(problem: Problem) -> None:
    """Check that the full stress of each body has a cone with constant numbers. Not collective.

    Raises:
        InputError: If a body has no such cone; the message names the first body.
    """
    for name, material in sorted(materials_of(problem).items()):
        if any(isinstance(one, SpatialField) for one in material.parameters().values()):
            raise InputError(
                f"a strength of '{name}' varies in space, but shakedown needs constant values; "
                "give a separate body for each layer, or compute a limit load instead."
            )
        if _cone_of(problem, material, False) is not None:
            continue
        if getattr(material, "cohesion", None) == 0:
            raise InputError(
                f"cohesion = 0 in volume '{name}': shakedown needs a positive cohesion for law = "
                "'mohr-coulomb'; give a small one, such as a thousandth of the constant pressures."
            )
        raise InputError(
            "shakedown needs a yield set that is a single cone of stresses, unlike the yield set "
            f"of '{name}' ({type(material).__name__}); give law = 'von-mises', 'tresca', "
            "'mohr-coulomb', 'drucker-prager', 'hill' or 'elastic'."
        )


def has_cones(problem: Problem) -> bool:
    """Return whether the interior point method supports the yield sets of all bodies."""
    flat, materials = not problem.kinematics.whole, materials_of(problem).values()
    return all(_cone_of(problem, it, flat) is not None for it in materials)


def materials_of(problem: Problem) -> Mapping[str, Material]:
    """Return the material of each volume, converted to plane stress in thin bodies."""
    given = problem.given.materials
    return in_plane_stress(given) if problem.tagged_mesh.is_thin else given


def _is_same(one: BodyCone, other: BodyCone) -> bool:
    names = ("plain", "principal", "other", "profile", "friction")
    return all(getattr(one, name) == getattr(other, name) for name in names)


def _cone_of(problem: Problem, material: Material, flat: bool) -> BodyCone | None:
    """Return the cone of a body; None if the interior point method does not support its set.

    The numbers of the cone contain the scale of a varying parameter; the profile is separate.

    Args:
        problem: The bodies.
        material: Material of the body.
        flat: Whether the out-of-plane stress is in no equation.

    Raises:
        InputError: If the method does not support the spatial variation of a parameter.
    """
    tagged_mesh, given = problem.tagged_mesh, material.parameters()
    of = mandel_size(tagged_mesh.mesh.geometry.dim), flat, tagged_mesh.is_thin
    sines = [one for one in given.values() if isinstance(one, FrictionSine)]
    varies = [k for k, v in given.items() if isinstance(v, SpatialField) and v not in sines]
    profiles = {given[k].profile for k in varies}
    plain = {k: given[k].scale if k in varies else v for k, v in given.items()}
    plain |= {k: NOMINAL_SINE for k, v in given.items() if v in sines}
    found = _of_numbers(material.law, plain, of)
    if sines and (found is None or found.plain is None or not flat):
        raise InputError(
            f"friction_angle of {type(material).__name__}, {sines[0].friction}, varies in space, "
            "which limit loads by the interior point method and strict bounds support only in "
            "plane strain; give a number, and a separate body for each layer."
        )
    if found is None or not (profiles or sines):
        return found
    friction = sines[0] if sines else None
    if not profiles:
        return replace(found, friction=friction)
    twice = {k: 2 * v if k in varies else v for k, v in plain.items()}
    larger = _of_numbers(material.law, twice, of)
    if len(profiles) > 1 or not _is_twice(larger, found):
        raise InputError(
            f"a parameter of {type(material).__name__} varies in space, but the yield set is not "
            "proportional to this parameter, as limit loads by the interior point method and "
            "strict bounds require; give constant parameters, and a separate body for each layer."
        )
    return replace(found, profile=profiles.pop(), friction=friction)


def _is_twice(one: BodyCone | None, other: BodyCone) -> bool:
    """Return whether ``one`` has the shape of ``other`` and twice the bound of ``other``."""
    if one is None or other.other is not None:
        return False
    twice = (it and replace(it, bound=2 * it.bound) for it in (other.plain, other.principal))
    return (one.plain, one.principal) == tuple(twice)


def _of_numbers(
    kind: type[Any], given: Mapping[str, float], of: tuple[int, bool, bool]
) -> BodyCone | None:
    """Return the cone of a law with constant numbers, or None; see :func:`_cone_of`.

    Args:
        kind: The law.
        given: Parameters of the law by name.
        of: Number of components of Mandel vectors; whether the out-of-plane stress is in no
            equation, and whether it is zero (only if it is in no equation).
    """
    size, flat, thin = of
    law: Any = kind(**{name: ufl.as_ufl(value) for name, value in given.items()})
    cones = None if law.carries_any_load else law.yields.cones(size)
    normal, n = (2, 3) if flat else (3, size)
    if cones is None or len(cones) > 1:
        return None
    usual = np.zeros(3) if thin else np.array([0.5, 0.5, 0.0])
    none = Shadow(None, usual, 0.0) if flat else None
    if not cones:
        return BodyCone(None, never_yields(n, normal), none)
    if not isinstance(cones[0], Cone | PrincipalCone):
        other = cones[0]
        if isinstance(other, ParabolicCone):
            other = Parabola(*(float(numbers_of(it)) for it in (other.curvature, other.tension)))
        radius, slope = other.around(flat)
        around = replace(never_yields(n, normal), radius=radius, slope=slope, isotropic=False)
        return BodyCone(None, around, none, other=other)
    if isinstance(cones[0], PrincipalCone):
        principal = _principal(cones[0], law)
        by_matrices = not flat or np.isfinite(principal.tension)
        if by_matrices and principal.bound == 0:
            return None  # the set has no interior stress from which the iteration could start
        if by_matrices:
            return BodyCone(None, principal.around(n, normal), none, principal)
        plain = principal.in_plane()
    else:
        plain = plain_cone(cones[0], law, size)
        if flat:
            none = shadow(plain, OUT_OF_PLANE, usual)
            if none.cone is None:
                return BodyCone(None, never_yields(n, normal), none)
            plain = none.cone
    plain = plain.normalised()
    standard = standard_cone(plain, normal)
    return None if standard is None else BodyCone(plain, standard, none)


def plain_cone(cone: Cone, law: Any, size: int) -> PlainCone:
    """Return the numbers of a second-order cone.

    Args:
        cone: Cone that the law returns.
        law: The law, for the message.
        size: Number of components of stress, for the message.

    Raises:
        InputError: If the numbers do not describe a cone that contains zero stress.
    """
    plain = PlainCone(
        float(numbers_of(cone.bound)), numbers_of(cone.slope), numbers_of(cone.matrix)
    )
    if not plain.is_cone:
        raise InputError(
            f"zero stress must lie inside the cone of {type(law).__name__}: bound = "
            f"{plain.bound:.6g} must be positive, or 0 with a slope, and the matrix must have "
            f"full row rank, with a column for each of {size} components of stress; correct the "
            "return value of its method yields.cones."
        )
    return plain


def _principal(cone: PrincipalCone, law: Any) -> PlainPrincipal:
    """Return the numbers of a cone of principal stresses.

    Args:
        cone: Cone that the law returns.
        law: The law, for the message.

    Raises:
        InputError: If the numbers do not describe a set that contains zero stress.
    """
    tension = np.inf if cone.tension is None else float(numbers_of(cone.tension))
    found = PlainPrincipal(float(numbers_of(cone.bound)), float(numbers_of(cone.sine)), tension)
    least = 0.0 if found.sine > 0 else TINY
    within = 2 * found.sine * tension < found.bound or tension == np.inf
    if not (found.bound >= least and 0 <= found.sine < 1 and tension > 0 and within):
        raise InputError(
            f"the set of {type(law).__name__} has bound = {found.bound:.6g}, sine = "
            f"{found.sine:.6g} and tension = {tension:.6g}, but bound must be positive (or 0 with "
            "a sine), sine in [0, 1), and tension positive and below the apex; correct the "
            "return value of its method yields.cones."
        )
    return found
