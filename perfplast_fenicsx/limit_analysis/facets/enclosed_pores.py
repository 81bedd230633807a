"""Enclose pore pressures between functions that are linear in each cell.

Suppose that a stress is in equilibrium, and that its effective stress σ + uδ satisfies the yield
condition. Then the bodies also carry the loads with any smaller pressure, because compression never
brings ground closer to yielding. In a mechanism, the pressure does the work ∫ u tr ε with tr ε ≥ 0,
and a smaller pressure does at most this work. Therefore a lower bound uses linear pressures above
the given pressures, and an upper bound uses linear pressures below them. Both bounds are strict.

In axisymmetry, bodies with pore pressures must preserve their volume. The pressures then do no
work, and :func:`without_pores` removes them.
"""

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.errors import InputError, on_all_ranks
from perfplast_fenicsx.formulas import ROUNDING
from perfplast_fenicsx.materials.coulomb_ground import MohrCoulomb, Tresca
from perfplast_fenicsx.materials.drucker_prager import DruckerPrager
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.von_mises import VonMises
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.loads import EnclosedPores, FieldPores, Load, PorePressure
from perfplast_fenicsx.problem.problem import Problem, variant
from perfplast_fenicsx.spatial_fields import SpatialField

PRESSED = (Elastic, VonMises, Tresca, DruckerPrager, MohrCoulomb)
"""Laws for which an admissible stress stays admissible if a compressive pressure is added."""


def with_enclosed_pores(problem: Problem, side: str) -> Problem:
    """Return the problem with linear pore pressures above or below the given pressures. Collective.

    The function returns the problem itself if all pressures are linear in each cell, if a load
    grows, in axisymmetry, and on curved cells. With growing loads, one proof contains both bounds,
    which therefore need the same loads. Pressures in bodies of laws other than :data:`PRESSED` do
    not change.

    Args:
        problem: The bodies and their loads.
        side: "above" or "below": the side of the given pressures on which the linear functions lie.
    """
    bent = _bent(problem)
    if not bent:
        return problem
    loads = [_enclosed(load, side) if load in bent else load for load in problem.given.loads]
    return variant(problem, loads=loads)


def without_pores(problem: Problem, dilates: bool) -> Problem:
    """Return the axisymmetric problem without pore pressures. Collective.

    If bodies preserve their volume, a pore pressure does no work. Effective and total stresses then
    differ by a mean stress, which does not affect yielding.

    Args:
        problem: The bodies.
        dilates: Whether any body dilates.

    Raises:
        InputError: If a body dilates and there are pore pressures.
    """
    loads = [load for load in problem.given.loads if not isinstance(load, PorePressure)]
    if len(loads) == len(problem.given.loads):
        return problem
    if dilates:
        raise InputError(
            "in axisymmetry strict bounds do not support pore pressure in ground that dilates; "
            "remove the pressure, or give control = 'work' and until = 'limit', for the limit "
            "load of the mesh."
        )
    return Problem(problem.tagged_mesh, **{**vars(problem.given), "loads": loads})


def pores_in_words(problem: Problem) -> tuple[str, ...]:
    """Return clauses on how bounds approximate nonlinear pressures. Collective."""
    return tuple(
        f"the pore pressure in '{load.on}', which is not linear in each cell, is bounded from "
        "above for the lower bound and from below for the upper bound, so both bounds are strict"
        for load in _bent(problem)
    )


def on_kinks(
    tagged_mesh: TaggedMesh,
    loads: Sequence[Load],
    strengths: Sequence[tuple[str, SpatialField]] = (),
) -> npt.NDArray[np.bool_]:
    """Return a flag for each local vertex: whether a pressure's or strength's gradient jumps.

    Collective.

    Args:
        tagged_mesh: Mesh of straight cells.
        loads: Loads of any kind; the function uses only the pore pressures among them.
        strengths: Names of volumes, each with a strength field.
    """
    mesh = tagged_mesh.mesh
    index_map = mesh.topology.index_map(0)
    count = index_map.size_local + index_map.num_ghosts
    found = np.zeros(count, dtype=bool)
    known: list[tuple[str, Callable[[Floats], Floats | None]]] = []
    for load in loads:
        if isinstance(load, PorePressure) and isinstance(load.value, str):
            linear = load if isinstance(load, FieldPores) else _enclosed(load, "below")
            known.append((load.on, linear.at_corners))
    for name, field in strengths:
        known.append((name, partial(_low, field)))
    for name, at_corners in known:
        cells, vertices, places = _cells(tagged_mesh, name)
        values = on_all_ranks(mesh.comm, partial(at_corners, places))
        if values is None:
            continue
        d = places.shape[2]
        slopes = np.einsum("cv,cvi->ci", values, gradients(places)[0])
        sums = la.vector(index_map, 1 + 2 * d, dtype=np.float64)
        table = sums.array.reshape(count, 1 + 2 * d)
        rows = np.hstack([np.ones((len(cells), 1)), slopes, slopes**2])
        np.add.at(table, vertices.ravel(), np.repeat(rows, d + 1, axis=0))
        sums.scatter_reverse(la.InsertMode.add)
        sums.scatter_forward()
        spread = table[:, :1] * table[:, 1 + d :] - table[:, 1 : 1 + d] ** 2
        largest = tagged_mesh.mesh.comm.allreduce(np.abs(slopes).max(initial=0.0), MPI.MAX)
        noticed = 1e-6  # share of the largest gradient, far above rounding in small cells
        found |= (spread > (noticed * largest) ** 2 * table[:, :1] ** 2).any(axis=1)
    return found


def _low(field: SpatialField, corners: Floats) -> Floats:
    """Return the vertex values of linear functions that are below a strength in each cell."""
    return field.between(corners, "a strength")[0]


def _bent(problem: Problem) -> list[Load]:
    """Return the pore pressures that are not linear in each cell and can be enclosed.

    Collective.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    pores = [it for it in given.loads if type(it) is PorePressure and isinstance(it.value, str)]
    if not pores or not all(load.constant for load in given.loads):
        return []
    if tagged_mesh.axisymmetric or has_curved_cells(tagged_mesh.mesh):
        return []
    found: list[Load] = []
    for load in pores:
        _, _, places = _cells(tagged_mesh, load.on)
        low, high = (_enclosed(load, side).at_corners(places) for side in ("below", "above"))
        known = isinstance(given.materials[load.on], PRESSED) and low is not None
        apart = np.zeros(2)
        if low is not None and high is not None:
            apart[:] = (high - low).max(initial=0.0), np.abs(high).max(initial=0.0)
        problem.comm.Allreduce(MPI.IN_PLACE, apart, MPI.MAX)
        if problem.comm.allreduce(known, MPI.LAND) and apart[0] > ROUNDING * apart[1]:
            found.append(load)
    return found


def _cells(tagged_mesh: TaggedMesh, name: str) -> tuple[Ints, Ints, Floats]:
    """Return a volume's owned cells, the local vertices of these cells, and their coordinates."""
    vertices, points = corners(tagged_mesh.mesh)
    cells = tagged_mesh.cells(name)
    cells = cells[cells < len(vertices)]
    return cells, vertices[cells], points[vertices[cells]]


def _enclosed(load: Load, side: str) -> EnclosedPores:
    told: dict[str, Any] = {it.name: getattr(load, it.name) for it in fields(PorePressure)}
    return EnclosedPores(**told, side=side)
