"""Whether cells have shapes to compute with, and are sections of rings where that is said."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats
from perfplast_fenicsx.proof.plain_arrays import ProofError

Longs = npt.NDArray[np.int64]


def with_kind(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return arrays with what says that cells are no sections of rings, where nothing does.

    And that no cone has a tensile strength, and no strength varies in a cell.
    """
    cuts = np.full(np.shape(arrays.get("cone_sine", ())), np.nan)
    ones = np.ones(np.shape(arrays.get("cells", ())))
    without = {"revolved": np.zeros((), dtype=bool), "cone_tension": cuts, "cell_strength": ones}
    return {**without, **arrays}


def check_cells(places: Floats, volumes: Floats, gradients: Callable[[], Floats]) -> None:
    """Make sure that shapes are not lost to rounding.

    Args:
        places: Places of the cells' vertices, shape (num_cells, d + 1, d).
        volumes: Volumes of the cells.
        gradients: Gives those of their barycentric coordinates, where there is a volume.

    Raises:
        ProofError: If one is.
    """
    d, size = places.shape[2], np.ptp(places, axis=1).max(axis=1)
    # From the origin, relative to the cell: farther away its shape is lost to rounding.
    farthest = 1e12
    if not (np.abs(places).max(axis=(1, 2)) <= farthest * size).all():
        raise ProofError("a cell is too small for where it is: its shape is lost to rounding.")
    if not (np.isfinite(size**d).all() and (volumes > 1e-12 * size**d).all()):
        raise ProofError("a cell has no volume.")
    if not (np.isfinite(gradients()).all() and (size**d > 0).all()):
        raise ProofError("cells are too small or too large to compute with.")


def check_sections(
    places: Floats, pores: Iterable[Floats], held: npt.NDArray[np.bool_], loose: bool
) -> None:
    """Make sure that cells can be sections of rings, and of what is known of these.

    Args:
        places: Places of the cells' vertices.
        pores: Pressures in pores of each kind of loads, which may cancel.
        held: Components of rigid surfaces that cannot move, shape (num_rigid, 2).
        loose: Whether a cone has no bound.

    Raises:
        ProofError: If they cannot.
    """
    if places.shape[2] != 2 or places[..., 0].min() < 0:
        raise ProofError("bodies of revolution reach to negative radii, or are no sections.")
    if not (held == [True, False]).all():
        raise ProofError("a rigid surface of a body of revolution moves otherwise than along it.")
    if loose:
        raise ProofError("a cone has no bound, which is not known for bodies of revolution.")
    if any(pressure.any() for pressure in pores):
        raise ProofError("pressures in pores are not known of bodies of revolution.")


def in_order_of(sides: Longs, mine: Longs, given: Longs) -> tuple[Longs, bool]:
    """Sides of facets in the order in which these are given, and whether they are the same ones.

    Args:
        sides: Shape (n,).
        mine: Vertices of each, shape (n, d).
        given: Those of facets, shape (num_facets, d).
    """
    mine, given = np.sort(mine, axis=1), np.sort(given, axis=1)
    if len(mine) != len(given):
        return sides[:0], False
    by_mine, by_given = np.lexsort(mine.T), np.lexsort(given.T)
    found = np.empty(len(given), dtype=np.int64)
    found[by_given] = sides[by_mine]
    return found, bool((mine[by_mine] == given[by_given]).all())
