"""Apply the laws of a problem on the cells of their bodies.

Bodies whose materials use the same class of law are evaluated together.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, TypeAlias

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from ufl.core.terminal import Terminal

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.compat import evaluate, interpolation_points
from perfplast_fenicsx.errors import InputError, place_of, raise_together
from perfplast_fenicsx.materials.law import Law, Material, in_plane_stress
from perfplast_fenicsx.materials.mandel import Expr, mandel_size, numbers_of
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.spaces import (
    Spaces,
    coordinates_of_points,
    space_at_points,
)
from perfplast_fenicsx.spatial_fields import SpatialField


@dataclass(frozen=True, eq=False)
class LawOnCells:
    """A law, and the cells in which it applies.

    Attributes:
        law: The law. Its parameters are functions on all of Q; their values outside ``cells`` have
            no meaning.
        numbers: Functions of the parameters, by name. Other functions under these names define
            another law of the same class.
        old: History of the law as functions at the points, by name. Laws whose history has the same
            names share these functions.
        cells: Local cells of the law, including ghosts, sorted.
        dx: Measure for integrals over the cells of the law.
    """

    law: Law
    numbers: Mapping[str, fem.Function]
    old: Mapping[str, fem.Function]
    cells: Ints
    dx: Any

    def __repr__(self) -> str:
        numbers = ", ".join(self.numbers)
        return f"LawOnCells({type(self.law).__name__}: {numbers}; {len(self.cells)} cells)"


OfLaw: TypeAlias = Callable[[LawOnCells], Expr]
"""Function that returns an expression for a law."""


def lay_out(
    tagged_mesh: TaggedMesh, spaces: Spaces, materials: Mapping[str, Material]
) -> tuple[LawOnCells, ...]:
    """Return the laws of the materials on the cells of their bodies. Collective.

    Args:
        tagged_mesh: The bodies.
        spaces: The finite element spaces of the bodies.
        materials: Material of each volume.

    Raises:
        InputError: If a volume is unknown or has no material, if a material is invalid, or if laws
            have history variables of the same name and different shapes.
    """
    _check(tagged_mesh, materials)
    if tagged_mesh.is_thin:
        materials = in_plane_stress(materials)
    topology = tagged_mesh.mesh.topology
    index_map = topology.index_map(topology.dim)
    every = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    bodies: dict[type, list[str]] = {}
    for name in sorted(materials):
        bodies.setdefault(materials[name].law, []).append(name)
    cells = [
        np.sort(np.concatenate([tagged_mesh.cells(name) for name in names])).astype(np.int32)
        for names in bodies.values()
    ]
    dx = spaces.dx
    if len(bodies) == 1:
        cells, parts = [every], [dx]
    else:
        owned = [(i, some[some < index_map.size_local]) for i, some in enumerate(cells)]
        parts = [dx(i, subdomain_data=owned) for i in range(len(bodies))]
    numbers = _parameters(tagged_mesh, spaces, materials)
    old: dict[str, fem.Function] = {}
    found = []
    for (law_class, names), some, part in zip(bodies.items(), cells, parts, strict=True):
        own = {key: numbers[key] for key in materials[names[0]].parameters()}
        law = law_class(**own)
        found.append(LawOnCells(law, own, _history(law, spaces, old), some, part))
    return tuple(found)


def _check(tagged_mesh: TaggedMesh, materials: Mapping[str, Material]) -> None:
    for name, material in materials.items():
        tagged_mesh.cells(name)
        if not isinstance(material, Material):
            raise InputError(
                f"the material of volume '{name}' is {material!r}, which has neither a law nor "
                "parameters; give a material from perfplast_fenicsx.materials."
            )
        plane = tagged_mesh.mesh.geometry.dim == 2 and not tagged_mesh.axisymmetric
        if getattr(material.law, "plane_strain_only", False) and not plane:
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, is for plane strain only;"
                " give a plane mesh without axisymmetry, or law = 'mohr-coulomb'."
            )
    _check_numbers(materials, mandel_size(tagged_mesh.mesh.geometry.dim))
    missing = sorted(set(tagged_mesh.volumes) - set(materials))
    if missing:
        raise InputError(
            f"volume '{missing[0]}' has no material; add one for it (this mesh has the volumes"
            f" {', '.join(sorted(tagged_mesh.volumes))})."
        )


def _check_numbers(materials: Mapping[str, Material], size: int) -> None:
    """Refuse materials whose numbers are not finite or whose elastic energy is not positive.

    Materials of this program check their numbers themselves; this function also checks user
    materials.

    Args:
        materials: Material of each volume.
        size: Number of components of Mandel vectors.

    Raises:
        InputError: If a material is refused; the message names the volume and the material.
    """
    known = set[tuple[Any, ...]]()
    for name, material in materials.items():
        what = f"the material of volume '{name}' ({type(material).__name__})"
        try:
            numbers = {
                key: one.scale if isinstance(one, SpatialField) else float(one)
                for key, one in material.parameters().items()
            }
        except ZeroDivisionError as error:
            raise InputError(
                f"{what} divides by zero when it computes the parameters of its law, as with "
                "poisson = 0.5; give numbers within their valid ranges."
            ) from error
        for key, number in numbers.items():
            if not math.isfinite(number):
                raise InputError(f"{what} has {key} = {number}; give a finite number.")
        same = (material.law, *numbers.items())
        if same in known:
            continue
        known.add(same)
        elastic = material.law(**{key: ufl.as_ufl(one) for key, one in numbers.items()}).elastic
        units = [ufl.as_vector(list(map(float, row))) for row in np.eye(size)]
        stiffness = np.column_stack([numbers_of(elastic.hooke(unit)) for unit in units])
        if not np.linalg.eigvalsh((stiffness + stiffness.T) / 2)[0] > 0:
            raise InputError(
                f"{what} has an elastic stiffness that is not positive definite "
                f"({_shown(numbers)}), so the energy of some strains is not positive; give young > "
                "0 and poisson between -1 and 1/2, or valid elastic constants of its law."
            )


def _shown(numbers: Mapping[str, float]) -> str:
    return ", ".join(f"{key} = {number:.6g}" for key, number in numbers.items())


def _parameters(
    tagged_mesh: TaggedMesh, spaces: Spaces, materials: Mapping[str, Material]
) -> dict[str, fem.Function]:
    """Return a function for each parameter name; laws with a parameter of this name share it.

    Collective.

    Raises:
        InputError: See :func:`set_parameters`.
    """
    found: dict[str, fem.Function] = {}
    for name in sorted(materials):
        for key in materials[name].parameters():
            if key not in found:
                found[key] = fem.Function(spaces.Q, name=key)
    set_parameters(tagged_mesh, materials, found)
    return found


def set_parameters(
    tagged_mesh: TaggedMesh,
    materials: Mapping[str, Material],
    functions: Mapping[str, fem.Function],
) -> None:
    """Set the functions to the parameters of the materials, at the points of their volumes.

    Collective if any parameter varies in space.

    Args:
        tagged_mesh: The bodies.
        materials: Material of each volume.
        functions: Functions in Q, by the names of the parameters.

    Raises:
        InputError: If a parameter that varies in space is not positive and finite at a point, or at
            a vertex of the mesh.
    """
    x = message = None
    for name in sorted(materials):
        cells = tagged_mesh.cells(name)
        for key, number in materials[name].parameters().items():
            space = functions[key].function_space
            points = space.dofmap.list[cells].ravel()
            if not isinstance(number, SpatialField):
                functions[key].x.array[points] = number
                continue
            if x is None:
                x = coordinates_of_points(space)
            try:
                every = np.concatenate([_vertices(tagged_mesh, cells), x[points]])
                _check_positive(number, name, every)
                functions[key].x.array[points] = number.at(x[points], f"a strength of '{name}'")
            except InputError as error:
                message = message or str(error)
    if x is not None:
        raise_together(tagged_mesh.mesh.comm, message)


def _vertices(tagged_mesh: TaggedMesh, cells: Ints) -> Floats:
    """Return the vertices of the owned cells in a volume."""
    vertices, places = corners(tagged_mesh.mesh)
    return places[np.unique(vertices[cells[cells < len(vertices)]])]


def _check_positive(number: SpatialField, name: str, x: Floats) -> None:
    """Refuse a strength that is not positive at some point.

    Raises:
        InputError: If the strength is refused; the message gives the point with the least strength.
    """
    values = number.profile.at(x, f"a strength of '{name}'")
    wrong = ~(values > 0)
    if wrong.any():
        lowest = int(np.argmin(values))
        raise InputError(
            f"the strength of '{name}', {number.profile}, is {values[lowest]:.6g} at "
            f"{place_of(x[lowest])}; a strength that varies must be positive in the whole "
            "body, so give a small positive value at this point."
        )


def _history(law: Law, spaces: Spaces, known: dict[str, fem.Function]) -> dict[str, fem.Function]:
    """Return the history of a law, set to zero; laws share history variables of the same name."""
    mesh, (m,) = spaces.S.mesh, spaces.S.value_shape
    shapes = law.history(m)
    for name, shape in shapes.items():
        if name not in known:
            known[name] = fem.Function(space_at_points(mesh, spaces.degree, shape), name=name)
        elif known[name].function_space.value_shape != shape:
            raise InputError(
                f"'{name}' in the history of {type(law).__name__} has shape {shape}, but in "
                f"another law it has shape {known[name].function_space.value_shape}; rename "
                "one of the variables."
            )
    return {name: known[name] for name in shapes}


def integrate(laws: Iterable[LawOnCells], density: OfLaw) -> ufl.Form:
    """Return the integral of a density over the cells of all laws.

    Args:
        laws: Laws of a problem.
        density: Function that returns the density for a law: a scalar that is linear in each test
            and trial function.
    """
    return reduce(add, (_valid(density(on), on) * on.dx for on in laws))


class LawExpression:
    """An expression for each law at the points of its cells, compiled once."""

    def __init__(self, laws: Sequence[LawOnCells], space: fem.FunctionSpace, value: OfLaw) -> None:
        """Compile the expressions. Collective.

        Args:
            laws: Laws of a problem; only some of them if the others have no such value.
            space: Space of functions at the points (:func:`spaces.space_at_points`).
            value: Function that returns the value for a law, with the value shape of ``space``.
        """
        points = interpolation_points(space.element)
        self._parts = [(fem.Expression(_valid(value(on), on), points), on.cells) for on in laws]

    def interpolate(self, function: fem.Function) -> None:
        """Interpolate the values into ``function``, on the cells of the laws including ghosts."""
        for expression, cells in self._parts:
            evaluate(expression, function, cells)


def _valid(value: Expr, on: LawOnCells) -> Expr:
    """Return ``value`` with equal parts merged; UFL's 0, which has no mesh, as a constant 0."""
    if not isinstance(value, ufl.constantvalue.Zero):
        return merged(value)
    zero = np.zeros(value.ufl_shape, dtype=default_scalar_type)
    return fem.Constant(on.dx.ufl_domain(), zero)


def merged(expression: Expr) -> Expr:
    """Return an equal expression in which equal parts are one object.

    UFL compares equal parts node by node if they are different objects. If a law performs the steps
    of an iteration more than once, the time for this comparison grows exponentially with the number
    of steps.

    Args:
        expression: An expression; the function replaces operands of its parts by equal objects.
    """
    parts: dict[int, tuple[Expr, Expr]] = {}
    terminals: dict[Expr, Expr] = {}
    operators: dict[tuple[Any, ...], Expr] = {}
    waiting = [(expression, False)]
    while waiting:
        part, is_ready = waiting.pop()
        if id(part) in parts:
            continue
        if isinstance(part, Terminal):
            parts[id(part)] = part, terminals.setdefault(part, part)
        elif is_ready:
            operands = tuple(parts[id(of)][1] for of in part.ufl_operands)
            part.ufl_operands = operands
            key = (type(part), *map(id, operands))
            parts[id(part)] = part, operators.setdefault(key, part)
        else:
            waiting.append((part, True))
            waiting.extend((of, False) for of in part.ufl_operands)
    return parts[id(expression)][1]
