"""Compute axes of a facet's components, the first one along its normal."""

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags


def turned_axes(normal: Floats, held: PairFlags, aligned: PairFlags) -> tuple[Floats, PairFlags]:
    """Return axes that begin with a normal, and flags of the axes that are held.

    Args:
        normal: Unit vectors, zero in held components, shape (n, d). Vectors that are equal to
            rounding get the same axes.
        held: Flags of Cartesian components that are held, shape (n, d).
        aligned: Flags of other components that are to be axes, shape (n, d).

    Returns:
        Shapes (n, d, d) and (n, d).
    """
    tdim = normal.shape[1]
    digits = 6  # decimals in which components of normals are compared
    sizes = np.round(1 - np.abs(normal), digits)
    first = np.where(held, 3.0, np.where(aligned, 2.0, sizes))
    order = np.argsort(-first, axis=1, kind="stable")
    columns = np.swapaxes(np.eye(tdim)[order[:, : tdim - 1]], 1, 2)
    Q, R = np.linalg.qr(np.concatenate([normal[:, :, None], columns], axis=2))
    Q = Q * np.sign(np.einsum("nii->ni", R))[:, None, :]
    axes = np.swapaxes(Q, 1, 2)
    count = held.sum(axis=1)
    return axes, (np.arange(tdim) > 0) & (np.arange(tdim) <= count[:, None])
