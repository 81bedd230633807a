"""Laws at the points: a cone of whole stress vectors, and Hooke's matrix."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.body_cones import (
    materials_of,
    plain_cone,
)
from perfplast_fenicsx.limit_analysis.discrete.standard_cones import PlainCone
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.materials.mandel import numbers_of
from perfplast_fenicsx.materials.yield_set import Cone
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.spatial_fields import SpatialField


@dataclass(frozen=True)
class PointLaws:
    """Cones ‖Mσ‖ ≤ c − q·σ and elasticity at the points of this rank.

    Attributes:
        plastic: Numbers of the points that can yield, shape (num,).
        bounds: c of these (stress), shape (num,).
        maps: [−q; M] of these, shape (num, 1 + k, m).
        bounded: Orthonormal stresses that the cones of these bound, as columns, and zeros where a
            cone bounds fewer than others, shape (num, m, r).
        unbounded: The same of those that no cone of a point bounds, shape (count, m, r').
        hooke: C, shape (count, m, m).
    """

    plastic: Longs
    bounds: Floats
    maps: Floats
    bounded: Floats
    unbounded: Floats
    hooke: Floats

    @staticmethod
    def of(problem: Problem) -> "PointLaws":
        """Ask the laws. Collective.

        Raises:
            InputError: If a body's yield set is no second-order cone.
        """
        tagged_mesh, count = problem.tagged_mesh, problem.Q.dofmap.index_map.size_local
        size, cells = problem.S.dofmap.index_map_bs, problem.Q.dofmap.list
        numbers: Longs = np.zeros(count, dtype=np.int64)
        names = sorted(tagged_mesh.volumes)
        for number, name in enumerate(names):
            points = cells[tagged_mesh.cells(name)].ravel()
            numbers[points[points < count]] = number
        materials = materials_of(problem)  # sheets have other ones
        found = [_of_body(name, materials[name], size) for name in names]
        rows = max((len(cone.matrix) for cone, _ in found if cone is not None), default=0)
        maps, bounds = np.zeros((len(names), 1 + rows, size)), np.zeros(len(names))
        unbounded = np.tile(np.eye(size), (len(names), 1, 1))
        bounded = np.zeros((len(names), size, size))
        for number, (cone, _) in enumerate(found):
            if cone is not None:
                bounds[number] = cone.bound
                maps[number, 0] = -cone.slope
                maps[number, 1 : 1 + len(cone.matrix)] = cone.matrix
                _, values, directions = np.linalg.svd(maps[number])
                rank = int((values > ROUNDING * values[0]).sum())
                bounded[number, :, :rank] = directions[:rank].T
                unbounded[number] = 0.0
                unbounded[number, :, : size - rank] = directions[rank:].T
        yields = np.array([cone is not None for cone, _ in found])
        plastic: Longs = np.flatnonzero(yields[numbers])
        of_plastic, hooke = numbers[plastic], np.array([matrix for _, matrix in found])
        used = [max(int(some.any(axis=1).sum(axis=1).max()), 1) for some in (bounded, unbounded)]
        return PointLaws(
            plastic=plastic,
            bounds=bounds[of_plastic],
            maps=maps[of_plastic],
            bounded=bounded[of_plastic, :, : used[0]],
            unbounded=unbounded[numbers, :, : used[1]],
            hooke=hooke[numbers],
        )


def _of_body(name: str, material: Material, size: int) -> tuple[PlainCone | None, Floats]:
    """Return the cone of a body, None of one that never yields, and C.

    Raises:
        InputError: If its yield set is something else, or it hardens.
    """
    if any(isinstance(one, SpatialField) for one in material.parameters().values()):
        raise InputError(
            f"a strength of '{name}' varies in space, and shakedown needs numbers; give a body to"
            " each layer, or a limit load in place of shakedown."
        )
    given: Mapping[str, Any] = {k: ufl.as_ufl(v) for k, v in material.parameters().items()}
    law: Any = material.law(**given)
    cones = None if law.carries_any_load else law.yields.cones(size)
    if cones is None or len(cones) > 1 or (cones and not isinstance(cones[0], Cone)):
        raise InputError(
            "shakedown needs a yield set that is one cone of stresses, which is not true of"
            f" '{name}' ({type(material).__name__}); give law = 'von-mises', 'drucker-prager',"
            " 'hill' or 'elastic'."
        )
    units = [ufl.as_vector([float(i == j) for j in range(size)]) for i in range(size)]
    hooke = np.column_stack([numbers_of(law.elastic.hooke(unit)) for unit in units])
    return (plain_cone(cones[0], law, size).normalised() if cones else None), hooke
