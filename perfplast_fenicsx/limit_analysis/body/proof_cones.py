"""Write the cones that bound the stress of each body into a proof file."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import (
    Side,
    profiles_of_cells,
    steepness_of_cells,
)
from perfplast_fenicsx.mesh.global_ordering import Block, Ordering, block
from perfplast_fenicsx.problem.problem import Problem


def cones_on_file(problem: Problem, of_cells: Ordering, side: Side) -> dict[str, Block]:
    """Return the cones of the bodies, the cone of each cell, and its factor if it varies.

    Collective. If the friction angle varies, each cell has its own cone.

    Args:
        problem: The bodies.
        of_cells: Order of the cells in the file.
        side: Side on which linear functions bound the profiles of strengths that vary.
    """
    found = body_cones(problem)
    tagged_mesh = problem.tagged_mesh
    d = tagged_mesh.mesh.topology.dim
    m = 4 if tagged_mesh.axisymmetric else d * (d + 1) // 2
    numbers = np.full(len(found.cones), -1)
    rows: list[tuple[Any, ...]] = []
    for number, cone in enumerate(found.cones):
        if (principal := cone.principal) is not None:
            cut = principal.tension if np.isfinite(principal.tension) else np.nan
            rows.append((principal.bound, np.zeros(m), np.zeros((m, m)), principal.sine, cut))
        elif (plain := cone.plain) is not None:
            matrix = np.pad(plain.matrix, ((0, m - len(plain.matrix)), (0, 0)))
            rows.append((plain.bound, plain.slope, matrix, np.nan, np.nan))
        else:
            continue
        numbers[number] = len(rows) - 1
    columns = zip(*rows, strict=True) if rows else ((),) * 5
    bounds, slopes, forms, sines, cuts = map(np.array, columns)
    of_each = numbers[found.of_cells]
    if (steepness := steepness_of_cells(problem, side)) is not None:
        of_each, kinds, steep = _unlike(problem, of_each, steepness)
        bounds, slopes, forms, sines, cuts = (
            it[kinds] for it in (bounds, slopes, forms, sines, cuts)
        )
        slopes *= steep[:, None]
    profile = profiles_of_cells(problem, side)
    varies = {} if profile is None else {"cell_strength": block(of_cells, profile)}
    return {
        **varies,
        "cone": block(of_cells, of_each),
        "cone_bound": table_of(problem, bounds, (), np.float64),
        "cone_slope": table_of(problem, slopes, (m,), np.float64),
        "cone_matrix": table_of(problem, forms, (m, m), np.float64),
        "cone_sine": table_of(problem, sines, (), np.float64),
        "cone_tension": table_of(problem, cuts, (), np.float64),
    }


def _unlike(problem: Problem, kinds: Longs, steepness: Floats) -> tuple[Longs, Longs, Floats]:
    """Return a number for each pair of a kind of cone and a factor of its slope. Collective.

    Args:
        problem: Problem with the ranks.
        kinds: Kind of each cell of this rank, -1 of elastic ones, shape (num_cells,).
        steepness: Factor of each.

    Returns:
        The number of each cell, -1 of elastic ones; kind and factor of each number, the same on all
        ranks.
    """
    plastic = kinds >= 0
    own = np.column_stack([kinds, steepness])[plastic]
    every = np.unique(np.concatenate(problem.comm.allgather(np.unique(own, axis=0))), axis=0)
    found = np.full(len(kinds), -1)
    _, numbers = np.unique(np.concatenate([every, own]), axis=0, return_inverse=True)
    found[plastic] = numbers.ravel()[len(every) :]
    return found, every[:, 0].astype(np.int64), every[:, 1]


def table_of(
    problem: Problem, rows: Sequence | npt.NDArray, shape: tuple[int, ...], kind: npt.DTypeLike
) -> Block:
    """Return rows that every rank has as an array on rank 0.

    Args:
        problem: Problem with the ranks.
        rows: The rows, the same on all ranks.
        shape: Shape of a row.
        kind: Type of its numbers.
    """
    values = np.asarray(rows, dtype=kind).reshape(len(rows), *shape)
    return Block(values if problem.comm.rank == 0 else values[:0], 0, len(rows))
