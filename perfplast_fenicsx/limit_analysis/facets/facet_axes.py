"""Axes of a facet's components, the first one along its normal."""

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags


def turned_axes(normal: Floats, held: PairFlags, aligned: PairFlags) -> tuple[Floats, PairFlags]:
    """Return axes that begin with a normal, and which of them are held.

    Args:
        normal: Unit vectors that no held component has a part in, shape (n, d). Those that are the
            same but for rounding get the same axes.
        held: Cartesian components, shape (n, d).
        aligned: Others that are to be axes, shape (n, d).

    Returns:
        Shapes (n, d, d) and (n, d).
    """
    tdim = normal.shape[1]
    digits = 6  # decimals of components of normals that are compared
    sizes = np.round(1 - np.abs(normal), digits)
    first = np.where(held, 3.0, np.where(aligned, 2.0, sizes))
    order = np.argsort(-first, axis=1, kind="stable")
    columns = np.swapaxes(np.eye(tdim)[order[:, : tdim - 1]], 1, 2)
    Q, R = np.linalg.qr(np.concatenate([normal[:, :, None], columns], axis=2))
    Q = Q * np.sign(np.einsum("nii->ni", R))[:, None, :]
    axes = np.swapaxes(Q, 1, 2)
    count = held.sum(axis=1)
    return axes, (np.arange(tdim) > 0) & (np.arange(tdim) <= count[:, None])
