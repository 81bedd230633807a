"""Define the domain of varying loads, and compute the elastic stress due to each load.

In straight quadratic cells, stresses are linear, and the module evaluates them at the vertices. If
the stress is in the yield set at all vertices, it is in this set in the whole cell, including the
surface of the bodies, where elastic stresses are largest. With linear shape functions λ_v and
linear strain rates, the equation

    ∫ σ:ε = Σ_v |T|/(d + 1) σ_v:ε(y_v),    y_v = (2 x_v + Σ_{w ≠ v} x_w)/(d + 2),

with the vertices x_v of a cell T, is exact. The stress at a vertex thus does work on the strain at
a point y_v between the vertex and the centre of the cell. Linear functions in each cell approximate
temperatures.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.discrete.body_cones import materials_of, whole_cones
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains, RatesAtPoints
from perfplast_fenicsx.limit_analysis.facets.stress_cells import with_points
from perfplast_fenicsx.limit_analysis.shakedown.corner_program import Frames
from perfplast_fenicsx.materials.elastic import Rigid
from perfplast_fenicsx.materials.mandel import numbers_of
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.initial_strain import initial_strain
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class StressPoints:
    """The problem with the points of stresses, and the problem with the points of strains.

    Attributes:
        known: Problem whose points are the points of the stresses.
        working: Problem whose points are the points of the conjugate strains, in the same order.
        linear: Whether the points of the stresses are the vertices of cells; otherwise both sets of
            points are the quadrature points.
    """

    known: Problem
    working: Problem
    linear: bool


def stress_points(problem: Problem) -> StressPoints:
    """Return the problem with points for stresses and for strains. Collective.

    Both sets are the quadrature points for linear elements, in axisymmetry and in curved cells.
    """
    mesh = problem.tagged_mesh.mesh
    linear = problem.degree == 2 and not problem.tagged_mesh.axisymmetric
    if not linear or has_curved_cells(mesh):
        return StressPoints(problem, problem, False)
    vertices = np.asarray(basix.geometry(mesh.basix_cell()), dtype=np.float64)
    working = with_points(problem, (vertices + vertices.sum(axis=0)) / (mesh.geometry.dim + 2))
    return StressPoints(with_points(problem, vertices), working, True)


def elastic_stresses(
    problem: Problem, names: Sequence[str], points: StressPoints, strains: PointStrains
) -> tuple[Floats, Floats]:
    """Return the elastic stresses from varying loads and from constant loads. Collective.

    The stresses from varying loads are for the factor 1. Stresses from temperatures without a name
    in ``names``, and initial stresses, are in equilibrium with zero loads; the residual stress
    contains these stresses.

    Args:
        problem: The bodies and their loads.
        names: Names of loads and temperatures that vary.
        points: Points of the stresses.
        strains: Strains at the points at which stresses do work.

    Returns:
        Mandel vectors, shapes (num_names, count, m) and (count, m).

    Raises:
        SingularStiffness: If supports do not prevent rigid-body motions.
    """
    given = problem.given
    constant = [load for load in given.loads if load.constant]
    with ExitStack() as made:
        here = strains
        if points.working is not problem:
            here = PointStrains(problem, whole_cones(problem))
            made.callback(here.destroy)
        bodies = ConicStiffness(problem, here)
        made.callback(bodies.destroy)
        bodies.assemble(_elastic_moduli(problem, here))
        bodies.factorise()
        answer = _Elastic(points.known, bodies, strains)
        found = []
        for name in names:
            loads = [load for load in given.loads if called(load) == name]
            warmed = [a for a in given.initial if isinstance(a, Temperature) and called(a) == name]
            found.append(answer.stress(loads, warmed))
        return np.array(found), answer.stress(constant, [])


class _Elastic:
    """The response of elastic bodies to loads and temperatures."""

    def __init__(self, known: Problem, bodies: ConicStiffness, strains: PointStrains) -> None:
        """Store the factorised stiffness, and compute Hooke's tensor at the points. Collective."""
        self._problem, self._bodies, self._working = known, bodies, strains
        self._rates, self._hooke = RatesAtPoints(known), hooke_at_points(known)

    def stress(self, loads: Sequence[Load], warmed: Sequence[Temperature]) -> Floats:
        """Return the stress C(ε(u) − e₀) in equilibrium with ``loads``, shape (count, m).

        Collective. The strain e₀ is the thermal strain from ``warmed``.
        """
        problem = self._problem
        load = work_vector(problem.V, problem.tagged_mesh, loads)
        fem_petsc.set_bc(load, problem.bcs)
        right, change = problem.create_vector(), problem.create_vector()
        problem.basis.T.multTranspose(load, right)
        strain: Floats = np.zeros(self._hooke.shape[:2])
        if warmed:
            spaces = Spaces(problem.degree, problem.V, problem.S, problem.Q, problem.dx)
            told = (problem.tagged_mesh, spaces, problem.given.materials, problem.laws)
            thermal = initial_strain(*told, warmed)
            if thermal is not None:
                strain = -thermal.x.array[: strain.size].reshape(strain.shape)
        self._working.forces_of(self._product(strain), change)
        right.axpy(-1.0, change)
        self._bodies.solve(right, change)
        u = fem.Function(problem.V)
        problem.basis.T.mult(change, u.x.petsc_vec)
        u.x.scatter_forward()
        found = self._product(strain + self._rates.of(u))
        for vector in (load, right, change):
            vector.destroy()
        return found

    def _product(self, strain: Floats) -> Floats:
        return np.asarray(np.einsum("nij,nj->ni", self._hooke, strain), np.float64)


def _elastic_moduli(problem: Problem, strains: PointStrains) -> Moduli:
    """Return Hooke's tensor C at the points of a problem, in the coordinates of its cones."""
    frames, hooke = Frames(strains.coordinates, strains.size), hooke_at_points(problem)
    to = frames.columns @ frames.of_stresses
    values, axes = np.linalg.eigh(hooke)
    roots = to @ (axes * np.sqrt(np.maximum(values, 0.0))[:, None])
    count, _, m = roots.shape
    ones = np.ones(count)
    return Moduli(ones, ones, np.zeros((count, m))).with_whole(np.arange(count), roots)


def hooke_at_points(problem: Problem) -> Floats:
    """Return Hooke's tensor C at the points of this rank, shape (count, m, m). Not collective."""
    tagged_mesh, size = problem.tagged_mesh, problem.S.dofmap.index_map_bs
    count, cells = problem.Q.dofmap.index_map.size_local, problem.Q.dofmap.list
    found: Floats = np.zeros((count, size, size))
    units = [ufl.as_vector([float(i == j) for j in range(size)]) for i in range(size)]
    for name, material in materials_of(problem).items():
        given: Mapping[str, Any] = {k: ufl.as_ufl(v) for k, v in material.parameters().items()}
        elastic = material.law(**given).elastic
        points = cells[tagged_mesh.cells(name)].ravel()
        hooke = np.column_stack([numbers_of(elastic.hooke(unit)) for unit in units])
        found[points[points < count]] = hooke
    return found


def check_elastic(materials: Mapping[str, object]) -> None:
    """Check that no body is rigid, because a rigid body has no elastic stresses.

    Raises:
        InputError: If a body is rigid; the message names the first rigid body.
    """
    rigid = sorted(name for name, of in materials.items() if isinstance(of, Rigid))
    if rigid:
        raise InputError(
            f"the body '{rigid[0]}' has law = 'rigid' and therefore no elastic stresses, which "
            "control = 'shakedown' superposes; give law = 'elastic', and make young 1e5 times as "
            "large as in the adjacent bodies."
        )


def check_names(problem_loads: Sequence[Load], warmed: Sequence[str], names: Sequence[str]) -> None:
    """Check that the names of varying loads exist, and that all growing loads vary.

    Args:
        problem_loads: The loads.
        warmed: Names of temperatures.
        names: Names of loads and temperatures that vary.

    Raises:
        InputError: If a name is invalid, or if a growing load does not vary; the message contains
            the name.
    """
    growing = [called(load) for load in problem_loads if not load.constant]
    constant = [called(load) for load in problem_loads if load.constant]
    for name in names:
        if name in constant:
            raise InputError(
                f"'{name}' varies, but this load is constant; remove constant = true, or remove "
                f"'{name}' from ranges or corners."
            )
        if name not in growing and name not in warmed:
            raise InputError(
                f"'{name}' varies, but no load or change of temperature has this name; "
                f"{nearest(name, [*growing, *warmed])}"
            )
    for name in growing:
        if name not in names:
            raise InputError(
                f"the load '{name}' has no range; give a range, or set constant = true if the load "
                "does not vary."
            )


@dataclass(frozen=True)
class LoadDomain:
    """The convex hull of corners; each corner has a factor for each name.

    Attributes:
        names: Names of loads and temperatures that vary.
        corners: Factors of the corners, shape (num_corners, num_names).
    """

    names: tuple[str, ...]
    corners: Floats

    @staticmethod
    def of_ranges(ranges: Mapping[str, Sequence[float]]) -> "LoadDomain":
        """Return the domain in which each factor varies independently between two limits.

        Args:
            ranges: Smallest and largest factor of each name.

        Raises:
            InputError: If there is no range, if there are too many ranges, or if a range is not
                valid.
        """
        if not ranges:
            raise InputError(
                "ranges is empty; give at least one range, such as { pressure = [0, 1] }."
            )
        most = 6  # 64 corners, each with its own cone at every point
        if len(ranges) > most:
            raise InputError(
                f"there are {len(ranges)} ranges, and so {2 ** len(ranges)} corners; give at most "
                f"{most} ranges, or only the corners that occur, as corners = [...]."
            )
        for name, given in ranges.items():
            if len(given) != 2 or not all(map(math.isfinite, given)) or not given[0] < given[1]:
                shown = ", ".join(f"{value:g}" for value in given)
                raise InputError(
                    f"[{shown}] is not a valid range for '{name}'; give two different factors, the "
                    "smaller one first. For a load that does not vary, set constant = true."
                )
        corners = np.array(list(itertools.product(*ranges.values())), dtype=np.float64)
        return LoadDomain(tuple(ranges), corners)

    @staticmethod
    def of_corners(corners: Sequence[Mapping[str, float]]) -> "LoadDomain":
        """Return the convex hull of given corners.

        A name that a corner does not contain has the factor 0 at this corner.

        Raises:
            InputError: If there are fewer than two different corners, or if a factor is not finite.
        """
        names = tuple(dict.fromkeys(name for corner in corners for name in corner))
        rows = [[float(corner.get(name, 0.0)) for name in names] for corner in corners]
        if not np.isfinite(np.array(rows)).all():
            raise InputError("corners contains a factor that is not finite; give finite numbers.")
        different = sorted(set(map(tuple, rows)))
        if len(different) < 2:
            raise InputError(
                "corners does not contain two different corners, so nothing varies; give at least "
                "two, or control = 'bounds' for loads that grow once."
            )
        return LoadDomain(names, np.array(different))
