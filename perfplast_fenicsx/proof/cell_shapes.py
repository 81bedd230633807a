"""Check that rounding preserves the shapes of cells, and that sections of rings are valid."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats
from perfplast_fenicsx.proof.plain_arrays import ProofError

Longs = npt.NDArray[np.int64]


def with_kind(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return the arrays, with default values for missing arrays.

    By default, cells are not sections of rings, no cone has a tensile strength or a curvature, and
    strengths are uniform in each cell.
    """
    none = np.full(np.shape(arrays.get("cone_sine", ())), np.nan)
    ones = np.ones(np.shape(arrays.get("cells", ())))
    without = {"revolved": np.zeros((), dtype=bool), "cell_strength": ones}
    return {**without, "cone_tension": none, "cone_curvature": none, **arrays}


def check_cells(places: Floats, volumes: Floats, gradients: Callable[[], Floats]) -> None:
    """Refuse cells whose shapes are lost to rounding.

    Args:
        places: Coordinates of the cells' vertices, shape (num_cells, d + 1, d).
        volumes: Volumes of the cells.
        gradients: Function that returns the gradients of the cells' barycentric coordinates; called
            only if every volume is positive.

    Raises:
        ProofError: If the shape of a cell is lost, or if its numbers are too small or too large.
    """
    d, size = places.shape[2], np.ptp(places, axis=1).max(axis=1)
    # Largest distance from the origin, relative to the size of the cell, at which the coordinates
    # define the cell's shape.
    farthest = 1e12
    if not (np.abs(places).max(axis=(1, 2)) <= farthest * size).all():
        raise ProofError(
            "a cell is too small for its distance from the origin: its shape is lost to rounding."
        )
    if not (np.isfinite(size**d).all() and (volumes > 1e-12 * size**d).all()):
        raise ProofError("a cell has no volume.")
    smallest, largest = 1e-20, 1e20  # squares of strain rates times volumes do not underflow
    inside = (size >= smallest) & (size <= largest)
    if not (np.isfinite(gradients()).all() and inside.all()):
        raise ProofError("cells are too small or too large for the computation.")


def check_sections(
    places: Floats, pores: Iterable[Floats], held: npt.NDArray[np.bool_], loose: bool
) -> None:
    """Refuse cells that cannot be sections of rings, and data that rings do not support.

    Args:
        places: Coordinates of the cells' vertices.
        pores: Pore pressures of each kind of loads, checked separately because their sum may
            vanish.
        held: Flags of velocity components that are zero on rigid surfaces, shape (num_rigid, 2).
        loose: Whether a cone has c = 0.

    Raises:
        ProofError: If cells or data are refused.
    """
    if places.shape[2] != 2 or places[..., 0].min() < 0:
        raise ProofError(
            "bodies of revolution reach negative radii, or their mesh is not a plane section."
        )
    if not (held == [True, False]).all():
        raise ProofError(
            "a rigid surface of a body of revolution can move in a direction other than the axis."
        )
    if loose:
        raise ProofError("a cone has no bound, which is not supported for bodies of revolution.")
    if any(pressure.any() for pressure in pores):
        raise ProofError("pore pressures are not supported for bodies of revolution.")


def in_order_of(sides: Longs, mine: Longs, given: Longs) -> tuple[Longs, bool]:
    """Return the sides of given facets, and whether both sets of facets are equal.

    Args:
        sides: Sides, shape (n,).
        mine: Vertices of each side, shape (n, d).
        given: Vertices of the given facets, shape (num_facets, d).
    """
    mine, given = np.sort(mine, axis=1), np.sort(given, axis=1)
    if len(mine) != len(given):
        return sides[:0], False
    by_mine, by_given = np.lexsort(mine.T), np.lexsort(given.T)
    found = np.empty(len(given), dtype=np.int64)
    found[by_given] = sides[by_mine]
    return found, bool((mine[by_mine] == given[by_given]).all())
